"""Nine actions by the whole method. Hsiao (2008), chapter 4.

The thesis shows pictures of its sequences s1 to s9, of 38 to 1,110 frames at 30 a second, calls the results robust, and prints neither
errors nor times nor how many particles it has. Here, on rendered actions like them, in as many frames: its system as printed
(`hsiao2008`), the same without temporal consistency (every frame a new start), and `default`, the swarm in the house's company. Matched
within 100 mm; a frame without a fit counts as wrong in all landmarks. Quick: 45 frames of each at 15 a second, one seed.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report, Table
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.style import COLORS
from hmc.experiments.hsiao_runs import WAYS, facing_interval, pose_cell, sequence_name, sequences
from hmc.experiments.nine_actions import NINE_ACTIONS
from hmc.experiments.pose_intervals import SCORES, ahead, following, score_interval
from hmc.experiments.truth import estimates
from hmc.metrics.landmarks import landmark_errors

__all__ = ["EXPERIMENT"]

SEEDS = 3
ALL = "all"
#: Of landmarks where a person is followed, and of frames where a body faces either way by chance.
HALF_PERCENT = 50.0
PRINTED, ALONE, OURS = WAYS
_DRAWN = {PRINTED: COLORS["paper"], OURS: COLORS["sparse"]}


def grid(plan: Plan) -> list[dict]:
    """One cell a sequence, way and seed."""
    seeds = range(1 if plan.quick else SEEDS)
    return [{"recording": source.label, "way": way, "repeat": seed} for source in sequences(plan) for way in WAYS for seed in seeds]


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row a sequence and way, with intervals; errors over time; of the thesis's system, whether every sequence is followed."""
    by: dict[tuple[str, str], list[Cell]] = {(sequence_name(one), one.parameters["way"]): [] for one in cells}
    for one in cells:
        by[sequence_name(one), one.parameters["way"]].append(one)
    names = list(dict.fromkeys(name for name, _ in by))
    of_way = {way: [one for one in cells if one.parameters["way"] == way] for way in WAYS}
    rows = [_row(name, way, by[name, way]) for name in names for way in WAYS if (name, way) in by]
    rows += [_row(ALL, way, own) for way, own in of_way.items() if own]
    followed = {name: following(by[name, PRINTED], HALF_PERCENT) for name in names}
    not_shown = ", ".join(name for name, one in followed.items() if not one.above_zero)
    together = score_interval(of_way[PRINTED], "MMTA_percent")
    facing = facing_interval(of_way[PRINTED])
    claims = (
        decide(
            "the thesis's system follows the person in every sequence: of each more than half of all landmarks within 100 mm",
            list(followed.values()),
            f"not shown of {not_shown}" if not_shown else "",
        ),
        decide("it does in all sequences together", together.over(HALF_PERCENT), f"{together} %"),
        decide(
            "self-spin turns the body the right way round (section 3.2.1.2): it faces as it does in more than half of the frames",
            facing.over(HALF_PERCENT),
            f"{facing} %",
        ),
        ahead("with temporal consistency errors are smaller than frame by frame", of_way[PRINTED], of_way[ALONE], "mean_mm", ("way",)),
    )
    return Report((Table("hsiao-4", "Nine actions by spectral skeletons and swarms.", rows),), {"hsiao-4": draw(by, names)}, claims)


def _row(name: str, way: str, cells: Sequence[Cell]) -> dict:
    scores = {score: score_interval(cells, score) for score in SCORES}
    frames = sum(one.results["frames"] for one in cells)
    return (
        {"sequence": name, "way": way, "what": NINE_ACTIONS[name][0] if name in NINE_ACTIONS else "", "seeds and clips": len(cells)}
        | {"frames_of_all_runs": frames, "frames_paper": NINE_ACTIONS[name][3] if name in NINE_ACTIONS else None}
        | {score: str(value) for score, value in scores.items()}
        | {"facing_percent": str(facing_interval(cells))}
        | {what: sum(one.results[what] for one in cells) for what in ("restarts", "without_fit")}
        | {f"{what}_per_frame": np.mean([one.results[f"{what}_per_frame"] for one in cells]) for what in ("evaluations", "seconds")}
    )


def draw(by: dict[tuple[str, str], list[Cell]], names: Sequence[str]) -> plt.Figure:
    """Mean error over time of the first seed, a panel a sequence."""
    columns = 3
    figure, axes = plt.subplots(-(-len(names) // columns), columns, figsize=(9, 2 * -(-len(names) // columns)), sharey=True, squeeze=False)
    for name, ax in zip(names, axes.ravel(), strict=False):
        for way, color in _DRAWN.items():
            for one in by.get((name, way), [])[:1]:
                errors = 1000 * landmark_errors(*estimates(one))
                fitted = np.isfinite(errors)
                ax.plot(np.where(fitted.all(1), np.where(fitted, errors, 0).mean(1), np.nan), color=color, label=way)
        ax.set(title=name, ylim=(0, 300))
    axes[0, 0].legend()
    axes[-1, 0].set(xlabel="frame", ylabel="mean error (mm)")
    return figure


EXPERIMENT = Experiment("hsiao-4", "nine actions by the whole method", "Hsiao, chapter 4", grid, pose_cell, report, version=3)
