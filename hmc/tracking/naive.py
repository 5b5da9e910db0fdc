"""The naive tracker: each person is at the centroid of the voxels in the region of influence around where they should be.

Source: Canton (2009), section 4.3.1, Eq. 4.4-4.7. Three things differ from the text. The region is placed at the position predicted
from the smoothed velocity instead of the last one. Voxels in the regions of several persons go to the nearest (Eq. 4.7 takes them
from all; ``exclusion="remove"`` does so). And once the region has told which component a person is, the whole component within
reach counts, not the part inside the ellipsoid only, so that stretched arms are in the centroid.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hmc.errors import InputError
from hmc.tracking.blobs import Observation, blob_features
from hmc.tracking.ghosts import real_people
from hmc.tracking.lifecycle import (
    Candidate,
    LifecycleSettings,
    Row,
    Track,
    confirm,
    delete,
    looks_like_person,
    newcomers,
    propose,
    still_a_person,
    unowned_blobs,
)
from hmc.tracking.region import person_radii, region_distance

__all__ = ["NaiveInfo", "NaiveSettings", "NaiveState", "assign_voxels", "finish", "head_centre", "init", "step"]

#: Share of the room beyond which what is occupied cannot be people.
MOST_FILLED = 0.5


@dataclass(frozen=True)
class NaiveSettings:
    """Parameters of the naive tracker.

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
        Share of the measured correction that is believed while persons share one component.
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
    least_certain_m3: float = 0.03
    lifecycle: LifecycleSettings = field(default_factory=LifecycleSettings)

    def __post_init__(self) -> None:
        if self.exclusion not in ("nearest", "remove"):
            raise InputError(f"`exclusion` must be 'nearest' or 'remove'; got {self.exclusion!r}")


