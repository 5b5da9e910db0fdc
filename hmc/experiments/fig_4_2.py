"""Figures 4.2 and 4.3: what tells people from other components, and whether it depends on the voxels' size.

Source: Canton (2009), section 4.2.3. Tops of people peak near 1.2 m (sitting) and 1.7 m (standing); histograms at voxels of 2, 5, 10 and
15 cm have Bhattacharyya coefficients over .95.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.style import COLORS
from hmc.experiments.person_features import features_of, test_sources
from hmc.tracking.appearance import bhattacharyya
from hmc.tracking.features import FEATURES

__all__ = ["EXPERIMENT"]

#: Ranges of the histograms, in the features' own units. People weigh more than people do: a hull is wider than who is in it.
RANGES = ((0.0, 600.0), (0.0, 1.6), (0.0, 2.4), (0.0, 2.4), (0.0, 2.4), (0.0, 2.4))
#: Heights and sides are whole numbers of voxels: bins that are narrower than the coarsest voxels would stay empty at random.
BINS = 12
CLASSES = {"person": True, "other": False}
SITTING_M, STANDING_M = 1.2, 1.7
#: Of tops, a finer histogram; a peak is a peak if nothing within so many metres is higher, and it is so high a part of the highest.
PEAK_BINS, APART_M, LEAST_PEAK = 48, 0.2, 0.05


def grid(plan: Plan) -> list[dict]:
    """Every recording at every voxel size; the finest in full runs."""
    sizes = (0.15, 0.10, 0.05) if plan.quick else (0.15, 0.10, 0.05, 0.02)
    return [{"recording": source.label, "voxel_m": size} for source in test_sources(plan) for size in sizes]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """The features and classes of all components."""
    table = features_of(inputs, parameters["recording"], parameters["voxel_m"])
    return {"features": table.features.round(4), "is_person": table.is_person.astype(int)}


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Histograms, scatter plots and the coefficients between voxel sizes."""
    sizes = sorted({one.parameters["voxel_m"] for one in cells})
    data = {}
    for size in sizes:
        own = [one.results for one in cells if one.parameters["voxel_m"] == size]
        features = np.concatenate([np.reshape(one["features"], (-1, len(FEATURES))) for one in own])
        data[size] = features, np.concatenate([np.array(one["is_person"], bool) for one in own])
    rows: list[dict] = []
    for k, name in enumerate(FEATURES):
        for label, wanted in CLASSES.items():
            shares = {size: _shares(features[is_person == wanted], k) for size, (features, is_person) in data.items()}
            row = {"feature": name, "class": label, "components": int((data[sizes[0]][1] == wanted).sum())}
            rows.append(
                row | {f"B_{100 * s:g}cm_{100 * sizes[0]:g}cm": float(bhattacharyya(shares[s], shares[sizes[0]])) for s in sizes[1:]}
            )
    people = [row for row in rows if row["class"] == "person"]
    least = min(value for row in people for key, value in row.items() if key.startswith("B_"))
    finest, whose = data[sizes[0]]
    separable = {
        name: float(bhattacharyya(*(_shares(finest[whose == wanted], FEATURES.index(name)) for wanted in (True, False))))
        for name in ("weight_kg", "height_m", "longer_side_m")
    }
    features, is_person = data[sizes[0]]
    tops = features[is_person, FEATURES.index("top_m")]
    modes = peaks_of(tops)
    claims = (
        Claim("histograms of people at all voxel sizes overlap by more than .95", least > 0.95, f"the least coefficient is {least:.3f}"),
        Claim(
            "weight, height and bounding box separate people from others more than voxel sizes differ",
            max(separable.values()) < least,
            "coefficients of people and others " + ", ".join(f"{name} {value:.3f}" for name, value in separable.items()),
        ),
        Claim(
            "tops of people peak near 1.2 m and 1.7 m",
            len(modes) == 2 and bool(np.all(np.abs(np.sort(modes) - (SITTING_M, STANDING_M)) < 0.15)),
            f"at {' and '.join(f'{mode:.2f}' for mode in sorted(modes))} m",
        ),
    )
    names = ", ".join(source.name for source in test_sources(plan))
    caption = f"Bhattacharyya coefficients of the features' histograms between voxel sizes, on {names}. The paper: over .95 always."
    figures = {"fig-4.2": _histograms(data), "fig-4.3": _scatter(features, is_person)}
    return Report((Table("fig-4.2", caption, rows),), figures, claims)


def peaks_of(tops: np.ndarray) -> list[float]:
    """Where a histogram of tops has its highest peaks, at most two, metres: what is higher than all within `APART_M` of it."""
    counts, edges = np.histogram(tops, PEAK_BINS, RANGES[FEATURES.index("top_m")])
    counts, middles = np.convolve(counts, [0.25, 0.5, 0.25], "same"), (edges[1:] + edges[:-1]) / 2
    near = np.abs(middles[:, None] - middles) <= APART_M
    found = np.flatnonzero((counts == np.where(near, counts, 0).max(axis=1)) & (counts > LEAST_PEAK * counts.max()))
    return [float(middles[place]) for place in sorted(found, key=lambda place: -counts[place])[:2]]


def _shares(features: np.ndarray, k: int) -> np.ndarray:
    counts = np.histogram(np.clip(features[:, k], *RANGES[k]), BINS, RANGES[k])[0]
    return counts / max(counts.sum(), 1)


def _histograms(data: dict[float, tuple[np.ndarray, np.ndarray]]) -> Figure:
    figure, axes = plt.subplots(2, 3, figsize=(8, 4.6))
    for k, (name, ax) in enumerate(zip(FEATURES, axes.ravel(), strict=True)):
        edges = np.linspace(*RANGES[k], BINS + 1)
        for label, wanted in CLASSES.items():
            for size, (features, is_person) in data.items():
                style = {"label": label, "alpha": 1.0} if size == min(data) else {"alpha": 0.35}
                ax.stairs(_shares(features[is_person == wanted], k), edges, color=COLORS[label], **style)
        ax.set(xlabel=name, xlim=RANGES[k])
    for ax in axes[:, 0]:
        ax.set_ylabel("share of the components")
    axes[0, 0].legend(title="faint: coarser voxels")
    return figure


def _scatter(features: np.ndarray, is_person: np.ndarray) -> Figure:
    n = len(FEATURES)
    figure, axes = plt.subplots(n - 1, n - 1, figsize=(9, 9), sharex="col", sharey="row")
    for row in range(1, n):
        for column in range(n - 1):
            ax = axes[row - 1, column]
            if column >= row:
                ax.axis("off")
                continue
            for label, wanted in CLASSES.items():
                some = features[is_person == wanted]
                ax.plot(some[:, column], some[:, row], ".", color=COLORS[label], markersize=1.5, alpha=0.5)
            ax.set(xlim=RANGES[column], ylim=RANGES[row])
            if row == n - 1:
                ax.set_xlabel(FEATURES[column])
            if column == 0:
                ax.set_ylabel(FEATURES[row])
    figure.legend(axes[0, 0].lines[:2], CLASSES, loc="upper right", markerscale=4)
    return figure


EXPERIMENT = Experiment(
    "fig-4.2", "features of people and of other components, with figure 4.3", "Canton, Figures 4.2 and 4.3", grid, cell, report
)
