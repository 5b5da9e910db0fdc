"""One frame on, whatever filter says where people are: voxels are shared out, tracks are kept, born and deleted.

Source: Canton (2009), Figure 4.1 (filters in the middle, creation and deletion around them). A filter is a function that moves the
persons' clouds of samples; without one, each person is at the centroid of their voxels (`hmc.tracking.naive`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from time import thread_time
from typing import Any

import numpy as np

from hmc.errors import InputError
from hmc.tracking.association import (
    FollowingSettings,
    assign_voxels,
    find_again,
    head_centre,
    let_go,
    let_go_things,
    locating_voxels,
    predict,
)
from hmc.tracking.blobs import Observation, blob_features
from hmc.tracking.cloud import Cloud, Departed
from hmc.tracking.furniture import Furniture, learn_furniture, part_of_furniture, without_furniture
from hmc.tracking.ghosts import real_people
from hmc.tracking.identity import exchange_mistaken, learn_looks, recognise
from hmc.tracking.lifecycle import (
    FORGIVEN,
    Candidate,
    Row,
    Track,
    confirm,
    delete,
    is_established,
    looks_like_person,
    looks_like_thing,
    propose,
    still_a_person,
)
from hmc.tracking.newcomers import newcomers, one_or_two
from hmc.tracking.things import came_out, left_behind, not_things

__all__ = ["Filter", "Filtered", "StepInfo", "TrackerState", "advance", "finish", "init", "original_number"]

#: Share of the room beyond which what is occupied cannot be people.
MOST_FILLED = 0.25
#: Someone who came is compared with those who left after this time, when their colours are known.
RECOGNISE_AFTER_S = 1.0
#: So near, seen from above, whoever pushes a chair is; metres.
BESIDE_M = 1.5


@dataclass(frozen=True)
class TrackerState:
    """A tracker between two frames.

    Attributes
    ----------
    fps : float
    tracks : tuple of Track
        Persons, by number.
    candidates : tuple of Candidate
    next_person : int
    clouds : tuple of Cloud
        One a track, in the same order, where a filter is used; else none.
    departed : tuple of Departed
        Those who left and whose colours are known.
    same : tuple of (int, int)
        Numbers of persons who came back, and the numbers that they had before.
    things : tuple of Row
        What was taken for people and still stands there.
    furniture : Furniture
        Voxels that were filled while nobody was near.
    """

    fps: float
    tracks: tuple[Track, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    next_person: int = 0
    clouds: tuple[Cloud, ...] = ()
    departed: tuple[Departed, ...] = ()
    same: tuple[tuple[int, int], ...] = ()
    things: tuple[Row, ...] = ()
    furniture: Furniture = field(default_factory=Furniture)


@dataclass(frozen=True)
class StepInfo:
    """What a step found beside the new state.

    Attributes
    ----------
    rows : tuple of Row
        New lines for the table: persons seen in this frame and earlier frames of persons confirmed in it.
    owners : ndarray of int, shape (n_voxels,)
        Person number of each voxel of the observation, or -1.
    shared : tuple of int
        Persons whose component holds another person too.
    color_s, filter_s : float
        Processor seconds spent on colouring voxels and on saying where the persons are.
    """

    rows: tuple[Row, ...]
    owners: np.ndarray
    shared: tuple[int, ...] = ()
    color_s: float = 0.0
    filter_s: float = 0.0


@dataclass(frozen=True)
class Filtered:
    """What a filter says.

    Attributes
    ----------
    positions : ndarray, shape (k, 3)
        Where each person is; where they should be, of a person of whom the filter saw nothing. World, metres.
    seen : ndarray of bool, shape (k,)
        Whether the filter saw the person.
    clouds : tuple of Cloud
    looks : tuple of ndarray
        Histogram of what each person looks like in this frame, empty where nothing is seen; empty where colours do not count.
    keep_histogram : float
        Share of the reference histogram that stays (Eq. 4.11).
    color_s : float
        Processor seconds spent on colouring voxels.
    efficiency : ndarray, shape (k,)
        Survival rate of each person's particles (Eq. 3.11), 0 to 1; empty where there are none.
    """

    positions: np.ndarray
    seen: np.ndarray
    clouds: tuple[Cloud, ...]
    looks: tuple[np.ndarray, ...] = ()
    keep_histogram: float = 1.0
    color_s: float = 0.0
    efficiency: np.ndarray = field(default_factory=lambda: np.zeros(0))


#: ``filter(state, predicted, observation)``: the state's tracks should be at ``predicted``, shape (k, 3).
Filter = Callable[[TrackerState, np.ndarray, Observation], Filtered]


def init(fps: float) -> TrackerState:
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
    return TrackerState(float(fps))


def advance(
    state: TrackerState, frame: int, observation: Observation | None, settings: FollowingSettings, filter: Filter | None = None
) -> tuple[TrackerState, StepInfo]:
    """One frame on.

    Parameters
    ----------
    state : TrackerState
    frame : int
        Absolute number; frames come in order.
    observation : Observation or None
        None where the frame tells nothing: every track waits. So it does when a quarter of the room is occupied (a light switch). An
        observation without voxels means that nobody is there.
    settings : FollowingSettings
    filter : callable, optional
        Says where each person is. Where left out, each is at the centroid of the voxels that they own.

    Returns
    -------
    state : TrackerState
    info : StepInfo
    """
    if observation is None or len(observation.points) * observation.voxel_size_m**3 > MOST_FILLED * np.ptp(observation.room, axis=0).prod():
        waiting = tuple(replace(track, last_frame=track.last_frame + 1, velocity=track.velocity * 0.5) for track in state.tracks)
        return replace(state, tracks=waiting), StepInfo((), np.full(0 if observation is None else len(observation.points), -1))
    whole = observation
    observation, kept_voxels = without_furniture(whole, state.furniture, state.fps)
    n, size = len(state.tracks), observation.voxel_size_m
    begun = thread_time()
    predicted = predict(state.tracks, state.fps)
    filtered = filter(state, predicted, observation) if filter else Filtered(predicted, np.zeros(n, bool), ())
    filter_s = thread_time() - begun - filtered.color_s
    positions = filtered.positions
    claimed, shared = assign_voxels(observation, positions, settings)
    kept, freed = let_go(observation, claimed, predicted, shared, settings)
    owners = find_again(state.tracks, frame, state.fps, observation, kept, settings)
    elsewhere = np.unique(owners[kept != owners])
    found = owners
    owners = let_go_things(observation, owners, shared, settings)
    owned = blob_features(observation.points, owners, n, size)
    best = locating_voxels(observation, owners, n, settings)
    located = blob_features(observation.points, np.where(best, owners, -1), n, size)
    if filter is None:
        filter_s = thread_time() - begun
    certain = blob_features(observation.points, np.where(observation.certain, owners, -1), n, size)
    supported = still_a_person(owned, certain, state.tracks, state.fps, settings.lifecycle)
    # Of a person who was found again elsewhere, the filter knows nothing; of one who held another it stands between the two.
    known = filtered.seen & ~np.isin(np.arange(n), [*freed, *elsewhere])
    measured = np.where(known[:, None], positions, located.centroid)
    gain = np.where(shared, np.where(known, settings.filter_gain, settings.shared_gain), 1.0)
    like = looks_like_person(owned, settings.lifecycle)
    tracks, rows = [], []
    for k, track in enumerate(state.tracks):
        if supported[k]:
            head = head_centre(observation.points[best & (owners == k)])
            moved = predicted[k] + gain[k] * (measured[k] - predicted[k])
            now = _update(track, frame, moved, gain[k], owned.volume_m3[k], head, bool(shared[k]), state.fps, settings)
            row = Row(frame, track.person, measured[k] if gain[k] == 1 or not known[k] else moved, head)
            held = (*track.doubtful, row)
            told = (like[k] and track.unlike <= FORGIVEN) or (
                is_established(track, state.fps, settings.lifecycle) and len(held) >= settings.lifecycle.unlike_s * state.fps
            )
            tracks.append(replace(now, doubtful=() if told else held))
            rows += [replace(one, person=track.person) for one in held] if told else []
        else:
            tracks.append(replace(track, position=predicted[k], velocity=track.velocity * 0.8))

    followed = tuple(tracks)
    clouds = tuple(cloud if known[k] else Cloud(cloud.person, histogram=cloud.histogram) for k, cloud in enumerate(filtered.clouds))
    if filtered.looks:
        followed, clouds, looks = exchange_mistaken(followed, clouds, filtered.looks)
        clouds = learn_looks(followed, clouds, looks, filtered.keep_histogram)
    strangers, parted, like_people = _newcomers(observation, found, tuple(freed.values()), frame, state, settings)
    candidates = propose(state.candidates, not_things(strangers, state.things, settings.lifecycle), followed, settings.lifecycle, parted)
    candidates, fresh, earlier = confirm(candidates, state.next_person, state.fps, settings.lifecycle)
    next_person = state.next_person + len(fresh)
    goes_on, earlier = came_out(followed, fresh, earlier, state.fps, observation.room, settings.lifecycle)
    up = {track.person: track for track in goes_on.values()}
    left = tuple(Row(frame, track.person, track.position, track.head) for track in followed if track.person in up)
    followed = tuple(up.get(track.person, track) for track in followed)
    clouds = tuple(Cloud(cloud.person, histogram=cloud.histogram) if cloud.person in up else cloud for cloud in clouds)
    fresh = tuple(track for track in fresh if track.person not in goes_on)
    # Where nothing is seen there is nothing to judge.
    verdicts = _by_person(state.tracks, like, supported & ~np.isin([track.person for track in state.tracks], list(up)))
    inert = _by_person(state.tracks, looks_like_thing(owned, settings.lifecycle), supported)
    working = _by_person(state.tracks, filtered.efficiency, np.ones(len(filtered.efficiency), bool))
    present, limits = (*followed, *fresh), settings.lifecycle
    staying = delete(present, frame, state.fps, observation.room, limits, like_person=verdicts, like_thing=inert, efficiency=working)
    things = left_behind(state.things + left, followed, staying, observation.points[owners < 0], state.fps, settings.lifecycle)
    numbers = np.array([*(track.person for track in state.tracks), -1])
    whose = np.full(len(whole.points), -1)
    whose[kept_voxels] = numbers[owners]
    info = StepInfo((*rows, *earlier), whose, tuple(int(number) for number in numbers[:-1][shared]), filtered.color_s, filter_s)
    there: tuple[Track | Row, ...] = (*staying, *(candidate.rows[-1] for candidate in candidates))
    people, heads = (np.array(places).reshape(-1, 3) for places in ([one.position for one in there], [one.head for one in there]))
    strange = np.zeros(len(whole.points), bool)
    strange[kept_voxels] = like_people
    furniture = learn_furniture(state.furniture, whole, people, heads, strange, state.fps)
    after = TrackerState(state.fps, staying, candidates, next_person, (), state.departed, state.same, things, furniture)
    return (_with_clouds(after, followed, clouds, frame) if filter else after), info


def _by_person(tracks: tuple[Track, ...], values: np.ndarray, told: np.ndarray) -> dict[int, Any]:
    """The values of those tracks of which something is told, by person number."""
    return {tracks[k].person: values[k].item() for k in np.flatnonzero(told)}


def _with_clouds(state: TrackerState, followed: tuple[Track, ...], clouds: tuple[Cloud, ...], frame: int) -> TrackerState:
    """The state with its tracks' clouds; those whose track ended have departed, and some who began lately had been there before."""
    memory = {cloud.person: cloud for cloud in clouds}
    present = {track.person for track in state.tracks}
    departed, same = state.departed, state.same
    for track in followed:
        look = memory[track.person].histogram
        if track.person not in present and look.size:
            departed += (Departed(original_number(same, track.person), look, track.last_frame),)
        elif look.size and frame - track.first_frame == round(RECOGNISE_AFTER_S * state.fps):
            before = recognise(look, track.first_frame, departed)
            if before is not None:
                same += ((track.person, before),)
                departed = tuple(one for one in departed if one.person != before)
    clouds = tuple(memory.get(track.person, Cloud(track.person)) for track in state.tracks)
    return replace(state, clouds=clouds, departed=departed, same=same)


