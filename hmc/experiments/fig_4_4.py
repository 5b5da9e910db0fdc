"""Figure 4.4: the decision tree that tells people from other components, as it comes with the package.

Source: Canton (2009), section 4.2.3. The thesis's tree is built of weight, height and bounding box; its thresholds are only drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.store import digest
from hmc.experiments.engine.style import COLORS
from hmc.tracking.features import FEATURES
from hmc.tracking.person_tree import LEAF, default_tree

__all__ = ["EXPERIMENT"]

#: "Separable variables such as height, weight and bounding box size are automatically selected" (section 4.2.3).
SEPARABLE = ({"weight_kg"}, {"height_m"}, {"longer_side_m", "shorter_side_m"})


def grid(plan: Plan) -> list[dict]:
    """One cell, of the tree as it is now."""
    return [{"tree": digest(asdict(default_tree()))}]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """The tree's nodes."""
    return asdict(default_tree())


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The tree drawn from the root at the top; the left branch is the one at or below the threshold."""
    tree = cells[0].results
    n = len(tree["feature"])
    rows = [
        {
            "node": k, "feature": "" if tree["feature"][k] == LEAF else FEATURES[tree["feature"][k]],
            "threshold": None if tree["feature"][k] == LEAF else tree["threshold"][k],
            "at_most": None if tree["feature"][k] == LEAF else tree["at_most"][k],
            "above": None if tree["feature"][k] == LEAF else tree["above"][k], "person_share": tree["share"][k],
        }
        for k in range(n)
    ]  # fmt: skip
    places = _places(tree)
    leaves = sum(feature == LEAF for feature in tree["feature"])
    deepest = max(-y for _, y in places.values())
    figure, axes = plt.subplots(figsize=(max(6, 0.85 * leaves), 1 + 0.85 * deepest))
    for k, (x, y) in places.items():
        for child in (tree["at_most"][k], tree["above"][k]) if tree["feature"][k] != LEAF else ():
            axes.plot([x, places[child][0]], [y, places[child][1]], color="0.6", linewidth=1, zorder=1)
        if tree["feature"][k] == LEAF:
            person = tree["share"][k] >= 0.5
            text, color = f"{'person' if person else 'other'}\n{tree['share'][k]:.2f}", COLORS["person" if person else "other"]
        else:
            text, color = f"{FEATURES[tree['feature'][k]]}\n≤ {tree['threshold'][k]:.3g}", "0.3"
        box = {"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": color}
        axes.text(x, y, text, ha="center", va="center", fontsize=6.5, bbox=box, zorder=2)
    axes.set(xlim=(-0.6, leaves - 0.4), ylim=(-deepest - 0.5, 0.5))
    axes.axis("off")
    axes.set_title("left: at most the threshold; leaves: share of people", fontsize=8)
    asked = list(dict.fromkeys(row["feature"] for row in rows if row["feature"]))
    detail = f"asked for, from the root: {', '.join(asked)}; {n} nodes"
    claims = (
        Claim("the tree asks for weight, height and bounding box", all(set(asked) & group for group in SEPARABLE), detail),
        Claim("it asks for nothing else", bool(asked) and set(asked) <= set().union(*SEPARABLE), detail),
    )
    return Report((Table("fig-4.4", "The person tree's nodes (Canton, Figure 4.4).", rows),), {"fig-4.4": figure}, claims)


def _places(tree: Results) -> dict[int, tuple[float, float]]:
    """x by the order of the leaves, y by the depth, of every node."""
    places: dict[int, tuple[float, float]] = {}

    def put(node: int, depth: int, free: int) -> int:
        if tree["feature"][node] == LEAF:
            places[node] = (float(free), -float(depth))
            return free + 1
        free = put(tree["above"][node], depth + 1, put(tree["at_most"][node], depth + 1, free))
        places[node] = (float(np.mean([places[tree[side][node]][0] for side in ("at_most", "above")])), -float(depth))
        return free

    put(0, 0, 0)
    return places


EXPERIMENT = Experiment("fig-4.4", "the decision tree, drawn", "Canton, Figure 4.4", grid, cell, report)
