"""Figure 6.13: the marker-based filter by detector and by layers and particles.

Source: Canton (2009), section 6.6.1, with the thesis's body and annealing (`canton2009`), from the first frame's true pose. The thesis
counts 360 detectors and 7,200 runs; its lists make 180 detectors and 3,600 runs, and its figure shows a detection rate of .9. Here that
rate is run whole, a fifth of the lists, each of its 720 filters on every action, the actors and seeds in turn; `--set detection_rate=0.8`
gives another.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from hmc.experiments import marker_runs as runs
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report
from hmc.experiments.engine.intervals import Interval, decide
from hmc.experiments.engine.selection import REPEAT
from hmc.experiments.filter_study import QUICK_ACTIONS
from hmc.experiments.five_actions import ACTIONS
from hmc.experiments.markerless_runs import action_sources
from hmc.experiments.pose_intervals import ahead, following, score_difference
from hmc.experiments.study import runs_of, score_table, table_of
from hmc.experiments.table_6_3 import SEEDS

__all__ = ["EXPERIMENT"]

#: False positives, variances (square pixels), layers, particles a layer, in full and quick; the detection rate that the thesis shows.
GRID = {
    False: ((0, 20, 40, 60, 80, 100), (0, 20, 40, 60, 80, 100), (1, 3, 5, 7), (100, 300, 500, 700, 900)),
    True: ((0, 100), (0, 100), (1, 3, 7), (100, 700)),
}
RATE = 0.9
VARIED = ("false_positives", "variance_px2", "layers", "particles")
#: Frames of each recording; the quick ones are shorter.
FRAMES = 180
#: The thesis's best.
BEST_LAYERS = 3


def grid(plan: Plan) -> list[dict]:
    """Every detector with every number of layers and particles, on every action, the actors and seeds in turn."""
    sources = action_sources(plan, QUICK_ACTIONS if plan.quick else ACTIONS, in_turn=True)
    return [
        {"recording": source.label, "frames": FRAMES, "start": "true", "detection_rate": RATE, "preset": "canton2009", "reprojection": 0.0,
         REPEAT: place % SEEDS} | dict(zip(VARIED, map(float, values[:2]), strict=False)) | dict(zip(VARIED[2:], values[2:], strict=True))
        for place, source in enumerate(sources)
        for values in product(*GRID[plan.quick])
    ]  # fmt: skip


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA in color: blocks by false positives and variance, in each layers by particles."""
    frame = runs_of(cells)
    table = score_table(frame, ("detection_rate", *VARIED))

    def those(**wanted: float) -> list[Cell]:
        return list(frame[np.logical_and.reduce([frame[name] == value for name, value in wanted.items()])].run)

    def most(name: str) -> float:
        return float(frame[name].max())

    false, noise = (
        score_difference(those(**{name: 0.0}), those(**{name: most(name)}), "MMTA_percent", (name,))
        for name in ("false_positives", "variance_px2")
    )
    clean = those(false_positives=0.0, variance_px2=0.0)
    claims = [
        decide(
            "robust against false positives: the most of them cost less than the most noise does",
            (following(clean), noise, Interval(noise.value - false.value, noise.low - false.high, noise.high - false.low)),
            f"MMTA, from none to most: false positives cost {false} %, noise {noise} %",
        )
    ]
    for layers in (min(frame.layers), max(frame.layers)):
        text = f"{BEST_LAYERS} layers are better than {layers}"
        claims.append(ahead(text, those(layers=BEST_LAYERS), those(layers=layers), but=("layers",)))
    caption = (
        "Marker-based filter with the thesis's parameters: MMTA at 100 mm by detector, layers and particles a layer. "
        "The paper: Canton, Figure 6.13, in color without numbers."
    )
    figures = {f"fig-6.13-rate-{rate:g}": _draw(own, float(rate)) for rate, own in table.groupby("detection_rate")}
    return Report((table_of("fig-6.13", caption, table),), figures, tuple(claims))


def _draw(table: pd.DataFrame, rate: float) -> Figure:
    false, noise = sorted(set(table.false_positives)), sorted(set(table.variance_px2))
    figure, panels = plt.subplots(
        len(noise), len(false), figsize=(1.3 * len(false) + 1.6, 1.2 * len(noise) + 1), sharex=True, sharey=True, squeeze=False
    )
    for i, variance in enumerate(noise):
        for j, number in enumerate(false):
            axes, own = panels[i, j], table[(table.variance_px2 == variance) & (table.false_positives == number)]
            values = own.pivot_table(index="layers", columns="particles", values="MMTA_percent")
            axes.imshow(values, origin="lower", vmin=0, vmax=100, aspect="auto", cmap="viridis")
            axes.grid(False)
            axes.set_xticks(range(values.shape[1]), [f"{size:g}" for size in values.columns], rotation=90, fontsize=7)
            axes.set_yticks(range(values.shape[0]), [f"{n:g}" for n in values.index], fontsize=7)
            if i == 0:
                axes.set_title(f"FP {number:g}")
            if j == 0:
                axes.set_ylabel(f"variance {variance:g}\nlayers")
    figure.supxlabel("particles a layer")
    figure.colorbar(ScalarMappable(Normalize(0, 100), "viridis"), ax=panels, label="MMTA (%)")
    figure.suptitle(f"detection rate {rate:g}")
    return figure


EXPERIMENT = Experiment(
    "fig-6.13", "marker-based pose by detector, layers and particles", "Canton, Figure 6.13", grid, runs.cell, report, runs.FAMILY,
    runs.VERSION,
)  # fmt: skip
