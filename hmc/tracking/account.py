"""What a run says of itself when it is over: whether the hulls are those of so many people, and whether the tracks are.

Each remark is one line that names what is wrong and what to do; a run of which nothing is to be said has none.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import astuple, dataclass
from itertools import combinations

import numpy as np

from hmc.io.results import TrackTable
from hmc.tracking.blobs import Observation
from hmc.tracking.state import TrackerInfo

__all__ = ["Account", "account_of", "remarks"]

#: A person fills 50 to 110 litres; the strict hull of four people who stand close before four cameras 200 a person (`close_white`).
MOST_LITRES = 300.0
#: Share of the strict hull that may be nobody's: a chair that was brought in, shadows.
MOST_FREE = 0.3
#: Two tracks that are nearer to each other than this for so long are on one person.
SAME_M, SAME_S = 0.25, 1.0


@dataclass(frozen=True)
class Account:
    """Sums over frames.

    Attributes
    ----------
    frames, persons : int
        Frames in which there were hulls, and tracked people in them.
    strict_m3, free_m3 : float
        Volume of the strict hull, and of what of it is no track's; of frames in which a person was tracked.
    """

    frames: int = 0
    persons: int = 0
    strict_m3: float = 0.0
    free_m3: float = 0.0

    def plus(self, other: Account) -> Account:
        """Both together."""
        return Account(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))


def account_of(observation: Observation | None, info: TrackerInfo) -> Account:
    """The account of one frame.

    Parameters
    ----------
    observation : Observation or None
    info : TrackerInfo
        What the tracker found in it.
    """
    if observation is None or len(info.owners) != len(observation.points):
        return Account()
    persons = len(np.unique(info.owners[info.owners >= 0]))
    if not persons:
        return Account(1)
    volume = observation.voxel_size_m**3
    strict, free = observation.certain.sum(), (observation.certain & (info.owners < 0)).sum()
    return Account(1, persons, float(strict * volume), float(free * volume))


def remarks(account: Account, table: TrackTable, fps: float, most: int | None) -> list[str]:
    """What is to be said of a run; one line each.

    Parameters
    ----------
    account : Account
    table : TrackTable
    fps : float
    most : int or None
        People who are there at once at most, where that is known.
    """
    lines = []
    if account.persons:
        litres, free = 1000 * account.strict_m3 / account.persons, account.free_m3 / max(account.strict_m3, 1e-9)
        if litres > MOST_LITRES:
            lines.append(
                f"the hulls hold {litres:.0f} litres a person, where people have 50 to 110: the silhouettes show much that is no person; "
                "look at them with hmc view, and give frames of the empty scene in the same light"
            )
        if free > MOST_FREE:
            lines.append(
                f"{100 * free:.0f} % of what all cameras see is none of the tracked people: somebody may not be followed, or something was "
                "brought in"
            )
    lines += [
        f"persons {a} and {b} are in one place for {seconds:.1f} s: they may be one person" for a, b, seconds in _in_one_place(table, fps)
    ]
    if most == 0:
        return [*lines, "recording.toml says persons = 0, so nobody was looked for; correct it, or take it out"]
    if not len(table.frames):
        return [*lines, "nobody was found in any frame: hmc check tells whether calibration, room and silhouettes fit each other"]
    there = np.bincount(table.frames - table.frames.min())
    if most is not None and there.max() < most:
        lines.append(f"recording.toml says {most} persons; at most {there.max()} were found at once")
    return lines


def _in_one_place(table: TrackTable, fps: float) -> Iterator[tuple[int, int, float]]:
    """Pairs of persons who are too near to each other for too long, and for how long, seconds."""
    places = {int(k): (table.frames[table.persons == k], table.positions[table.persons == k]) for k in np.unique(table.persons)}
    for a, b in combinations(places, 2):
        _, i, j = np.intersect1d(places[a][0], places[b][0], return_indices=True)
        near = np.hypot(*(places[a][1][i] - places[b][1][j])[:, :2].T) < SAME_M
        if near.sum() > SAME_S * fps:
            yield a, b, near.sum() / fps
