"""Figure 4.9: samples that start in one place spread over a person, by the surface's likelihood and by the interior's.

Source: Canton (2009), section 4.3.3, Eq. 4.15, 4.17 and 4.20, and "Sample propagation and 3D discrete resampling". Shown there as
pictures of the samples at a few steps: on the surface they spread faster.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from scipy.ndimage import uniform_filter

from hmc.experiments.ellipsoid import VOXEL_M, person_voxels
from hmc.experiments.engine.experiment import Cell, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.intervals import decide, interval
from hmc.experiments.engine.style import COLORS
from hmc.search import systematic

__all__ = ["EXPERIMENT"]

LIKELIHOODS = ("surface", "interior")
#: Steps at which the samples are drawn.
SHOWN = (0, 50, 150, 400)
STEPS = 600
SAMPLES = 400
#: Neighbourhood of Eq. 4.20: the cube of radius r = 2, as q = 26 connects it.
RADIUS = 2


def grid(plan: Plan) -> list[dict]:
    """Both likelihoods, several times."""
    repeats = 8 if plan.quick else 20
    return [{"likelihood": name, "samples": SAMPLES, "steps": STEPS, "repeat": k} for name in LIKELIHOODS for k in range(repeats)]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Samples start side by side on one side of the ellipsoid; their spread and the error of their mean, step by step."""
    occupied, shell, _ = person_voxels()
    surface = parameters["likelihood"] == "surface"
    filled = np.clip(uniform_filter(occupied.astype(float), 2 * RADIUS + 1), 0, 1)
    likelihood = 1 - np.abs(2 * filled - 1) if surface else occupied.astype(float)
    whole = shell if surface else np.argwhere(occupied)
    centre = (np.array(occupied.shape) - 1) / 2
    start = shell[np.argmax(shell[:, 0])]
    samples = shell[np.argsort(((shell - start) ** 2).sum(axis=1), kind="stable")[: parameters["samples"]]]
    full_spread = _spread(whole)
    shown, spreads, errors, counts = {}, [], [], []
    for step in range(parameters["steps"] + 1):
        spreads.append(_spread(samples) / full_spread)
        errors.append(1000 * VOXEL_M * np.linalg.norm(np.average(samples, axis=0, weights=likelihood[tuple(samples.T)]) - centre))
        counts.append(len(samples))
        if step in SHOWN:
            shown[str(step)] = VOXEL_M * (samples - centre)
        chosen = systematic(rng, likelihood[tuple(samples.T)], parameters["samples"])
        samples = _propagate(samples[chosen], occupied.shape, rng)
    return {"spread": spreads, "error_mm": errors, "n_samples": counts, "shown_m": shown if parameters["repeat"] == 0 else {}}


def _spread(points: np.ndarray) -> float:
    """Root mean square distance from the mean, in voxels."""
    return float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _propagate(samples: np.ndarray, shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
    """Move every sample by at most a voxel each way, never two into one voxel.

    Who meets a taken voxel tries the neighbours in random order; who finds none is dismissed.
    """
    moves = np.stack(np.meshgrid(*3 * ([-1, 0, 1],), indexing="ij"), axis=-1).reshape(-1, 3)
    inside = np.array(shape) - 1
    taken: set[tuple[int, ...]] = set()
    for place in np.clip(samples + rng.integers(-1, 2, samples.shape), 0, inside):
        tries = [tuple(place)]
        if tries[0] in taken:
            tries = [tuple(other) for other in np.clip(place + rng.permutation(moves), 0, inside)]
        free = next((one for one in tries if one not in taken), None)
        if free is not None:
            taken.add(free)
    return np.array(sorted(taken))


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Samples at a few steps, and spread and error over the steps."""
    figure = plt.figure(figsize=(8, 4.5))
    pictures, curves = figure.subfigures(1, 2, width_ratios=(1.1, 1))  # type: ignore[misc]
    shown = pictures.subplots(2, len(SHOWN), sharex=True, sharey=True)
    upper, lower = curves.subplots(2, 1, sharex=True)
    rows, spreads = [], {}
    for row, (name, color) in enumerate(zip(LIKELIHOODS, (COLORS["sparse"], COLORS["particle"]), strict=True)):
        own = [one.results for one in cells if one.parameters["likelihood"] == name]
        spread, error = (np.mean([one[key] for one in own], axis=0) for key in ("spread", "error_mm"))
        spreads[name] = np.array([np.mean(one["spread"]) for one in own])
        rows += [
            {"likelihood": name, "step": k, "spread_of_uniform": spread[k], "centroid_error_mm": error[k]}
            for k in range(0, len(spread), 25)
        ]
        for axes, step in zip(shown[row], SHOWN, strict=True):
            points = np.array(own[0]["shown_m"][str(step)])
            axes.plot(points[:, 0], points[:, 2], ".", color=color, markersize=1.5)
            axes.set_xlabel("x (m)" if row else "")
            axes.set(aspect="equal", title=f"step {step}" if row == 0 else "", xlim=(-0.4, 0.4), ylim=(-1.1, 1.1), xticks=(-0.3, 0.3))
        shown[row][0].set_ylabel(f"{name}\nz (m)")
        upper.plot(spread, color=color, label=name)
        lower.plot(error, color=color)
    upper.set(ylabel="spread\n(of uniform samples: 1)", ylim=(0, 1.1))
    upper.legend()
    lower.set(xlabel="step", ylabel="error of the centroid (mm)", ylim=(0, None))
    gain = interval([""] * len(spreads["surface"]), spreads["surface"] - spreads["interior"], np.ones(len(spreads["surface"])))
    claim = decide(
        "samples spread faster over the surface",
        gain,
        f"mean over {STEPS} steps {spreads['surface'].mean():.2f} of uniform samples' spread against {spreads['interior'].mean():.2f}; "
        f"between {gain.low:.3f} and {gain.high:.3f} more",
    )
    caption = f"Spread of {SAMPLES} samples from one side of an ellipsoid (half axes .3, .3, 1.0 m; voxels of 2 cm). The paper: Figure 4.9."
    return Report((Table("fig-4.9", caption, rows),), {"fig-4.9": figure}, (claim,))


EXPERIMENT = Experiment("fig-4.9", "samples spreading over surface and over interior", "Canton, Figure 4.9", grid, cell, report)
