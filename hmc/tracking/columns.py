"""Upright bodies in the strict hull, and which of them explain the silhouettes.

People who stand or sit fill a column of the strict hull down from the head. Their heads and shoulders are apart even where arms, legs
and the hull between them join several people into one set of voxels. Where all cameras see other people, the hull has columns too at
which nobody is: ghosts. A person accounts for parts of the silhouettes of two views at least that nobody else accounts for; so of all
columns together the set is kept in which each does.

Beyond Canton (2009), whose tracker makes one person of a connected set. Fleuret et al. (2008), "Multicamera people tracking with a
probabilistic occupancy map", decide jointly too which places of the floor explain all silhouettes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from hmc.tracking.blobs import Observation
from hmc.tracking.views import FrameViews, cell_grid, cells_of

__all__ = ["Columns", "bodies_at", "explaining", "find_columns", "missed", "nearest_column"]

#: Voxels from this height on count: heads, shoulders and trunks of people who stand or sit. Metres.
UPPER_M = 0.9
#: Radius of what is summed up around a place, seen from above: head and shoulders. Metres.
TRUNK_M = 0.16
#: Of a person's own local maxima within this distance only the highest counts, metres.
APART_M = 0.2
#: Least volume of a column from `UPPER_M` on, cubic metres: a fifth of a seated woman's.
LEAST_M3 = 0.008
#: Around a person the hull falls below this share of the column's volume: where it does not before the next column, there is one person.
#: And it does within this area, square metres: a room that is full, as after a light was switched, has no columns.
FALL, MOST_M2 = 0.95, 0.3
#: A person's voxels are within this of the column's middle, seen from above; metres.
BODY_M = 0.3
#: Least volume of a whole trunk, from the head to the floor, cubic metres: nine in ten of those who stand have more in `close_pale`,
#: `close_white`, `hug` and r3. What stands beside a body has a trunk of its own, or is nobody: the hull around one person in a corner,
#: which few cameras see, is fat, and so is one with arms (`meeting_moved`: false positives 0 to 9 without).
WHOLE_M3 = 0.05
#: Share of what a person covers in a view that must be theirs alone for the view to speak for them, and views that must, where there are
#: as many.
OWN_SHARE, OWN_VIEWS = 0.15, 2
#: The same share for who has a whole trunk, which ghosts seldom have (`close_pale`, voxels of 4 cm: MOTA .868 without).
WHOLE_SHARE = 0.1
#: The same for a person whom a camera misses, and who is in the tolerant hull alone: of four cameras that is full of ghosts.
MISSED_SHARE, MISSED_VIEWS = 0.4, 3


@dataclass(frozen=True)
class Columns:
    """Upright bodies of one frame.

    Attributes
    ----------
    centres : ndarray, shape (m, 2)
        Seen from above, world, metres; of those found together the fullest first.
    voxels : tuple of ndarray of int
        Rows of the observation: each one's voxels of the hull; neighbours share some.
    """

    centres: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    voxels: tuple[np.ndarray, ...] = ()

    def __len__(self) -> int:
        return len(self.centres)

    def take(self, rows: np.ndarray) -> Columns:
        """Some of them, by numbers or by a mask."""
        chosen = np.arange(len(self))[rows]
        return Columns(self.centres[chosen], tuple(self.voxels[j] for j in chosen))


def find_columns(observation: Observation, strict: bool = True) -> Columns:
    """Where upright bodies may be: local maxima of the hull's volume above `UPPER_M`, seen from above.

    First of all of it; then of what no body at these holds, until nothing is left that could be one: of two who stand back to back the
    hull often has one maximum.

    Parameters
    ----------
    observation : Observation
    strict : bool
        Of the strict hull, or of all that is occupied.

    Returns
    -------
    Columns
    """
    sure = np.flatnonzero(observation.certain) if strict else np.arange(len(observation.points))
    upper = _from_above(observation, sure[observation.points[sure, 2] >= UPPER_M])
    size, first = observation.voxel_size_m, observation.grid.bounds[0, :2]
    places = np.moveaxis(np.indices(upper.shape), 0, -1)[:, :, None] + 0.5
    rounds: list[np.ndarray] = []
    while len(middles := _maxima(upper, size)):
        held = (np.hypot(*np.moveaxis(places - middles, -1, 0)) * size <= BODY_M).any(axis=2)
        if not upper[held].any():
            break
        rounds.append(first + middles * size)
        upper = np.where(held, np.float32(0), upper)
    if not rounds:
        return Columns()
    centres = np.concatenate(rounds)
    across = observation.points[sure, None, :2] - centres
    near = np.einsum("nkc,nkc->nk", across, across) <= BODY_M**2
    columns = Columns(centres, tuple(sure[mine] for mine in near.T))
    return columns.take(_whole(observation.points, columns, size) | (np.arange(len(columns)) < len(rounds[0])))


def nearest_column(points: np.ndarray, centres: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The column that is nearest to each point, seen from above.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        World, metres.
    centres : ndarray, shape (m, 2)
        The columns, one at least, seen from above, world, metres.

    Returns
    -------
    nearest : ndarray of int, shape (n,)
    away : ndarray, shape (n,)
        How far it is, metres.
    """
    across = points[:, None, :2] - centres
    squared = np.einsum("nmc,nmc->nm", across, across)
    nearest = squared.argmin(axis=1)
    return nearest, np.sqrt(squared[np.arange(len(nearest)), nearest])


