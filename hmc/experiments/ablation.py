"""What each part of the whole chain is for: everything as it is, and without one part after the other, on the same seeds. Ours.

Every recording counts the same, however many people are in it. A part may be for a single kind of recording: it has to bring something
somewhere, and to harm nowhere on the mean.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.by_action import NEAR_MM
from hmc.experiments.chain_runs import FAMILY, PARTS, VERSION, WHOLE, cell
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.inputs import rendered
from hmc.experiments.engine.intervals import Interval, decide
from hmc.experiments.engine.style import COLORS
from hmc.experiments.pose_intervals import WORTH_MM
from hmc.experiments.run_means import RunValues, gains, mean_interval, run_values
from hmc.experiments.truth import estimates
from hmc.metrics.landmarks import landmark_errors, score

__all__ = ["EXPERIMENT"]

RECORDINGS = ("box", "jog", "pale", "sit", "pick_up", "crossing", "gesture", "close_white")
QUICK_RECORDINGS = ("sit", "pale")
FRAMES, QUICK_FRAMES = 90, 45
SEEDS, QUICK_SEEDS = 3, 1


def grid(plan: Plan) -> list[dict]:
    """Every part left out of every recording, all seeds."""
    sources = plan.recordings or tuple(map(rendered, QUICK_RECORDINGS if plan.quick else RECORDINGS))
    frames, seeds = (QUICK_FRAMES, QUICK_SEEDS) if plan.quick else (FRAMES, SEEDS)
    return [
        {"recording": source.label, "cameras": 0, "without": part, "frames": frames, "repeat": repeat}
        # Cells that share silhouettes and first passes are apart, so that no worker waits for another's.
        for part in PARTS
        for repeat in range(seeds)
        for source in sources
    ]


@dataclass(frozen=True)
class _Cost:
    """What leaving out a part costs.

    Parameters
    ----------
    mean_mm, near_percent : Interval
        Of the mean error, and of the landmarks within 50 mm: how much larger and how many fewer, over clips and seeds.
    by_clip : mapping of str to float
        Millimetres, mean of the seeds.
    helped : tuple of str
        Clips on which it costs more than it scatters from seed to seed.
    """

    mean_mm: Interval
    near_percent: Interval
    by_clip: Mapping[str, float]
    helped: tuple[str, ...]


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """What each part brings, on the mean and clip by clip."""
    parts = [part for part in PARTS if part != WHOLE and any(one.parameters["without"] == part for one in cells)]
    mean = {part: run_values(_without(cells, part), _mean_mm) for part in (WHOLE, *parts)}
    near = {part: run_values(_without(cells, part), _near_percent) for part in (WHOLE, *parts)}
    costs = {part: _cost(mean[part], mean[WHOLE], near[part], near[WHOLE]) for part in parts}
    clips = list(dict.fromkeys(clip for clip, _ in mean[WHOLE]))
    seeds = len({seed for _, seed in mean[WHOLE]})
    rows = [{"part": part} | _row(cost) for part, cost in costs.items()]
    by_clip = [{"without": WHOLE or "nothing (the whole)"} | {f"{_name(clip)}_mm": _of_clip(mean[WHOLE], clip) for clip in clips}]
    by_clip += [{"without": part} | {f"{_name(clip)}_mm": cost.by_clip.get(clip, np.nan) for clip in clips} for part, cost in costs.items()]
    caption = (
        f"What leaving out each part of the chain costs, {len(clips)} recordings that count the same, {seeds} seed{'s' * (seeds > 1)}: "
        "mean error and share within 50 mm, each with its interval of 95 % over clips and seeds; clips on which the part helps by more "
        "than the cost's deviation over the seeds; where it brings the most and the least."
    )
    tables = (
        Table("ablation", caption, rows),
        Table("ablation-clips", "Mean error of the whole, and by how much it is larger without each part.", by_clip),
    )
    return Report(tables, {"ablation": _draw(costs)}, _claims(costs, seeds))


def _without(cells: Sequence[Cell], part: str) -> list[Cell]:
    return [one for one in cells if one.parameters["without"] == part]


def _mean_mm(one: Cell) -> float:
    return float(1000 * score(landmark_errors(*estimates(one)), NEAR_MM / 1000).mean)


def _near_percent(one: Cell) -> float:
    return float(100 * score(landmark_errors(*estimates(one)), NEAR_MM / 1000).mmta)


def _cost(mean: RunValues, whole_mean: RunValues, near: RunValues, whole_near: RunValues) -> _Cost:
    lost = gains(mean, whole_mean)
    by_clip = {clip: _of_clip(lost, clip) for clip in dict.fromkeys(clip for clip, _ in lost)}
    scatter = {clip: float(np.std(own, ddof=1)) for clip in by_clip if len(own := [lost[run] for run in lost if run[0] == clip]) > 1}
    helped = tuple(clip for clip, spread in scatter.items() if by_clip[clip] > spread)
    return _Cost(mean_interval(lost), mean_interval(gains(whole_near, near)), by_clip, helped)


def _of_clip(values: RunValues, clip: str) -> float:
    return float(np.mean([value for run, value in values.items() if run[0] == clip]))


def _row(cost: _Cost) -> dict:
    most, least = (choose(cost.by_clip, key=lambda clip: cost.by_clip[clip]) for choose in (max, min))
    return {
        **_columns("costs", "mm", cost.mean_mm),
        **_columns("loses", "percent", cost.near_percent),
        "helps_on": len(cost.helped),
        "most": f"{_name(most)} {cost.by_clip[most]:+.1f} mm",
        "least": f"{_name(least)} {cost.by_clip[least]:+.1f} mm",
    }


def _columns(name: str, unit: str, found: Interval) -> dict[str, float | None]:
    low, high = (float(end) if np.isfinite(end) else None for end in (found.low, found.high))
    return {f"{name}_{unit}": found.value, f"{name}_low_{unit}": low, f"{name}_high_{unit}": high}


def _name(label: str) -> str:
    return label.rpartition("@")[0]


def _claims(costs: Mapping[str, _Cost], seeds: int) -> tuple[Claim, ...]:
    """That every part is for something, where there are seeds that tell how far figures scatter; and that none harms."""
    idle = [part for part, cost in costs.items() if not cost.helped]
    worse = {part: cost.mean_mm for part, cost in costs.items() if cost.mean_mm.low <= -WORTH_MM}
    useful = Claim(
        "every part helps on a clip by more than the seeds scatter",
        not idle,
        f"not shown of: {', '.join(idle)}" if idle else ", ".join(f"{part}: on {len(cost.helped)}" for part, cost in costs.items()),
    )
    harmless = decide(
        "no part is better left out by a millimetre or more on the mean",
        [cost.mean_mm.over(-WORTH_MM) for cost in costs.values()],
        "; ".join(f"{part} costs {found} mm" for part, found in (worse or {part: cost.mean_mm for part, cost in costs.items()}).items()),
    )
    return (useful, harmless) if seeds > 1 else (harmless,)


def _draw(costs: Mapping[str, _Cost]) -> plt.Figure:
    """What each part costs to leave out, with its interval and a point a clip."""
    figure, axes = plt.subplots(figsize=(6, 0.3 * len(costs) + 0.9))
    places = np.arange(len(costs))
    axes.barh(places, [cost.mean_mm.value for cost in costs.values()], color=COLORS["particle"])
    for place, cost in enumerate(costs.values()):
        if np.isfinite([cost.mean_mm.low, cost.mean_mm.high]).all():
            axes.plot([cost.mean_mm.low, cost.mean_mm.high], [place, place], color=COLORS["paper"])
        axes.plot(list(cost.by_clip.values()), np.full(len(cost.by_clip), place), "o", color=COLORS["sparse"], markersize=2.5)
    axes.axvline(0, color=COLORS["paper"], linewidth=0.8)
    axes.set_yticks(places, list(costs))
    axes.set(xlabel="added mean error without it (mm); points: recordings")
    axes.invert_yaxis()
    return figure


EXPERIMENT = Experiment(
    "ablation",
    "what each part of the whole chain is for",
    "ours; docs/accuracy.md",
    grid,
    cell,
    report,
    FAMILY,
    VERSION,
)
