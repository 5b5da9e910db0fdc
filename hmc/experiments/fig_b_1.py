"""Figure B.1: how much of a region is left when its pixels are rotated and rounded, and what over-sampling restores.

Source: Canton (2009), appendix B, Eq. B.1. The thesis: 84 % of a square's pixels are left at 45 degrees without over-sampling (alpha = 1);
alpha = .7 restores them, since then the rotated points are nowhere farther apart than a pixel.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs

__all__ = ["EXPERIMENT"]

ALPHAS = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)
SHOWN = (1.0, 0.9, 0.8, 0.7)


def grid(plan: Plan) -> list[dict]:
    """One cell an over-sampling; a larger square and finer angles in full."""
    side, step = (101, 3.0) if plan.quick else (201, 1.0)
    return [{"alpha": alpha, "side_px": side, "step_deg": step} for alpha in ALPHAS]


def rotated_pixels(side: int, alpha: float, angle: float) -> np.ndarray:
    """Pixels that a square's points fall on when it is rotated (Eq. B.1).

    Parameters
    ----------
    side : int
        Side of the square, pixels.
    alpha : float
        Distance between its points, pixels; the points are centred in the square.
    angle : float
        Radians.

    Returns
    -------
    ndarray of int, shape (n, 2)
        Each once; the square's centre is at the origin.
    """
    ticks = alpha * (np.arange(round(side / alpha)) - (round(side / alpha) - 1) / 2)
    points = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    cos, sin = np.cos(angle), np.sin(angle)
    # Rounding must not decide on which side of a pixel's edge a point falls that lies on it.
    return np.unique(np.floor(points @ np.array([[cos, -sin], [sin, cos]]) + 0.5 + 1e-9).astype(int), axis=0)


def inside_pixels(side: int, angle: float) -> int:
    """How many pixels have their centre in the rotated square, a pixel off its edge."""
    reach = np.arange(-side, side + 1)
    x, y = np.meshgrid(reach, reach, indexing="ij")
    cos, sin = np.cos(angle), np.sin(angle)
    return int((np.maximum(np.abs(x * cos - y * sin), np.abs(x * sin + y * cos)) <= side / 2 - 1).sum())


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """The share of the area that is left at every angle, and the holes inside."""
    side, alpha = parameters["side_px"], parameters["alpha"]
    degrees = np.arange(0, 90 + 1e-9, parameters["step_deg"])
    left, holes = [], []
    for angle in np.radians(degrees):
        pixels = rotated_pixels(side, alpha, angle)
        cos, sin = np.cos(angle), np.sin(angle)
        # The same rotation undone: how far each pixel is from the square's middle along its own axes.
        own = pixels @ np.array([[cos, sin], [-sin, cos]])
        inside = (np.abs(own).max(axis=1) <= side / 2 - 1).sum()
        left.append(len(pixels) / side**2)
        holes.append(1 - inside / inside_pixels(side, angle))
    picture = rotated_pixels(41, alpha, np.pi / 4) if alpha in SHOWN else np.zeros((0, 2), int)
    return {"angle_deg": degrees, "area_left": left, "holes": holes, "picture": picture}


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Curves and pictures."""
    figure = plt.figure(figsize=(8, 4))
    left, right = figure.subfigures(1, 2, width_ratios=(1.2, 1))  # type: ignore[misc]
    axes = left.subplots()
    squares = iter(right.subplots(2, 2).ravel())
    rows, at_45 = [], {}
    for one, color in zip(cells, plt.get_cmap("viridis")(np.linspace(0, 0.9, len(cells))), strict=True):
        alpha, results = one.parameters["alpha"], one.results
        degrees, area = np.array(results["angle_deg"]), np.array(results["area_left"])
        axes.plot(degrees, 100 * area, color=color, label=f"{alpha:g}")
        k = int(np.abs(degrees - 45).argmin())
        at_45[alpha] = 100 * area[k]
        paper = {1.0: 84.0, 0.7: 100.0}.get(alpha)
        rows.append({"alpha": alpha, "area_at_45_deg_percent": at_45[alpha], "area_at_45_deg_percent_paper": paper,
                     "least_area_percent": 100 * area.min(), "at_deg": float(degrees[area.argmin()]),
                     "holes_at_45_deg_percent": 100 * results["holes"][k]})  # fmt: skip
        if alpha in SHOWN:
            picture = np.array(results["picture"])
            filled = np.zeros((61, 61), bool)
            filled[tuple((picture + 30).T)] = True
            square = next(squares)
            square.imshow(filled.T, cmap="Greys", origin="lower", interpolation="nearest")
            square.set(title=f"alpha {alpha:g}", xticks=[], yticks=[])
            square.grid(False)
    axes.set(xlabel="rotation (degrees)", ylabel="pixels left, of the square's area (%)")
    axes.legend(title="alpha", ncols=2)
    holes = {one.parameters["alpha"]: 100 * max(one.results["holes"]) for one in cells}
    claims = (
        Claim("without over-sampling about 84 % are left at 45 degrees", abs(at_45[1.0] - 84) < 3, f"{at_45[1.0]:.1f} %"),
        Claim(
            "alpha = .7 leaves no holes at any angle",
            holes[0.7] == 0,
            ", ".join(f"{alpha:g}: {value:.1f} %" for alpha, value in holes.items()),
        ),
    )
    caption = "A square of pixels, rotated and rounded, by the distance alpha between its points. The paper: Canton, Figure B.1."
    return Report((Table("fig-B.1", caption, rows),), {"fig-B.1": figure}, claims)


EXPERIMENT = Experiment("fig-B.1", "compactness of a rotated square against over-sampling", "Canton, Figure B.1", grid, cell, report)
