"""How near the whole chain comes, recording by recording: what `hmc pose` and `hmc evaluate` say of each, several seeds each. Ours.

What is constant in a landmark's error may be another definition of the joint or a body of wrong proportions (`hmc.metrics.offsets`): the
means without it stand beside, once with the offsets of the same frames, once with those of the run's other half. Recordings whose truth
is another system's are in the tables, and in no claim.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.chain_runs import FAMILY, FEW, MANY, VERSION, WHOLE, cell, name_of, one_before_many
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.inputs import rendered
from hmc.experiments.engine.style import COLORS
from hmc.experiments.pose_intervals import score_interval
from hmc.experiments.run_means import mean_interval, run_values
from hmc.experiments.truth import estimates
from hmc.landmarks import LANDMARKS
from hmc.metrics.landmarks import landmark_errors, score
from hmc.metrics.offsets import constant_offsets, trunk_frames

__all__ = ["EXPERIMENT", "left_of_other_half"]

RECORDINGS = (
    "box", "jog", "gesture", "throw_catch", "pale", "sit", "pick_up", "crossing", "close_white", "close_table", "close_unseen",
)  # fmt: skip
QUICK_RECORDINGS = ("box", "jog", "close_white")
FRAMES, QUICK_FRAMES = 90, 45
SEEDS, QUICK_SEEDS = 3, 1
FAR_M, NEAR_M = 0.1, 0.05


def grid(plan: Plan) -> list[dict]:
    """Every recording with all cameras, and with few where many see one person; all seeds."""
    sources = plan.recordings or tuple(map(rendered, QUICK_RECORDINGS if plan.quick else RECORDINGS))
    few = [source for source in sources if one_before_many(source)]
    return [
        {
            "recording": source.label,
            "cameras": cameras,
            "without": WHOLE,
            "frames": QUICK_FRAMES if plan.quick else FRAMES,
            "repeat": repeat,
        }
        # Cells that share silhouettes are apart, so that no worker waits for another's.
        for repeat in range(QUICK_SEEDS if plan.quick else SEEDS)
        for cameras, own in ((0, sources), (FEW, few))
        for source in own
    ]


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row a recording and number of cameras: errors with their intervals and seed by seed; the same by landmark; who is claimed of."""
    groups: dict[tuple[str, int], list[Cell]] = {}
    for one in cells:
        groups.setdefault((one.parameters["recording"], one.parameters["cameras"]), []).append(one)
    named = [_where(own[0]) for own in groups.values()]
    rows = [where | _row(own) for where, own in zip(named, groups.values(), strict=True)]
    by_landmark = [where | _landmark_row(own) for where, own in zip(named, groups.values(), strict=True)]
    caption = (
        "Errors of the whole chain from videos alone, as of the command hmc pose: mean with its interval of 95 % over seeds, share of the "
        "landmarks within 100 and 50 mm, mean of each seed, mean without each landmark's constant offset, in the same frames (in-sample) "
        "and with the offsets of the run's other half (held out); CLEAR MOT of the tracks. The last four are means of the seeds."
    )
    tables = (
        Table("whole-chain", caption, rows),
        Table("whole-chain-landmarks", "Mean error of each landmark, millimetres, all seeds and people together.", by_landmark),
    )
    return Report(tables, {"whole-chain": _draw(rows)}, tuple(_claims(cells)))