def original_number(same: tuple[tuple[int, int], ...], person: int) -> int:
    """The number that a person who may have come back had at first.

    Parameters
    ----------
    same : tuple of (int, int)
        Of the last state.
    person : int
    """
    return dict(same).get(person, person)


def finish(state: TrackerState, n_frames: int, settings: FollowingSettings | None = None) -> tuple[Row, ...]:
    """Rows still to come when the recording is over.

    In a recording too short for any candidate to be confirmed, those seen in every frame are persons.

    Parameters
    ----------
    state : TrackerState
    n_frames : int
        Frames in the recording.
    settings : FollowingSettings, optional

    Returns
    -------
    tuple of Row
    """
    settings = FollowingSettings() if settings is None else settings
    short = replace(settings.lifecycle, confirm_frames=n_frames, confirm_s=0.0)
    doubtful = tuple(replace(row, person=track.person) for track in state.tracks for row in track.doubtful)
    if n_frames > max(settings.lifecycle.confirm_frames, round(settings.lifecycle.confirm_s * state.fps)):
        return doubtful
    return doubtful + tuple(confirm(state.candidates, state.next_person, state.fps, short)[2])


def _newcomers(
    observation: Observation,
    owners: np.ndarray,
    freed: tuple[np.ndarray, ...],
    frame: int,
    state: TrackerState,
    settings: FollowingSettings,
) -> tuple[list[Row], list[Row], np.ndarray]:
    """Where person-like sets of voxels are that no track owns and that are no ghosts, where people are whom a track let go, and whether
    each voxel is of a person-like set or ghost.
    """
    held = owners.copy()
    held[np.concatenate([np.zeros(0, int), *freed])] = 0
    sets = newcomers(observation, held, settings.lifecycle)
    sets = [rows for rows in sets if not part_of_furniture(observation.points[rows], observation, state.furniture, state.fps)]
    like_people = np.isin(np.arange(len(owners)), np.concatenate([np.zeros(0, int), *sets]))
    if sets and observation.views is not None:
        points = [observation.points[rows] for rows in sets]
        real = real_people(observation.views, observation.points[held >= 0], points, observation.voxel_size_m)
        sets = [rows for rows, one in zip(sets, real, strict=True) if one]
    sets = _solid_beside_solid(observation, owners, sets, state.tracks, settings)
    # Cut after the ghosts are out: of two who hold each other, one may hide the other in most views.
    sets = [part for rows in sets for part in one_or_two(observation, rows, settings.lifecycle)]
    person = np.full(len(owners), -1)
    for j, rows in enumerate((*sets, *freed)):
        person[rows] = j
    n = len(sets) + len(freed)
    best = locating_voxels(observation, person, n, settings)
    located = [observation.points[best & (person == j)] for j in range(n)]
    seen = [Row(frame, -1, points.mean(axis=0), head_centre(points)) for points in located]
    return seen[: len(sets)], seen[len(sets) :], like_people