def bodies_at(observation: Observation, centres: np.ndarray) -> np.ndarray:
    """Middle of the body around each of some columns: of the strict hull's voxels that are nearer to it than to another.

    Those within `BODY_M` of the column, seen from above; then those within as much of their middle, as a head is seldom over it.

    Parameters
    ----------
    observation : Observation
    centres : ndarray, shape (m, 2)
        The columns, and where people without one should be, seen from above, world, metres.

    Returns
    -------
    ndarray, shape (m, 3)
        World, metres; nan where the strict hull has nothing.
    """
    bodies = np.full((len(centres), 3), np.nan)
    if not len(centres):
        return bodies
    points = observation.points[observation.certain]
    nearest, _ = nearest_column(points, centres)
    for j, centre in enumerate(centres):
        mine, middle = points[nearest == j], centre
        for _ in range(2):
            held = mine[np.hypot(*(mine[:, :2] - middle[:2]).T) <= BODY_M]
            middle = bodies[j] = held.mean(axis=0) if len(held) else bodies[j]
    return bodies


def _from_above(observation: Observation, rows: np.ndarray) -> np.ndarray:
    """Volume of some voxels over each place of the floor, (nx, ny), cubic metres."""
    x, y = observation.indices[rows, :2].T
    volume = np.zeros(observation.grid.shape[:2], np.float32)
    np.add.at(volume, (x, y), observation.voxel_size_m**3)
    return volume


def _whole(points: np.ndarray, columns: Columns, size: float) -> np.ndarray:
    """Which columns of voxels at points (n, 3) have a whole trunk, shape (m,)."""
    across = (points[rows, :2] - centre for rows, centre in zip(columns.voxels, columns.centres, strict=True))
    return np.array([((one**2).sum(axis=1) <= TRUNK_M**2).sum() * size**3 >= WHOLE_M3 for one in across], bool)


def _maxima(upper: np.ndarray, size: float) -> np.ndarray:
    """Middles of local maxima of a volume that is summed up over heads and shoulders, shape (m, 2), in voxels; the fullest first."""
    volume = cv2.filter2D(upper, -1, _disc(TRUNK_M / size).astype(np.float32), borderType=cv2.BORDER_CONSTANT)
    highest = cv2.dilate(volume, _disc(APART_M / size))
    peaks = np.argwhere((volume >= LEAST_M3) & (volume == highest))
    peaks = peaks[np.argsort(-volume[tuple(peaks.T)], kind="stable")]
    tops: list[tuple[int, ...]] = []
    middles = []
    for place in map(tuple, peaks.tolist()):
        _, plateaus = cv2.connectedComponents((volume >= FALL * volume[place]).view(np.uint8))
        here = plateaus == plateaus[place]
        if here.sum() * size**2 <= MOST_M2 and not any(here[top] for top in tops):
            tops.append(place)
            middles.append(np.argwhere(here).mean(axis=0))
    return np.array(middles).reshape(-1, 2) + 0.5


