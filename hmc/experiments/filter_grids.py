"""Grids and tables that the studies of the markerless filter's parameters share (Canton 2009, figures 6.16 to 6.18)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from hmc.experiments.by_action import pose_scores
from hmc.experiments.engine.experiment import Cell, Plan
from hmc.experiments.filter_runs import ANNEALING
from hmc.experiments.markerless_runs import action_sources

__all__ = ["LAYERS", "PARTICLES", "REPEATS", "STUDIED", "filter_grid", "grouped_rows", "layer_map", "matrix", "mmta_bar"]

#: Layers and particles a layer, in full and quick; the thesis's figures show their best at 6 and 600.
LAYERS = {False: (1, 2, 4, 6, 8), True: (2, 6)}
PARTICLES = {False: (100, 200, 400, 600, 800), True: (100, 600)}
#: Actions in full and quick: the thesis takes a sample of every action.
STUDIED = {False: ("walk", "jog", "throw_catch", "gesture", "box"), True: ("walk",)}
#: Frames of the quick mode, and repeats in full.
QUICK_FRAMES, REPEATS = 13, 3


def filter_grid(
    plan: Plan,
    settings: Sequence[dict[str, Any]],
    actions: Mapping[bool, Sequence[str]] = STUDIED,
    annealings: Sequence[str] = tuple(ANNEALING),
    quick_repeats: int = 1,
) -> list[dict[str, Any]]:
    """Every setting with every way of annealing on every studied action, by the actors in turn.

    Parameters
    ----------
    plan : Plan
    settings : sequence of mapping
        What differs from 7 cameras, 20 mm, the factorised likelihood, density 1, 6 layers of 600 particles.
    actions : mapping of bool to sequence of str
        By `plan.quick`.
    annealings : sequence of str
        Keys of `ANNEALING`.
    quick_repeats : int
        Repeats in the quick mode; in full there are `REPEATS`.
    """
    sources = action_sources(plan, actions[plan.quick])
    if not plan.recordings:
        sources = [source for k, source in enumerate(sources) if k % 2 == k // 2 % 2]  # one actor an action, in turn
    base = {"cameras": 0, "frames": QUICK_FRAMES if plan.quick else 0, "voxel_mm": 20, "likelihood": "factorised", "layers": 6,
            "particles": 600, "density": 1.0}  # fmt: skip
    return [
        {"recording": source.label} | base | setting | {"annealing": annealing, "repeat": repeat}
        for source in sources
        for setting in settings
        for annealing in annealings
        for repeat in range(quick_repeats if plan.quick else REPEATS)
    ]


def grouped_rows(cells: Sequence[Cell], names: Sequence[str]) -> list[dict[str, Any]]:
    """One row for every combination of some parameters: scores over all recordings and repeats, their spread, and frames a second."""
    groups: dict[tuple, list[Cell]] = {}
    for one in cells:
        groups.setdefault(tuple(one.parameters[name] for name in names), []).append(one)
    rows = []
    for key, own in groups.items():
        scores = pose_scores(own)
        each = [pose_scores([one])["MMTA_percent"] for one in own]
        row = dict(zip(names, key, strict=True)) | {name: scores[name] for name in ("mean_mm", "MMTP_mm", "MMTA_percent")}
        row["MMTA_deviation_percent"] = float(np.std(each))
        row["filter_frames_per_s"] = 1 / max(float(np.mean([one.results["filter_s_per_frame"] for one in own])), 1e-9)
        rows.append(row)
    return rows


def matrix(rows: Sequence[dict[str, Any]], layers: Sequence[int], particles: Sequence[int]) -> np.ndarray:
    """MMTA of rows by layers and particles, (n_layers, n_particles); NaN where there is no row."""
    found = {(row["layers"], row["particles"]): row["MMTA_percent"] for row in rows}
    return np.array([[found.get((n, size), np.nan) for size in particles] for n in layers])


def layer_map(axes: Axes, values: np.ndarray, layers: Sequence[int], particles: Sequence[int]) -> None:
    """MMTA in color and in numbers, layers by particles."""
    axes.imshow(values, origin="lower", vmin=0, vmax=100, aspect="auto", cmap="viridis")
    axes.grid(False)
    axes.set_xticks(range(len(particles)), [str(size) for size in particles])
    axes.set_yticks(range(len(layers)), [str(n) for n in layers])
    for (i, j), value in np.ndenumerate(values):
        axes.text(j, i, f"{value:.0f}", ha="center", va="center", color="white" if value < 60 else "black", fontsize=8)


def mmta_bar(figure: Figure, panels: np.ndarray) -> None:
    """A color bar for maps of MMTA, percent."""
    figure.colorbar(ScalarMappable(Normalize(0, 100), "viridis"), ax=panels, label="MMTA (%)")