def _solid_beside_solid(
    observation: Observation, owners: np.ndarray, sets: list[np.ndarray], tracks: tuple[Track, ...], settings: FollowingSettings
) -> list[np.ndarray]:
    """The sets without those that lack strict hull beside people who have it: all cameras see who pushes furniture, and the tolerant
    hull alone makes what looks like a person of the furniture.
    """
    least = settings.lifecycle.least_volume_m3 / observation.voxel_size_m**3
    counts = np.bincount(owners[observation.certain & (owners >= 0)], minlength=len(tracks))
    solid = np.array([track.position for track, count in zip(tracks, counts, strict=True) if count >= least]).reshape(-1, 3)

    def alone(rows: np.ndarray) -> bool:
        return not np.any(np.hypot(*(solid - observation.points[rows].mean(axis=0))[:, :2].T) <= BESIDE_M)

    return [rows for rows in sets if observation.certain[rows].sum() >= least or alone(rows)]


def _update(
    track: Track,
    frame: int,
    position: np.ndarray,
    gain: float,
    volume_m3: float,
    head: np.ndarray,
    shared: bool,
    fps: float,
    settings: FollowingSettings,
) -> Track:
    """The track after a measurement; what is measured with little gain changes the velocity little."""
    blend = gain * (1 - np.exp(-1 / (fps * settings.velocity_time_s)))
    velocity = track.velocity + blend * ((position - track.position) * fps - track.velocity)
    velocity = velocity * min(1.0, settings.most_speed_m_s / max(float(np.linalg.norm(velocity)), 1e-9))
    volume = float(volume_m3)
    if track.volume_m3 > 0:
        volume = track.volume_m3 if shared else track.volume_m3 + blend * (min(volume, 2 * track.volume_m3) - track.volume_m3)
    return replace(track, position=position, head=head, velocity=velocity, volume_m3=volume, last_frame=frame)
