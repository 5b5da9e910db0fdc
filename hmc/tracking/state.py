"""What a tracker knows between two frames: the tracks, the candidates, and what is remembered of people and of static objects.

Everything here is plain numbers and named arrays, which the journal keeps and restores without knowing what they are
(`hmc.tracking.stored`): a new tracker, or a new rule, needs no word of its own there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

__all__ = ["Candidate", "DepartedTrack", "PersonMemory", "StaticObjects", "Track", "TrackRow", "TrackerInfo", "TrackerState", "coasted"]

#: Time in which the velocity of a track of which nothing is told falls to 1/e, seconds: to .8 from frame to frame at 15 frames a second.
COASTING_S = 0.3


@dataclass(frozen=True)
class TrackRow:
    """Where a person is in a frame: one line of the table of tracks. Positions are world, metres."""

    frame: int
    person: int
    position: np.ndarray
    head: np.ndarray


@dataclass(frozen=True)
class Candidate:
    """A person-like set of voxels that may become a track.

    Attributes
    ----------
    rows : tuple of TrackRow
        Every frame in which it was seen; their person number has no meaning yet.
    missed : int
        Frames in which it was not.
    """

    rows: tuple[TrackRow, ...]
    missed: int = 0

    @property
    def velocity(self) -> np.ndarray:
        """Mean velocity over the frames seen, metres a frame, shape (3,)."""
        first, last = self.rows[0], self.rows[-1]
        return (last.position - first.position) / max(last.frame - first.frame, 1)


@dataclass(frozen=True)
class Track:
    """A person who is followed.

    Attributes
    ----------
    person : int
        Number, never used again.
    position, head : ndarray, shape (3,)
        Centroid and centre of the head, world, metres.
    velocity : ndarray, shape (3,)
        Smoothed, metres a second.
    volume_m3 : float
        Smoothed volume of the voxels owned while standing apart.
    body_m3 : float
        Smoothed volume of the strict hull while the voxels looked like a person and no other was near; 0 as long as nothing is known.
    first_frame, last_frame : int
        First frame seen and last frame with support.
    crowded : int
        Frames in a row in which another, older track stood in the same place.
    unlike : int
        Frames in which its voxels did not look like a person, less twice those since in which they did.
    liked : int
        Frames in which they did.
    inefficient : int
        Frames in a row in which hardly any of its filter's particles survived.
    still : int
        Frames in a row in which what it holds looked like an object and stayed near `rest`.
    rest : ndarray, shape (3,)
        Where it was when that began, world, metres.
    withheld : tuple of TrackRow
        Where it was in the last frames, as long as its voxels do not look like a person: told only when they do again, or when the
        track outlives the doubt.
    asked : bool
        Whether it was asked if this is somebody who had left.
    """

    person: int
    position: np.ndarray
    head: np.ndarray
    velocity: np.ndarray
    volume_m3: float
    first_frame: int
    last_frame: int
    crowded: int = 0
    unlike: int = 0
    liked: int = 0
    inefficient: int = 0
    still: int = 0
    rest: np.ndarray = field(default_factory=lambda: np.zeros(3))
    withheld: tuple[TrackRow, ...] = ()
    body_m3: float = 0.0
    asked: bool = False


def coasted(track: Track, fps: float) -> Track:
    """A track after a frame that tells nothing of it: moved on by its velocity, of which it keeps the less the longer nothing is told."""
    return replace(track, position=track.position + track.velocity / fps, velocity=track.velocity * np.exp(-1 / (COASTING_S * fps)))


@dataclass(frozen=True)
class PersonMemory:
    """What a filter remembers of one person.

    Attributes
    ----------
    person : int
    arrays : mapping of str to ndarray
        Whatever the filter wants from the last frame, by names of its own: particles and weights, a covariance, ... Empty where the
        filter has to begin anew: the person is new, was found elsewhere, or the filter lost them.
    histogram : ndarray, shape (n_colors,)
        Reference histogram of the person's colors, sums to 1; empty as long as nothing is known.
    """

    person: int
    arrays: Mapping[str, np.ndarray] = field(default_factory=dict)
    histogram: np.ndarray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class DepartedTrack:
    """A track that ended: the person's number, the last reference histogram, and the last frame in which they were seen."""

    person: int
    histogram: np.ndarray
    last_frame: int


@dataclass(frozen=True)
class StaticObjects:
    """Voxels that were filled while no person was near.

    Attributes
    ----------
    voxels : ndarray of int, shape (n,)
        Places in the flattened grid, ascending.
    frames : ndarray of int, shape (n,)
        In how many frames each was filled so, less those in which it was empty; counted up to what makes it static and a little more.
    """

    voxels: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    frames: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))


@dataclass(frozen=True)
class TrackerState:
    """A tracker between two frames.

    Attributes
    ----------
    fps : float
    tracks : tuple of Track
        By person number.
    candidates : tuple of Candidate
    next_person : int
    memories : tuple of PersonMemory
        One a track, in the same order.
    departed : tuple of DepartedTrack
        Tracks that ended, of persons whose colors are known.
    reidentified : tuple of (int, int)
        Numbers of persons who came back, and the numbers that they had before.
    false_tracks : tuple of TrackRow
        Where static objects stand that were tracked as people.
    static : StaticObjects
    arrays : mapping of str to ndarray
        Whatever a tracker of another kind remembers of the whole frame, by names of its own; the shared rules leave it as it is.
    most : int or None
        People who are there at once at most, where that is known (``persons`` in ``recording.toml``).
    """

    fps: float
    tracks: tuple[Track, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    next_person: int = 0
    memories: tuple[PersonMemory, ...] = ()
    departed: tuple[DepartedTrack, ...] = ()
    reidentified: tuple[tuple[int, int], ...] = ()
    false_tracks: tuple[TrackRow, ...] = ()
    static: StaticObjects = field(default_factory=StaticObjects)
    arrays: Mapping[str, np.ndarray] = field(default_factory=dict)
    most: int | None = None


@dataclass(frozen=True)
class TrackerInfo:
    """What a step found beside the new state.

    Attributes
    ----------
    rows : tuple of TrackRow
        New lines for the table: persons seen in this frame and earlier frames of persons confirmed in it.
    owners : ndarray of int, shape (n_voxels,)
        Person number of each voxel of the observation, or -1.
    shared : tuple of int
        Persons whose component holds another person too.
    color_s, filter_s : float
        Processor seconds spent on coloring voxels and on saying where the persons are.
    """

    rows: tuple[TrackRow, ...]
    owners: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    shared: tuple[int, ...] = ()
    color_s: float = 0.0
    filter_s: float = 0.0
