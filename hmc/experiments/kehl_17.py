"""Figures 7 and 17: holding an object. Source: Kehl (2006), sections 6.1.3 and 7.5: a green cube prolongs the arm, and the colors of the
arm's patches keep the cube's voxels out of it; 200 frames are followed. There it changes hands, is thrown, kicked and picked up; here it
stays in the right hand. With nothing of ours ("as printed") and in the house's company.
"""

from __future__ import annotations

from collections.abc import Sequence

from hmc.experiments import kehl_runs
from hmc.experiments.drill_clips import clip_names
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.kehl_cues import compared_cues
from hmc.landmarks import LANDMARKS

__all__ = ["EXPERIMENT"]

CUES = {
    "SMD, as printed": "with colors, as printed", "surface, edges, as printed": "without colors, as printed", "SMD": "with colors",
    "surface, edges": "without colors",
}  # fmt: skip
#: Frames a second, at 128^3 voxels.
PAPER_FPS = 0.8
ARM = [LANDMARKS.index(name) for name in ("r_elbow", "r_wrist")]
SHOWN_S = (1.3, 2.0, 4.3)


def grid(plan: Plan) -> list[dict]:
    """With colors and without, three times each on every clip."""
    return kehl_runs.cell_grid(plan, clip_names("play_cube"), list(CUES), SHOWN_S)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Errors of the arm that holds the cube, and some frames."""
    groups, rows, figure = compared_cues(cells, CUES, ARM, "holding_arm")
    rows = [row | {"paper_frames_per_s": PAPER_FPS} for row in rows]
    claims = tuple(_colors_help(groups, ending) for ending in (", as printed", ""))
    caption = (
        f"A cube in the right hand; holding arm: right elbow and wrist; voxels of {100 * kehl_runs.VOXEL_M:g} cm. The paper shows pictures "
        "only, and has its frames a second at 128^3 voxels: Kehl, Figure 17."
    )
    return Report((Table("kehl-17", caption, rows),), {"kehl-17": figure}, claims)


def _colors_help(groups: dict[str, list[Cell]], ending: str) -> Claim:
    """The paper's: the person with the cube is followed, and colors keep the cube out of the arm."""
    colors, without = groups[f"SMD{ending}"], groups[f"surface, edges{ending}"]
    text = f"with colors{ending} the sequence is followed, and the arm that holds the cube is nearer than without"
    return kehl_runs.nearer(text, colors, without, ARM)


EXPERIMENT = Experiment(
    "kehl-17", "holding an object", "Kehl, Figures 7 and 17", grid, kehl_runs.cell, report, family=kehl_runs.FAMILY,
    version=kehl_runs.VERSION,
)  # fmt: skip
