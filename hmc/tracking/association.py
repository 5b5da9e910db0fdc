"""Which person each occupied voxel belongs to, where people should be in the next frame, and finding them again.

Source: Canton (2009), section 4.3.1. Every tracker uses it: its life cycle asks which voxels nobody owns.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hmc.errors import InputError
from hmc.tracking.blobs import Observation
from hmc.tracking.furniture import LEGS_M, UPRIGHT_M
from hmc.tracking.lifecycle import LifecycleSettings, Track, looks_like_person
from hmc.tracking.newcomers import one_or_two, unowned_blobs
from hmc.tracking.region import person_radii, region_distance

__all__ = ["FollowingSettings", "assign_voxels", "find_again", "head_centre", "let_go", "let_go_things", "locating_voxels", "predict"]

#: What somebody who stands fills below `LEGS_M` is within this of the head, seen from above, in any frame; metres.
STRIDE_M = 0.5


@dataclass(frozen=True)
class FollowingSettings:
    """What every tracker needs to know of people and of the voxels that they own.

    Attributes
    ----------
    enlarge_xy, enlarge_z : float
        Canton's alpha and beta (section 4.3.1).
    exclusion : {"nearest", "remove"}
        What becomes of voxels in several regions.
    reach : float
        Voxels of a person's component count up to this distance, in radii of the region.
    velocity_time_s : float
        Time constant of the velocity's smoothing.
    most_speed_m_s : float
        Nobody is faster.
    most_reach_m : float
        A person who was lost is not looked for further away than this.
    shared_gain : float
        Share of the measured correction that is believed while persons share one component, where no filter tells them apart.
    filter_gain : float
        The same of what a filter says.
    least_certain_m3 : float
        A person with so much of the strict hull is located by it; else by the tolerant one.
    lifecycle : LifecycleSettings
    """

    enlarge_xy: float = 1.5
    enlarge_z: float = 1.2
    exclusion: str = "nearest"
    reach: float = 2.0
    velocity_time_s: float = 0.3
    most_speed_m_s: float = 4.0
    most_reach_m: float = 1.2
    shared_gain: float = 0.5
    filter_gain: float = 1.0
    least_certain_m3: float = 0.03
    lifecycle: LifecycleSettings = field(default_factory=LifecycleSettings)

    def __post_init__(self) -> None:
        if self.exclusion not in ("nearest", "remove"):
            raise InputError(f"`exclusion` must be 'nearest' or 'remove'; got {self.exclusion!r}")


def assign_voxels(
    observation: Observation, positions: np.ndarray, settings: FollowingSettings | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Which person each occupied voxel belongs to.

    Each person claims the component that fills most of their region of influence, further pieces of which half lies inside, and
    fragments that touch it. A voxel of a component goes to the nearest of its claimants.

    Parameters
    ----------
    observation : Observation
    positions : ndarray, shape (k, 3)
        Where the persons should be: centroids, world, metres.
    settings : FollowingSettings, optional

    Returns
    -------
    owners : ndarray of int, shape (n,)
        Row of `positions`, or -1.
    shared : ndarray of bool, shape (k,)
        The person's main component is another's too.
    """
    settings = FollowingSettings() if settings is None else settings
    n, k = len(observation.points), len(positions)
    if n == 0 or k == 0:
        return np.full(n, -1), np.zeros(k, bool)
    distance = region_distance(observation.points, positions, person_radii(positions, settings.enlarge_xy, settings.enlarge_z))
    inside = distance <= 1
    counts = np.stack([np.bincount(observation.labels[inside[:, j]], minlength=len(observation.blobs)) for j in range(k)], axis=1)
    person_like = looks_like_person(observation.blobs, settings.lifecycle)
    claims = (counts * 2 >= observation.blobs.counts[:, None]) | ((counts > 0) & ~person_like[:, None])
    main = counts.argmax(axis=0)
    found = counts.max(axis=0) > 0
    claims[main[found], np.flatnonzero(found)] = True
    shared = np.array([found[j] and np.any(found & (main == main[j]) & (np.arange(k) != j)) for j in range(k)])
    distance = np.where(claims[observation.labels], distance, np.inf)
    owners = distance.argmin(axis=1)
    owners[distance.min(axis=1) > settings.reach**2] = -1
    if settings.exclusion == "remove":
        owners[inside.sum(axis=1) > 1] = -1
    return owners, shared