@dataclass(frozen=True)
class NaiveState:
    """The tracker between two frames.

    Attributes
    ----------
    fps : float
    tracks : tuple of Track
        Persons, by number.
    candidates : tuple of Candidate
    next_person : int
    """

    fps: float
    tracks: tuple[Track, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    next_person: int = 0


@dataclass(frozen=True)
class NaiveInfo:
    """What a step found beside the new state.

    Attributes
    ----------
    rows : tuple of Row
        New lines for the table: persons seen in this frame and earlier frames of persons confirmed in it.
    owners : ndarray of int, shape (n_voxels,)
        Person number of each voxel of the observation, or -1.
    shared : tuple of int
        Persons whose component holds another person too.
    """

    rows: tuple[Row, ...]
    owners: np.ndarray
    shared: tuple[int, ...] = ()


def init(fps: float) -> NaiveState:
    """Nobody is there yet.

    Parameters
    ----------
    fps : float
        Frames a second.

    Raises
    ------
    InputError
        When `fps` is not positive.
    """
    if not np.isfinite(fps) or fps <= 0:
        raise InputError(f"`fps` must be a positive number of frames a second; got {fps}")
    return NaiveState(float(fps))


def step(
    state: NaiveState, frame: int, observation: Observation | None, settings: NaiveSettings | None = None
) -> tuple[NaiveState, NaiveInfo]:
    """One frame on.

    Parameters
    ----------
    state : NaiveState
    frame : int
        Absolute number; frames come in order.
    observation : Observation or None
        None where the frame tells nothing: every track waits. So it does when most of the room is occupied (a light switch). An
        observation without voxels means that nobody is there.
    settings : NaiveSettings, optional

    Returns
    -------
    state : NaiveState
    info : NaiveInfo
    """
    settings = NaiveSettings() if settings is None else settings
    if observation is None or len(observation.points) * observation.voxel_size_m**3 > MOST_FILLED * np.ptp(observation.room, axis=0).prod():
        waiting = tuple(replace(track, last_frame=track.last_frame + 1, velocity=track.velocity * 0.5) for track in state.tracks)
        return replace(state, tracks=waiting), NaiveInfo((), np.full(0 if observation is None else len(observation.points), -1))
    predicted = _predict(state.tracks, frame, state.fps)
    owners, shared = assign_voxels(observation, predicted, settings)
    owners = _find_again(state.tracks, frame, state.fps, observation, owners, settings)
    owned = blob_features(observation.points, owners, len(predicted), observation.voxel_size_m)
    best = locating_voxels(observation, owners, len(predicted), settings)
    located = blob_features(observation.points, np.where(best, owners, -1), len(predicted), observation.voxel_size_m)
    certain = blob_features(observation.points, np.where(observation.certain, owners, -1), len(predicted), observation.voxel_size_m)
    supported = still_a_person(owned, certain, state.tracks, settings.lifecycle)
    tracks, rows = [], []
    for k, track in enumerate(state.tracks):
        if supported[k]:
            head = head_centre(observation.points[best & (owners == k)])
            tracks.append(
                _update(track, frame, predicted[k], located.centroid[k], owned.volume_m3[k], head, bool(shared[k]), state.fps, settings)
            )
            rows.append(Row(frame, track.person, located.centroid[k], head))
        else:
            tracks.append(replace(track, position=predicted[k], velocity=track.velocity * 0.8))

    candidates = propose(state.candidates, _newcomers(observation, owners, frame, settings), tuple(tracks), settings.lifecycle)
    candidates, fresh, earlier = confirm(candidates, state.next_person, state.fps, settings.lifecycle)
    kept = delete((*tracks, *fresh), frame, state.fps, observation.room, settings.lifecycle)
    numbers = np.array([*(track.person for track in state.tracks), -1])
    info = NaiveInfo((*rows, *earlier), numbers[owners], tuple(int(n) for n in numbers[:-1][shared]))
    return NaiveState(state.fps, kept, candidates, state.next_person + len(fresh)), info


def finish(state: NaiveState, n_frames: int, settings: NaiveSettings | None = None) -> tuple[Row, ...]:
    """Rows still to come when the recording is over.

    In a recording too short for any candidate to be confirmed, those seen in every frame are persons.

    Parameters
    ----------
    state : NaiveState
    n_frames : int
        Frames in the recording.
    settings : NaiveSettings, optional

    Returns
    -------
    tuple of Row
    """
    settings = NaiveSettings() if settings is None else settings
    short = replace(settings.lifecycle, confirm_frames=n_frames, confirm_s=0.0)
    if n_frames > max(settings.lifecycle.confirm_frames, round(settings.lifecycle.confirm_s * state.fps)):
        return ()
    return tuple(confirm(state.candidates, state.next_person, state.fps, short)[2])


def assign_voxels(observation: Observation, positions: np.ndarray, settings: NaiveSettings | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Which person each occupied voxel belongs to.

    Each person claims the component that fills most of their region of influence, further pieces of which half lies inside, and
    fragments that touch it. A voxel of a component goes to the nearest of its claimants.

    Parameters
    ----------
    observation : Observation
    positions : ndarray, shape (k, 3)
        Where the persons should be: centroids, world, metres.
    settings : NaiveSettings, optional

    Returns
    -------
    owners : ndarray of int, shape (n,)
        Row of `positions`, or -1.
    shared : ndarray of bool, shape (k,)
        The person's main component is another's too.
    """
    settings = NaiveSettings() if settings is None else settings
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


def locating_voxels(observation: Observation, owners: np.ndarray, n_persons: int, settings: NaiveSettings) -> np.ndarray:
    """Voxels from which each person's position is taken: the certain ones, or all of a person who has too few of those.

    Parameters
    ----------
    observation : Observation
    owners : ndarray of int, shape (n,)
        Person of each voxel, -1 for nobody.
    n_persons : int
    settings : NaiveSettings

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


def _newcomers(observation: Observation, owners: np.ndarray, frame: int, settings: NaiveSettings) -> list[Row]:
    """Where person-like sets of voxels are that no track owns and that are no ghosts."""
    sets = newcomers(observation, owners, settings.lifecycle)
    if sets and observation.views is not None:
        points = [observation.points[rows] for rows in sets]
        real = real_people(observation.views, observation.points[owners >= 0], points, observation.voxel_size_m)
        sets = [rows for rows, one in zip(sets, real, strict=True) if one]
    person = np.full(len(owners), -1)
    for j, rows in enumerate(sets):
        person[rows] = j
    best = locating_voxels(observation, person, len(sets), settings)
    located = [observation.points[best & (person == j)] for j in range(len(sets))]
    return [Row(frame, -1, points.mean(axis=0), head_centre(points)) for points in located]


def _predict(tracks: tuple[Track, ...], frame: int, fps: float) -> np.ndarray:
    """Positions in this frame, shape (k, 3); heights stay."""
    return np.array([track.position + track.velocity * (1.0, 1.0, 0.0) / fps for track in tracks]).reshape(-1, 3)


def _update(
    track: Track,
    frame: int,
    predicted: np.ndarray,
    measured: np.ndarray,
    volume_m3: float,
    head: np.ndarray,
    shared: bool,
    fps: float,
    settings: NaiveSettings,
) -> Track:
    """The track after a measurement; while a component is shared, the prediction keeps some weight."""
    gain = settings.shared_gain if shared else 1.0
    position = predicted + gain * (measured - predicted)
    blend = gain * (1 - np.exp(-1 / (fps * settings.velocity_time_s)))
    velocity = track.velocity + blend * ((position - track.position) * fps - track.velocity)
    velocity = velocity * min(1.0, settings.most_speed_m_s / max(float(np.linalg.norm(velocity)), 1e-9))
    volume = float(volume_m3)
    if track.volume_m3 > 0:
        volume = track.volume_m3 if shared else track.volume_m3 + blend * (min(volume, 2 * track.volume_m3) - track.volume_m3)
    return replace(track, position=position, head=head, velocity=velocity, volume_m3=volume, last_frame=frame)


def _find_again(
    tracks: tuple[Track, ...], frame: int, fps: float, observation: Observation, owners: np.ndarray, settings: NaiveSettings
) -> np.ndarray:
    """Give a track without support the nearest person-like component that nobody owns, if the person can have come so far."""
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