def left_of_other_half(estimate: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Errors of one person's landmarks without the constant offsets that the other half of the frames has.

    Parameters
    ----------
    estimate, truth : ndarray, shape (n_frames, 15, 3)
        Metres; NaN where missing.

    Returns
    -------
    ndarray, shape (n_frames, 15)
        Metres; NaN where a landmark is not compared, or has no offset in the other half.
    """
    vectors = np.einsum("fji,fkj->fki", trunk_frames(truth), estimate - truth)
    left = np.full(vectors.shape[:2], np.nan)
    middle = len(vectors) // 2
    for own, other in ((slice(middle), slice(middle, None)), (slice(middle, None), slice(middle))):
        offsets = constant_offsets(estimate[other], truth[other]).offsets
        left[own] = np.linalg.norm(vectors[own] - offsets, axis=-1)
    return left


def _where(one: Cell) -> dict[str, Any]:
    return {"recording": name_of(one), "cameras": one.results["cameras"], "people": _people(one)}


def _people(one: Cell) -> int:
    return len(np.unique(one.results["persons"]))


def _row(cells: Sequence[Cell]) -> dict[str, Any]:
    mean = score_interval(cells, "mean_mm")
    known = bool(np.isfinite([mean.low, mean.high]).all())
    row: dict[str, Any] = {
        "mean_mm": mean.value,
        "low_mm": mean.low if known else None,
        "high_mm": mean.high if known else None,
        "within_100_percent": score_interval(cells, "MMTA_percent").value,
        "within_50_percent": score_interval(cells, "MMTA_50_percent").value,
    }
    row |= {f"seed_{one.parameters['repeat']}_mm": _mean_mm(landmark_errors(*estimates(one))) for one in cells}
    ways: tuple[tuple[str, Callable[..., np.ndarray]], ...] = (
        ("without_offsets_mm", lambda *pair: constant_offsets(*pair).remaining),
        ("without_held_out_offsets_mm", left_of_other_half),
    )
    for name, way in ways:
        row[name] = float(np.mean([_mean_mm(np.concatenate([way(*pair) for pair in _persons(one)])) for one in cells]))
    tracks = [one.results["tracks"] for one in cells if one.results["tracks"]]
    lost = [sum(own[name] for name in ("misses", "false_positives", "mismatches")) / own["objects"] for own in tracks]
    row |= {"MOTA": 1 - float(np.mean(lost)) if tracks else None}
    return row | {"exchanged": float(np.mean([own["mismatches"] for own in tracks])) if tracks else None}


def _landmark_row(cells: Sequence[Cell]) -> dict[str, float]:
    errors = np.concatenate([landmark_errors(*estimates(one)) for one in cells])
    means = score(errors, FAR_M, by="joint").mean
    return {f"{name}_mm": float(1000 * mean) for name, mean in zip(LANDMARKS, means, strict=True)}


def _persons(one: Cell) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Estimate and truth of each person of a run."""
    estimate, truth = estimates(one)
    persons = np.array(one.results["persons"])
    for person in np.unique(persons):
        yield estimate[persons == person], truth[persons == person]


def _mean_mm(errors: np.ndarray) -> float:
    return float(1000 * score(errors, FAR_M).mean)


def _within(one: Cell, threshold_m: float) -> float:
    return float(score(landmark_errors(*estimates(one)), threshold_m).mmta)


def _claims(cells: Sequence[Cell]) -> Iterator[Claim]:
    """Of the recordings with a truth of their own; nothing of a group that is not among them."""
    own = [one for one in cells if not one.results["reference"]]
    one_person = [one for one in own if _people(one) == 1]
    many = [one for one in one_person if MANY <= one.results["cameras"] <= 8]
    yield from _comes_near(f"one person, {MANY} or 8 cameras", many, 25, 0.995, 0.95)
    yield from _comes_near(f"one person, {FEW} cameras", [one for one in one_person if one.results["cameras"] == FEW], 30)
    four = [one for one in own if (_people(one), one.results["cameras"]) == (4, FEW)]
    yield from _comes_near(f"four people, {FEW} cameras", four, 60, 0.9)


def _comes_near(who: str, cells: Sequence[Cell], most_mm: float, far: float = 0.0, near: float = 0.0) -> Iterator[Claim]:
    """Claims on the mean over recordings: none where there is no such recording, nor of a share that is not asked for."""
    if not cells:
        return
    mean = mean_interval(run_values(cells, lambda one: _mean_mm(landmark_errors(*estimates(one)))))
    n = len({one.parameters["recording"] for one in cells})
    yield Claim(f"{who}: {most_mm:g} mm at most", bool(mean.value <= most_mm), f"{mean} mm, mean of {n} recording{'s' * (n > 1)}")
    for threshold, least in ((FAR_M, far), (NEAR_M, near)):
        if least:
            share = float(np.mean(list(run_values(cells, partial(_within, threshold_m=threshold)).values())))
            yield Claim(f"{who}: {least:g} or more within {1000 * threshold:g} mm", bool(share >= least), f"{share:.3f}")


def _draw(rows: Sequence[dict[str, Any]]) -> plt.Figure:
    """The means as bars, with a point a seed."""
    figure, axes = plt.subplots(figsize=(6, 0.26 * len(rows) + 0.9))
    places = np.arange(len(rows))
    axes.barh(places, [row["mean_mm"] for row in rows], color=COLORS["particle"], label="as it is")
    axes.barh(places, [row["without_offsets_mm"] for row in rows], 0.35, color=COLORS["naive"], label="without constant offsets")
    for name in dict.fromkeys(name for row in rows for name in row if name.startswith("seed_")):
        axes.plot([row.get(name, np.nan) for row in rows], places, "o", color=COLORS["paper"], markersize=2.5)
    axes.set_yticks(places, [f"{row['recording']}, {row['cameras']} cameras, {_of_people(row['people'])}" for row in rows])
    axes.set(xlabel="mean error (mm); points: seeds", xlim=(0, None))
    axes.invert_yaxis()
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5))
    return figure


def _of_people(n: int) -> str:
    return f"{n} people" if n > 1 else "1 person"


EXPERIMENT = Experiment(
    "whole-chain",
    "how near the whole chain comes, recording by recording",
    "ours; docs/accuracy.md",
    grid,
    cell,
    report,
    FAMILY,
    VERSION,
)
