"""Figure B.1: how much of a region is left when its pixels are rotated and rounded, and what over-sampling restores.

Source: Canton (2009), appendix B, Eq. B.1. The thesis: 84 % of a square's pixels are left at 45 degrees, the worst angle, without
over-sampling (alpha = 1); alpha = .7 restores them, since then the rotated points are nowhere farther apart than a pixel. It does not say
how large its square is, nor how it lies in the grid: here are several, each laid at random places within a pixel. Laid with its middle on
a pixel's, a small square loses most at other angles, where many rotated points fall on pixels' edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.intervals import Interval, decide
from hmc.experiments.engine.selection import REPEAT
from hmc.experiments.run_means import mean_interval, run_values

__all__ = ["EXPERIMENT"]

ALPHAS = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)
SHOWN = (1.0, 0.9, 0.8, 0.7)
#: Sides of the squares in full and quick, pixels, and the one whose curves are drawn.
SIDES = {False: (31, 41, 51, 101, 201), True: (31, 51)}
DRAWN = 51
#: The thesis's figure, so far from it that it is the same, percent, and so far from 45 degrees as angles are coarse.
PRINTED, SAME, NEAR_DEG = 84.0, 1.0, 6.0


def grid(plan: Plan) -> list[dict]:
    """Every square by every over-sampling at several places; finer angles in full."""
    step, repeats = (3.0, 6) if plan.quick else (1.0, 10)
    return [
        {"alpha": alpha, "side_px": side, "step_deg": step, "repeat": repeat}
        for side in SIDES[plan.quick]
        for alpha in ALPHAS
        for repeat in range(repeats)
    ]


def rotated_pixels(side: int, alpha: float, angle: float, place: np.ndarray | float = 0.0) -> np.ndarray:
    """Pixels that a square's points fall on when it is rotated (Eq. B.1).

    Parameters
    ----------
    side : int
        Side of the square, pixels.
    alpha : float
        Distance between its points, pixels; the points are centred in the square.
    angle : float
        Radians.
    place : ndarray, shape (2,)
        Where the square's middle is, pixels.

    Returns
    -------
    ndarray of int, shape (n, 2)
        Each once.
    """
    ticks = alpha * (np.arange(round(side / alpha)) - (round(side / alpha) - 1) / 2)
    points = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    cos, sin = np.cos(angle), np.sin(angle)
    # Rounding must not decide on which side of a pixel's edge a point falls that lies on it.
    return np.unique(np.floor(points @ np.array([[cos, -sin], [sin, cos]]) + place + 0.5 + 1e-9).astype(int), axis=0)


def inside_pixels(pixels: np.ndarray, side: int, angle: float, place: np.ndarray) -> int:
    """How many of some pixels, (n, 2), have their centre in the rotated square, a pixel off its edge."""
    cos, sin = np.cos(angle), np.sin(angle)
    # The rotation undone: how far each pixel is from the square's middle along its own axes.
    own = (pixels - place) @ np.array([[cos, sin], [-sin, cos]])
    return int((np.abs(own).max(axis=1) <= side / 2 - 1).sum())


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """The share of the area that is left at every angle, and the holes inside, of a square at a random place."""
    side, alpha, place = parameters["side_px"], parameters["alpha"], rng.random(2)
    degrees = np.arange(0, 90 + 1e-9, parameters["step_deg"])
    reach = np.arange(-side, side + 1)
    every = np.stack(np.meshgrid(reach, reach, indexing="ij"), axis=-1).reshape(-1, 2)
    left, holes = [], []
    for angle in np.radians(degrees):
        pixels = rotated_pixels(side, alpha, angle, place)
        left.append(len(pixels) / side**2)
        holes.append(1 - inside_pixels(pixels, side, angle, place) / inside_pixels(every, side, angle, place))
    picture = rotated_pixels(41, alpha, np.pi / 4) if alpha in SHOWN else np.zeros((0, 2), int)
    return {"angle_deg": degrees, "area_left": left, "holes": holes, "picture": picture}


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Curves and pictures of one square, and what is left of all."""
    figure = plt.figure(figsize=(8, 4))
    left, right = figure.subfigures(1, 2, width_ratios=(1.2, 1))  # type: ignore[misc]
    axes = left.subplots()
    squares = iter(right.subplots(2, 2).ravel())
    rows = []
    colors = dict(zip(ALPHAS, plt.get_cmap("viridis")(np.linspace(0, 0.9, len(ALPHAS))), strict=True))
    for side, alpha in dict.fromkeys((one.parameters["side_px"], one.parameters["alpha"]) for one in cells):
        own = [one for one in cells if (one.parameters["side_px"], one.parameters["alpha"]) == (side, alpha)]
        degrees = np.array(own[0].results["angle_deg"])
        area = 100 * np.mean([one.results["area_left"] for one in own], axis=0)
        k = int(np.abs(degrees - 45).argmin())
        there = mean_interval(run_values(own, partial(_percent_left, place=k), "side_px"))
        rows.append({"side_px": side, "alpha": alpha, "area_at_45_deg_percent": there.value, "area_at_45_low_percent": there.low,
                     "area_at_45_high_percent": there.high, "area_at_45_deg_percent_paper": {1.0: PRINTED, 0.7: 100.0}.get(alpha),
                     "least_area_percent": area.min(), "at_deg": float(degrees[area.argmin()]),
                     "most_holes_percent": 100 * max(max(one.results["holes"]) for one in own)})  # fmt: skip
        if side != DRAWN:
            continue
        axes.plot(degrees, area, color=colors[alpha], label=f"{alpha:g}")
        if alpha in SHOWN:
            picture = np.array(own[0].results["picture"])
            filled = np.zeros((61, 61), bool)
            filled[tuple((picture + 30).T)] = True
            square = next(squares)
            square.imshow(filled.T, cmap="Greys", origin="lower", interpolation="nearest")
            square.set(title=f"alpha {alpha:g}", xticks=[], yticks=[])
            square.grid(False)
    axes.set(xlabel="rotation (degrees)", ylabel=f"pixels left of a square of {DRAWN}\nby {DRAWN} pixels (% of its area)")
    axes.legend(title="alpha", ncols=2)
    plain = [row for row in rows if row["alpha"] == 1.0]
    at_45 = np.array([row["area_at_45_deg_percent"] for row in plain])
    holes = {alpha: max(row["most_holes_percent"] for row in rows if row["alpha"] == alpha) for alpha in ALPHAS}
    sampled = [one for one in cells if one.parameters["alpha"] == 1.0]
    degrees, left_of_all = sampled[0].results["angle_deg"], np.mean([one.results["area_left"] for one in sampled], axis=0)
    far = [j for j, angle in enumerate(degrees) if abs(angle - 45) > NEAR_DEG]
    closest = min(far, key=left_of_all.__getitem__)
    more = _more_left(sampled, closest)
    told = ", ".join(
        f"{row['side_px']} px: {Interval(*(row[f'area_at_45_{end}_percent'] for end in ('deg', 'low', 'high')))} %" for row in plain
    )
    claims = (
        Claim(f"without over-sampling {PRINTED:g} % are left at 45 degrees", bool(abs(at_45.mean() - PRINTED) < SAME), told),
        decide(
            "45 degrees are the worst, in the mean of all squares",
            more,
            f"elsewhere least are left at {degrees[closest]:g} degrees, more by {more} %; least "
            + ", ".join(f"of {row['side_px']} px at {row['at_deg']:g}" for row in plain),
        ),
        Claim(
            "alpha = .7 leaves no holes at any angle, and .8 does",
            holes[0.7] == 0 < holes[0.8],
            ", ".join(f"{alpha:g}: {value:.1f} %" for alpha, value in holes.items()),
        ),
    )
    caption = "Squares of pixels, rotated and rounded, by the distance alpha between their points. The paper: Canton, Figure B.1."
    return Report((Table("fig-B.1", caption, rows),), {"fig-B.1": figure}, claims)


def _more_left(cells: Sequence[Cell], place: int) -> Interval:
    """By how many percent of the area more is left at an angle than at 45 degrees: sizes are chosen, places drawn."""
    k = int(np.abs(np.array(cells[0].results["angle_deg"]) - 45).argmin())
    gains: dict[int, list[float]] = {}
    for one in cells:
        gains.setdefault(one.parameters[REPEAT], []).append(_percent_left(one, place) - _percent_left(one, k))
    return mean_interval({("", repeat): float(np.mean(own)) for repeat, own in gains.items()})


def _percent_left(one: Cell, place: int) -> float:
    return 100 * float(one.results["area_left"][place])


EXPERIMENT = Experiment(
    "fig-B.1", "compactness of a rotated square against over-sampling", "Canton, Figure B.1", grid, cell, report, version=2
)
