"""Figure 11: single cues against several, with the arms close to the body.

Source: Kehl (2006), section 7.2: with the surface alone an arm gets stuck to the body; with edges the whole sequence is followed. Here
colors and all cues besides; shirt and skin are alike, as there. With nothing of ours ("as printed") and in the house's company.
"""

from __future__ import annotations

from collections.abc import Sequence

from hmc.experiments import kehl_runs
from hmc.experiments.drill_clips import clip_names
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.kehl_cues import compared_cues
from hmc.landmarks import LANDMARKS

__all__ = ["EXPERIMENT"]

_SOME = ("surface, as printed", "surface, edges, as printed", "surface", "surface, edges", "surface, color")
CUES = {name: name for name in _SOME} | {"SMD": "all cues"}
ARMS = [LANDMARKS.index(name) for name in ("l_elbow", "l_wrist", "r_elbow", "r_wrist")]
SHOWN_S = (1.9, 3.2, 6.2)


def grid(plan: Plan) -> list[dict]:
    """The combinations of cues, three times each on every clip."""
    return kehl_runs.cell_grid(plan, clip_names("pedal_arms"), list(CUES), SHOWN_S)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Errors of the arms, and some frames."""
    groups, rows, figure = compared_cues(cells, CUES, ARMS, "arms")
    claims = tuple(_edges_help(groups, ending) for ending in (", as printed", ""))
    caption = "Cues with the arms close to the body; arms: elbows and wrists. The paper shows pictures only: Kehl, Figure 11."
    return Report((Table("kehl-11", caption, rows),), {"kehl-11": figure}, claims)


def _edges_help(groups: dict[str, list[Cell]], ending: str) -> Claim:
    """The paper's: the surface alone loses an arm at the body, with edges the whole sequence is followed and nearer."""
    alone, edges = groups[f"surface{ending}"], groups[f"surface, edges{ending}"]
    text = f"with edges{ending} the sequence is followed, and elbows and wrists are nearer than with the surface alone"
    return kehl_runs.nearer(text, edges, alone, ARMS)


EXPERIMENT = Experiment(
    "kehl-11", "single against several cues", "Kehl, Figure 11", grid, kehl_runs.cell, report, family=kehl_runs.FAMILY,
    version=kehl_runs.VERSION,
)  # fmt: skip
