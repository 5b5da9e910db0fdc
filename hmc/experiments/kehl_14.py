"""Figures 14 and 16: fast motion. Source: Kehl (2006), section 7.4: the shoulder's pitch changes by up to 31 degrees between frames, by 4.1
on the mean, and the person is followed through all of the sequence of 375 frames, less exactly. Our dance has as many frames and is faster;
at half the speed it turns as far as the paper's on the mean, and less at most. With nothing of ours ("as printed"), also with a smaller
tolerance, and in the house's company.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import kehl_runs
from hmc.experiments.drill_clips import clip_names, slow_names
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.selection import REPEAT
from hmc.experiments.engine.style import COLORS
from hmc.landmarks import LANDMARKS

__all__ = ["EXPERIMENT"]

#: By how much the shoulder's pitch changes between frames, at most and on the mean, degrees; frames a second.
PAPER_DEG, PAPER_MEAN_DEG, PAPER_FPS = 31.0, 4.1, 1.27
#: Of each run so much of the end must not be lost.
LAST = 0.1
VARIANTS = {"SMD, as printed": COLORS["paper"], kehl_runs.QUARTER: COLORS["particle"], "SMD": COLORS["sparse"]}


def grid(plan: Plan) -> list[dict]:
    """Three runs of every clip, either way, those at half the speed last."""
    return kehl_runs.cell_grid(plan, (*clip_names("dance"), *slow_names("dance")), list(VARIANTS))


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The direction of the right upper arm, true and estimated, and the errors."""
    fast, slow = ([one for one in cells if (_recording(one) in slow_names("dance")) == half] for half in (False, True))
    figure, (above, *below) = plt.subplots(2 + bool(slow), 1, figsize=(7, 5 + 2 * bool(slow)))
    rows = []
    for clips, axes, title in zip((fast, slow), below, ("", "half the speed"), strict=False):
        for variant, color in VARIANTS.items():
            for one in kehl_runs.of_variant(clips, variant):
                errors = kehl_runs.errors_mm(one).mean(axis=1)
                rows.append(_row(one, errors))
                axes.plot(errors, color=color, alpha=0.6)
        axes.set(ylabel="mean joint error, mm", title=title)
    below[-1].set(xlabel="frame")
    for variant, color in VARIANTS.items():
        for one in kehl_runs.of_variant(fast, variant)[:1]:
            true, found = (_elevation_deg(np.array(one.results[name], float)) for name in ("truth_m", "estimate_m"))
            if variant == "SMD, as printed":
                above.plot(true, color=COLORS["person"], linewidth=1, label="true")
            above.plot(found, color=color, label=variant)
    above.set(ylabel="right upper arm\nabove the level, degrees")
    above.legend()
    claims = [
        *_claims(fast, rows, "largest_turn_deg_per_frame", PAPER_DEG, f"at turns of {PAPER_DEG:.0f} degrees between frames"),
        *_claims(slow, rows, "mean_turn_deg_per_frame", PAPER_MEAN_DEG, f"at half the speed, {PAPER_MEAN_DEG} degrees a frame on the mean"),
    ]
    caption = (
        "Fast motion; the turn is that of the right upper arm, the paper's that of the shoulder's pitch alone. The paper: Kehl, Figure 14."
    )
    return Report((Table("kehl-14", caption, rows),), {"kehl-14": figure}, tuple(claims))


def _recording(one: Cell) -> str:
    return str(one.parameters["recording"]).rpartition("@")[0]


def _row(one: Cell, errors: np.ndarray) -> dict:
    """A run's row of the table, of the mean errors of its frames, millimetres."""
    turns = _turns_deg(np.array(one.results["truth_m"], float))
    return {
        "method": one.parameters["variant"], "run": one.parameters[REPEAT], "recording": _recording(one),
        "mean_error_mm": float(errors.mean()), "last_tenth_mm": float(errors[-max(1, round(LAST * len(errors))) :].mean()),
        "worst_frame_mm": float(errors.max()), "largest_turn_deg_per_frame": float(turns.max()),
        "mean_turn_deg_per_frame": float(turns.mean()), "frames_per_s": 1 / float(np.mean(one.results["seconds"])),
        "paper_largest_turn_deg": PAPER_DEG, "paper_mean_turn_deg": PAPER_MEAN_DEG, "paper_frames_per_s": PAPER_FPS,
    }  # fmt: skip


def _claims(cells: Sequence[Cell], rows: Sequence[dict], column: str, least: float, how: str) -> Iterator[Claim]:
    """Whether the dancer of some clips is followed, by each preset, where the clips turn as much as the paper's in one respect."""
    names = {_recording(one) for one in cells}
    turned = max((row[column] for row in rows if row["recording"] in names), default=0.0)
    for variant in VARIANTS:
        own = kehl_runs.of_variant(cells, variant)
        if own and variant != kehl_runs.QUARTER:
            yield decide(
                f"{variant}: the dancer is followed through the sequence and at its end, {how}",
                (kehl_runs.following(own), kehl_runs.following(own, LAST)),
                f"{kehl_runs.error_interval(own)} mm, last tenth {kehl_runs.error_interval(own, last=LAST)}; {turned:.1f} degrees",
                turned >= least,
            )


def _upper_arm(points: np.ndarray) -> np.ndarray:
    arm = points[:, LANDMARKS.index("r_elbow")] - points[:, LANDMARKS.index("r_shoulder")]
    return arm / np.linalg.norm(arm, axis=1, keepdims=True)


def _elevation_deg(points: np.ndarray) -> np.ndarray:
    return np.degrees(np.arcsin(np.clip(_upper_arm(points)[:, 2], -1, 1)))


def _turns_deg(points: np.ndarray) -> np.ndarray:
    """By how much the upper arm turns from frame to frame."""
    arm = _upper_arm(points)
    return np.degrees(np.arccos(np.clip(np.einsum("ni,ni->n", arm[1:], arm[:-1]), -1, 1)))


EXPERIMENT = Experiment(
    "kehl-14", "fast motion", "Kehl, Figures 14 and 16", grid, kehl_runs.cell, report, family=kehl_runs.FAMILY, version=kehl_runs.VERSION
)