def locating_voxels(observation: Observation, owners: np.ndarray, n_persons: int, settings: FollowingSettings) -> np.ndarray:
    """Voxels from which each person's position is taken: the certain ones, or all of a person who has too few of those.

    Parameters
    ----------
    observation : Observation
    owners : ndarray of int, shape (n,)
        Person of each voxel, -1 for nobody.
    n_persons : int
    settings : FollowingSettings

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    held = np.bincount(owners[observation.certain & (owners >= 0)], minlength=n_persons) * observation.voxel_size_m**3
    enough = np.append(held >= settings.least_certain_m3, False)
    return np.where(enough[owners], observation.certain, owners >= 0)


def head_centre(points: np.ndarray) -> np.ndarray:
    """Centre of a person's head: the voxels in the top 20 cm, within 15 cm of the axis on which the highest ones stand.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        The person's voxels, at least one; world, metres.

    Returns
    -------
    ndarray, shape (3,)
        Of meaning for people with the head up.
    """
    top = points[:, 2].max()
    crown = points[points[:, 2] >= top - 0.1].mean(axis=0)
    near = (points[:, 2] >= top - 0.2) & (np.hypot(*(points - crown)[:, :2].T) <= 0.15)
    return points[near].mean(axis=0) if near.any() else crown


def predict(tracks: tuple[Track, ...], fps: float) -> np.ndarray:
    """Where people should be in the next frame: they go on as fast as they went, and stay as high as they were.

    Parameters
    ----------
    tracks : tuple of Track
    fps : float
        Frames a second.

    Returns
    -------
    ndarray, shape (k, 3)
        World, metres.
    """
    return np.array([track.position + track.velocity * (1.0, 1.0, 0.0) / fps for track in tracks]).reshape(-1, 3)


def let_go(
    observation: Observation, owners: np.ndarray, positions: np.ndarray, shared: np.ndarray, settings: FollowingSettings
) -> tuple[np.ndarray, dict[int, np.ndarray]]:
    """Free the voxels of a second person whom a track holds beside its own, because the two were one when it began.

    Parameters
    ----------
    observation : Observation
    owners : ndarray of int, shape (n,)
        Row of `positions` that owns each voxel, or -1.
    positions : ndarray, shape (k, 3)
        Where the persons should be, world, metres.
    shared : ndarray of bool, shape (k,)
        Those whose component has another owner too; they hold nobody.
    settings : FollowingSettings

    Returns
    -------
    owners : ndarray of int, shape (n,)
        The owners after that.
    freed : dict of int to ndarray of int
        By row of `positions`, the observation's voxels that were let go.
    """
    owners, freed = owners.copy(), {}
    sure = np.bincount(owners[observation.certain & (owners >= 0)], minlength=len(positions)) * observation.voxel_size_m**3
    for k in np.flatnonzero((sure > settings.lifecycle.least_joined_m3) & ~shared):
        parts = one_or_two(observation, np.flatnonzero(owners == k), settings.lifecycle)
        if len(parts) > 1:
            freed[int(k)] = max(parts, key=lambda rows: np.hypot(*(observation.points[rows].mean(axis=0) - positions[k])[:2]))
            owners[freed[int(k)]] = -1
    return owners, freed


def let_go_things(observation: Observation, owners: np.ndarray, shared: np.ndarray, settings: FollowingSettings) -> np.ndarray:
    """Free what somebody who stands holds beside their legs: a chair that they push or lean on, which would draw them away.

    Parameters
    ----------
    observation : Observation
    owners : ndarray of int, shape (n,)
        Row of the track that owns each voxel, or -1.
    shared : ndarray of bool, shape (k,)
        Those whose component has another owner too; they let nothing go, because the head may be the other's.
    settings : FollowingSettings

    Returns
    -------
    ndarray of int, shape (n,)
        The owners after that.
    """
    owners = owners.copy()
    best = locating_voxels(observation, owners, len(shared), settings)
    for k in np.flatnonzero(~shared):
        mine = observation.points[best & (owners == k)]
        if len(mine) and (head := head_centre(mine))[2] >= UPRIGHT_M:
            beside = np.hypot(*(observation.points - head)[:, :2].T) > STRIDE_M
            owners[(owners == k) & beside & (observation.points[:, 2] < LEGS_M)] = -1
    return owners


def find_again(
    tracks: tuple[Track, ...], frame: int, fps: float, observation: Observation, owners: np.ndarray, settings: FollowingSettings
) -> np.ndarray:
    """Give a track without support the nearest person-like component that nobody owns, if the person can have come so far.

    Parameters
    ----------
    tracks : tuple of Track
    frame : int
    fps : float
        Frames a second.
    observation : Observation
    owners : ndarray of int, shape (n,)
        Row of the track that owns each voxel, or -1.
    settings : FollowingSettings

    Returns
    -------
    ndarray of int, shape (n,)
        The owners after that.
    """
    held = np.bincount(owners[owners >= 0], minlength=len(tracks)) * observation.voxel_size_m**3
    lost = np.flatnonzero(held < settings.lifecycle.keep_volume_m3)
    if lost.size == 0:
        return owners
    owners = owners.copy()
    labels, blobs = unowned_blobs(observation, owners, settings.lifecycle)
    free = list(np.flatnonzero(looks_like_person(blobs, settings.lifecycle)))
    for k in lost:
        way = settings.most_speed_m_s * (frame - tracks[k].last_frame) / fps
        reach = min(settings.lifecycle.least_distance_m + way, settings.most_reach_m)
        gaps = [np.hypot(*(blobs.centroid[b] - tracks[k].position)[:2]) for b in free]
        if gaps and min(gaps) <= reach:
            owners[labels == free.pop(int(np.argmin(gaps)))] = k
    return owners
