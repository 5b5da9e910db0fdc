"""Figure 6.13: the marker-based filter by detector and by layers and particles.

Source: Canton (2009), section 6.6.1, with the thesis's body and annealing (`canton2009`), from the first frame's true pose. The thesis
counts 360 detectors and 7,200 runs; its lists make 180 detectors and 3,600 runs. Here they are run with two likelihoods, which makes 7,200:
the printed one, which asks only whether the nearest detections agree with one another, and with the reprojection score beside it, which
asks whether they are where the body has its markers. The thesis shows a detection rate of .9; every rate that was computed is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from hmc.experiments import marker_runs as runs
from hmc.experiments.by_action import pose_scores
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.filter_grids import mmta_bar
from hmc.experiments.markerless_runs import action_sources

__all__ = ["EXPERIMENT"]

#: Detection rates, false positives, variances (square pixels), layers, particles a layer.
FULL = ((1.0, 0.9, 0.8, 0.7, 0.6), (0, 20, 40, 60, 80, 100), (0, 20, 40, 60, 80, 100), (1, 3, 5, 7), (100, 300, 500, 700, 900))
QUICK = ((0.9,), (0, 40, 100), (0, 40, 100), (1, 3, 7), (100, 700))
#: What is varied, and what is told of it.
VARIED = ("detection_rate", "false_positives", "variance_px2", "layers", "particles")
SHOWN = ("mean_mm", "MMTP_mm", "MMTA_percent")
#: Likelihoods, by the share of the reprojection score.
LIKELIHOODS = {"printed": 0.0, "with reprojection": 0.5}
Key = tuple[float, float, float, float, float]


def grid(plan: Plan) -> list[dict]:
    """Every detector with every number of layers and particles, on a walk."""
    sources = action_sources(plan, ("walk",))[:1]
    return [
        {"recording": source.label, "frames": runs.QUICK_FRAMES if plan.quick else 0, "start": "true", "detection_rate": rate,
         "false_positives": float(false), "variance_px2": float(variance), "preset": "canton2009", "reprojection": reprojection,
         "layers": layers, "particles": particles, "repeat": 0}
        for source in sources
        for reprojection in LIKELIHOODS.values()
        for rate, false, variance, layers, particles in product(*(QUICK if plan.quick else FULL))
    ]  # fmt: skip


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA in color: blocks by false positives and variance, in each layers by particles."""
    rows: list[dict[str, Any]] = []
    figures: dict[str, Figure] = {}
    claims: list[Claim] = []
    for likelihood, reprojection in LIKELIHOODS.items():
        groups: dict[Key, list[Cell]] = {}
        for one in cells:
            if one.parameters["reprojection"] == reprojection:
                groups.setdefault(_key(one), []).append(one)
        scores = {key: pose_scores(own) for key, own in groups.items()}
        rows += [
            {"likelihood": likelihood} | dict(zip(VARIED, key, strict=True)) | {name: score[name] for name in SHOWN}
            for key, score in scores.items()
        ]
        mmta = {key: score["MMTA_percent"] for key, score in scores.items()}
        for rate in _values(mmta, 0):
            figures[f"fig-6.13-rate-{rate:g}-{likelihood.replace(' ', '-')}"] = _draw(mmta, rate, likelihood)
        claims += _claims(mmta, likelihood)
    caption = (
        "Marker-based filter with the thesis's parameters: MMTA at 100 mm by detector, layers and particles a layer. "
        "The paper: Canton, Figure 6.13, in color without numbers."
    )
    return Report((Table("fig-6.13", caption, rows),), figures, tuple(claims))


def _key(one: Cell) -> Key:
    rate, false, variance, layers, particles = (float(one.parameters[name]) for name in VARIED)
    return rate, false, variance, layers, particles


def _values(mmta: dict[Key, float], place: int) -> list[float]:
    return sorted({key[place] for key in mmta})


def _claims(mmta: dict[Key, float], likelihood: str) -> tuple[Claim, ...]:
    def mean(place: int, value: float) -> float:
        return float(np.mean([score for key, score in mmta.items() if key[place] == value]))

    def ends(place: int) -> tuple[float, float]:
        values = _values(mmta, place)
        return mean(place, values[0]), mean(place, values[-1])

    by_false, by_noise = ends(1), ends(2)
    by_layers = {layers: mean(3, layers) for layers in _values(mmta, 3)}
    best = max(by_layers, key=by_layers.__getitem__)
    return (
        Claim(
            f"{likelihood}: false positives cost less than noise",
            by_false[0] - by_false[1] < by_noise[0] - by_noise[1],
            f"from none to most: false positives {by_false[0]:.1f} to {by_false[1]:.1f} %, noise {by_noise[0]:.1f} to {by_noise[1]:.1f} %",
        ),
        Claim(
            f"{likelihood}: the best number of layers is neither the least nor the most",
            best not in (min(by_layers), max(by_layers)),
            ", ".join(f"{layers:g}: {score:.1f} %" for layers, score in by_layers.items()),
        ),
    )


def _draw(mmta: dict[Key, float], rate: float, likelihood: str) -> Figure:
    false, noise, layers, particles = (_values(mmta, place) for place in (1, 2, 3, 4))
    figure, panels = plt.subplots(
        len(noise), len(false), figsize=(1.3 * len(false) + 1.6, 1.2 * len(noise) + 1), sharex=True, sharey=True, squeeze=False
    )
    for i, variance in enumerate(noise):
        for j, number in enumerate(false):
            axes = panels[i, j]
            values = [[mmta[rate, number, variance, n, size] for size in particles] for n in layers]
            axes.imshow(values, origin="lower", vmin=0, vmax=100, aspect="auto", cmap="viridis")
            axes.grid(False)
            axes.set_xticks(range(len(particles)), [f"{size:g}" for size in particles], rotation=90, fontsize=7)
            axes.set_yticks(range(len(layers)), [f"{n:g}" for n in layers], fontsize=7)
            if i == 0:
                axes.set_title(f"FP {number:g}")
            if j == 0:
                axes.set_ylabel(f"variance {variance:g}\nlayers")
    figure.supxlabel("particles a layer")
    mmta_bar(figure, panels)
    figure.suptitle(f"detection rate {rate:g}, likelihood {likelihood}")
    return figure


EXPERIMENT = Experiment(
    "fig-6.13",
    "marker-based pose by detector, layers and particles",
    "Canton, Figure 6.13",
    grid,
    runs.cell,
    report,
    runs.FAMILY,
    runs.VERSION,
)