def explaining(views: FrameViews, points: np.ndarray, columns: Columns, voxel_size_m: float, most: int | None = None) -> np.ndarray:
    """Which columns are people: the largest set, found from above, in which each accounts for silhouettes that nobody else accounts for.

    The one that adds least is left out first; who has a whole trunk needs to add less.

    Parameters
    ----------
    views : FrameViews
    points : ndarray, shape (n, 3)
        Centres of the observation's voxels, world, metres.
    columns : Columns
    voxel_size_m : float
    most : int, optional
        People who are there at most.

    Returns
    -------
    ndarray of bool, shape (m,)
        All true without silhouettes.
    """
    covered = _covered(views, points, columns, voxel_size_m)
    real = np.ones(len(columns), bool)
    if not covered:
        return real
    enough = np.where(_whole(points, columns, voxel_size_m), WHOLE_SHARE, OWN_SHARE)
    needed = min(OWN_VIEWS, len(covered))
    sizes = np.maximum(1, [cells.sum(axis=1) for cells in covered])
    while real.any():
        alone = [cells & (cells[real].sum(axis=0) == 1) for cells in covered]
        share = np.array([cells.sum(axis=1) for cells in alone]) / sizes
        least = np.sort(share, axis=0)[-needed]
        worst = int(np.where(real, least / enough, np.inf).argmin())
        if least[worst] >= enough[worst]:
            if most is None or real.sum() <= most:
                break
            # All are people by what they cover alone: those stay who cover most.
            worst = int(np.where(real, sum(cells.sum(axis=1) for cells in alone), np.inf).argmin())
        real[worst] = False
    return real


def missed(
    views: FrameViews, points: np.ndarray, known: Columns, columns: Columns, voxel_size_m: float, most: int | None = None
) -> np.ndarray:
    """Which columns of the tolerant hull are people beside those who are known: the one that adds most comes first, and is known then.

    Parameters
    ----------
    views : FrameViews
    points : ndarray, shape (n, 3)
        Centres of the observation's voxels, world, metres.
    known, columns : Columns
    voxel_size_m : float
    most : int, optional
        People who are there at most, those who are known among them.

    Returns
    -------
    ndarray of bool, shape (m,)
    """
    both, n = Columns(np.concatenate([known.centres, columns.centres]), known.voxels + columns.voxels), len(known)
    covered = _covered(views, points, both, voxel_size_m)
    found = np.zeros(len(columns), bool)
    taken = [cells[:n].any(axis=0) for cells in covered]
    while len(covered) >= MISSED_VIEWS and not found.all() and (most is None or n + found.sum() < most):
        share = np.array(
            [(cells[n:] & ~one).sum(axis=1) / np.maximum(1, cells[n:].sum(axis=1)) for cells, one in zip(covered, taken, strict=True)]
        )
        adds = np.where(found, 0, np.sort(share, axis=0)[-MISSED_VIEWS])
        best = int(adds.argmax())
        if adds[best] < MISSED_SHARE:
            break
        found[best] = True
        taken = [one | cells[n + best] for one, cells in zip(taken, covered, strict=True)]
    return found


def _covered(views: FrameViews, points: np.ndarray, columns: Columns, voxel_size_m: float) -> list[np.ndarray]:
    """Of each camera with a silhouette, which of its cells each column covers, (m, n_cells)."""
    rows, which = np.unique(np.concatenate([np.zeros(0, int), *columns.voxels]), return_inverse=True)
    there, own = points[rows], np.split(which, np.cumsum([len(voxels) for voxels in columns.voxels])[:-1])
    found = []
    for camera, mask in zip(views.rig, views.masks, strict=True):
        if mask is not None:
            side, shape = cell_grid(camera, there, voxel_size_m)
            cells = cells_of(camera, there, side, mask)
            covered = np.zeros((len(columns), shape[0] * shape[1] + 1), bool)
            for j, voxels in enumerate(own):
                covered[j, cells[voxels]] = True
            found.append(covered[:, :-1])
    return found


def _disc(radius: float) -> np.ndarray:
    """Where a square of pixels is within so many of its middle, 1 or 0."""
    reach = int(np.ceil(radius))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return (np.hypot(x, y) <= radius).astype(np.uint8)
