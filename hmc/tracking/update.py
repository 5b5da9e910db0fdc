"""What is known within one frame while the rules of `hmc.tracking.rules` are applied to it, one after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from hmc.tracking.blobs import Blobs, Observation, blob_features
from hmc.tracking.columns import Columns
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.state import Candidate, DepartedTrack, PersonMemory, StaticObjects, Track, TrackerInfo, TrackerState, TrackRow

__all__ = ["Filter", "FilterEstimate", "FrameUpdate", "Measurement", "Rule", "begin_update"]


@dataclass(frozen=True)
class FilterEstimate:
    """What a filter says.

    Attributes
    ----------
    positions : ndarray, shape (k, 3)
        Where each person is; where they should be, of a person of whom the filter saw nothing. World, metres.
    seen : ndarray of bool, shape (k,)
        Whether the filter saw the person.
    memories : tuple of PersonMemory
        What the filter wants to find again in the next frame, one a track; empty where it remembers nothing.
    looks : tuple of ndarray
        Histogram of what each person looks like in this frame, empty where nothing is seen; empty where colors do not count.
    keep_histogram : float
        Share of the reference histogram that stays (Eq. 4.11).
    color_s : float
        Processor seconds spent on coloring voxels.
    efficiency : ndarray, shape (k,)
        Survival rate of each person's particles (Eq. 3.11), 0 to 1; empty where there are none.
    """

    positions: np.ndarray
    seen: np.ndarray
    memories: tuple[PersonMemory, ...] = ()
    looks: tuple[np.ndarray, ...] = ()
    keep_histogram: float = 1.0
    color_s: float = 0.0
    efficiency: np.ndarray = field(default_factory=lambda: np.zeros(0))


#: ``filter(state, predicted, observation)``: the state's tracks should be at ``predicted``, shape (k, 3).
Filter = Callable[[TrackerState, np.ndarray, Observation], FilterEstimate]


@dataclass(frozen=True)
class Measurement:
    """What the owned voxels say of each of the k tracks.

    Attributes
    ----------
    locating : ndarray of bool, shape (n,)
        Voxels from which positions are taken (`hmc.tracking.association.locating_voxels`).
    owned, located, certain : Blobs
        Features of each track's voxels, of those of them that locate it, and of those in the strict hull.
    supported : ndarray of bool, shape (k,)
        Whether the voxels keep the track alive.
    like_person, like_object : ndarray of bool, shape (k,)
        Verdicts on them.
    same_body : ndarray of bool, shape (k,)
        Where the verdict for a person is by their volume alone: that of the body which looked like a person before.
    """

    locating: np.ndarray
    owned: Blobs
    located: Blobs
    certain: Blobs
    supported: np.ndarray
    like_person: np.ndarray
    like_object: np.ndarray
    same_body: np.ndarray


@dataclass(frozen=True)
class FrameUpdate:
    """What is known of a frame so far; each rule takes one and returns one that knows more.

    Arrays over voxels are of the n voxels of `observation`, arrays over tracks of the k tracks of `state`.

    Attributes
    ----------
    frame : int
    state : TrackerState
        Before the frame.
    filter : callable or None
        Says where each person is; without one, each is at the centroid of the voxels that they own.
    whole : Observation
        Everything that is occupied.
    observation : Observation
        The same without static objects.
    visible : ndarray of bool
        Which voxels of `whole` it has.
    predicted : ndarray, shape (k, 3)
        Where the persons should be, world, metres.
    estimate : FilterEstimate
    begun_s, filter_s : float
        Processor time when the filter began, and what it took, seconds.
    owners : ndarray of int, shape (n,)
        Row of the track that owns each voxel, or -1.
    shared : ndarray of bool, shape (k,)
        The person's component is another's too.
    columns : Columns
        The upright people of the frame.
    matched : ndarray of int, shape (k,)
        The column of each track, or -1.
    begins : ndarray of bool, shape (m,)
        Columns that may be of somebody whom no track has.
    pushed : ndarray of int, shape (n,)
        Row of the track whose person pushes or leans on the object of the voxel, or -1.
    measurement : Measurement
    tracks : tuple of Track
        By person number.
    memories : tuple of PersonMemory
        One a track.
    detections : tuple of ndarray of int
        Voxels of person-like sets that no track owns.
    births : tuple of TrackRow
        Where those detections are.
    upright_births : tuple of TrackRow
        Where the columns are that no track has.
    candidates : tuple of Candidate
    next_person : int
    born : tuple of Track
        Candidates that became persons in this frame.
    born_rows : tuple of TrackRow
        Where those were since they were first seen.
    ended : tuple of Track
        Tracks that were deleted in this frame.
    handed_over : tuple of int
        Persons whose track left the object that it stayed with and goes on with the person who got up from it.
    false_tracks : tuple of TrackRow
    rows : tuple of TrackRow
        New lines for the table, of the tracks that were there before.
    static : StaticObjects
    departed : tuple of DepartedTrack
    reidentified : tuple of (int, int)
        As in the state.
    """

    frame: int
    state: TrackerState
    filter: Filter | None
    whole: Observation
    observation: Observation
    visible: np.ndarray
    predicted: np.ndarray
    estimate: FilterEstimate
    owners: np.ndarray
    shared: np.ndarray
    pushed: np.ndarray
    measurement: Measurement
    tracks: tuple[Track, ...]
    memories: tuple[PersonMemory, ...]
    candidates: tuple[Candidate, ...]
    next_person: int
    false_tracks: tuple[TrackRow, ...]
    static: StaticObjects
    departed: tuple[DepartedTrack, ...]
    reidentified: tuple[tuple[int, int], ...]
    columns: Columns = field(default_factory=Columns)
    matched: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    begins: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    detections: tuple[np.ndarray, ...] = ()
    births: tuple[TrackRow, ...] = ()
    upright_births: tuple[TrackRow, ...] = ()
    born: tuple[Track, ...] = ()
    born_rows: tuple[TrackRow, ...] = ()
    handed_over: tuple[int, ...] = ()
    ended: tuple[Track, ...] = ()
    rows: tuple[TrackRow, ...] = ()
    begun_s: float = 0.0
    filter_s: float = 0.0

    @property
    def newcomers(self) -> tuple[np.ndarray, ...]:
        """Voxels of each column that no track has, and at which one may begin."""
        return tuple(voxels for j, voxels in enumerate(self.columns.voxels) if self.begins[j] and j not in self.matched)

    @property
    def claimed(self) -> np.ndarray:
        """Row of the track whose person holds each voxel, as a part of the body or not, or -1; shape (n,)."""
        return np.maximum(self.owners, self.pushed)

    def after(self) -> TrackerState:
        """The state after the frame."""
        known = {memory.person: memory for memory in self.memories}
        return replace(
            self.state,
            tracks=self.tracks,
            candidates=self.candidates,
            next_person=self.next_person,
            memories=tuple(known.get(track.person, PersonMemory(track.person)) for track in self.tracks),
            departed=self.departed,
            reidentified=self.reidentified,
            false_tracks=self.false_tracks,
            static=self.static,
        )

    def info(self) -> TrackerInfo:
        """What was found in the frame."""
        persons = np.array([*(track.person for track in self.state.tracks), -1])
        owners = np.full(len(self.whole.points), -1)
        owners[self.visible] = persons[self.owners]
        shared = tuple(int(person) for person in persons[:-1][self.shared])
        return TrackerInfo((*self.rows, *self.born_rows), owners, shared, self.estimate.color_s, self.filter_s)


#: What is done with a frame, one after the other: ``rule(update, settings)`` returns the update with what it found.
Rule = Callable[[FrameUpdate, FollowingSettings], FrameUpdate]


def begin_update(state: TrackerState, frame: int, observation: Observation, filter: Filter | None) -> FrameUpdate:
    """A frame of which nothing is known yet but what is occupied."""
    n, k = len(observation.points), len(state.tracks)
    persons, voxels, positions = np.zeros(k, bool), np.zeros(n, bool), np.array([one.position for one in state.tracks]).reshape(-1, 3)
    memories = state.memories or tuple(PersonMemory(track.person) for track in state.tracks)
    no_blobs = blob_features(observation.points[:0], np.zeros(0, int), k, observation.voxel_size_m)
    return FrameUpdate(
        frame=frame,
        state=state,
        filter=filter,
        whole=observation,
        observation=observation,
        visible=~voxels,
        predicted=positions,
        estimate=FilterEstimate(positions, persons),
        owners=np.full(n, -1),
        shared=persons,
        pushed=np.full(n, -1),
        matched=np.full(k, -1),
        measurement=Measurement(voxels, no_blobs, no_blobs, no_blobs, persons, persons, persons, persons),
        tracks=state.tracks,
        memories=memories,
        candidates=state.candidates,
        next_person=state.next_person,
        false_tracks=state.false_tracks,
        static=state.static,
        departed=state.departed,
        reidentified=state.reidentified,
    )
