"""Creation and deletion of tracks, whatever filter follows the tracks in between.

A person-like set of voxels that no track owns becomes a candidate. A candidate that was seen in enough frames becomes a person,
from the first frame in which it was seen. A track whose voxels have not looked like a person for a while is deleted, and so is
the younger of two tracks that stand in one place, and one whose filter hardly finds anything any more. Source: Canton (2009), Figure
4.1 and section 4.2.3. What looks like a person is decided by a trained tree (Table 4.1, Figure 4.4) or by rules written by hand.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hmc.tracking.blobs import Blobs
from hmc.tracking.features import feature_matrix
from hmc.tracking.person_tree import PersonTree, default_tree, predict_person, read_tree

__all__ = [
    "Candidate",
    "LifecycleSettings",
    "Row",
    "Track",
    "confirm",
    "delete",
    "is_established",
    "looks_like_person",
    "looks_like_thing",
    "propose",
    "still_a_person",
]


#: A verdict for a person makes up for so many against.
FORGIVEN = 2
#: Somebody who lies flat has at least this share of their usual volume; less, so low, is what is left where somebody went.
LYING_SHARE = 0.5


@dataclass(frozen=True)
class LifecycleSettings:
    """When a set of voxels is a person, and how long it takes to come and go.

    Attributes
    ----------
    person : str
        What decides whether a set of voxels looks like a person: "rules", the limits from `least_top_m` to `least_side_m` alone; "tree",
        the decision tree that comes with the package, within these limits; or the path of a tree of the user's own
        (`hmc.tracking.train_person_tree`), within them too.
    least_top_m, most_top_m : float
        Height of the highest point of a person who appears: bent down or on the knees, and with a hand up.
    least_height_m : float
        Least extent from lowest to highest point: no table top, no shadow.
    most_bottom_m : float
        Furniture may hide the legs, but nobody floats higher than this.
    least_volume_m3, most_volume_m3 : float
        A hull is fatter than its person; the most leaves room for two who come in arm in arm.
    least_joined_m3 : float
        A set larger than this may be several people; so may one of which the strict hull is.
    most_side_m, least_side_m : float
        Longest horizontal side (arms stretched out) and least value of the longer side (a ghost is a thin column).
    keep_volume_m3, keep_top_m : float
        What is enough of the strict hull for a person who is tracked already.
    keep_share : float
        And what share of the person's usual volume.
    confirm_s, confirm_frames : float, int
        A candidate becomes a person after this time and at least this many frames.
    patience_s, edge_patience_s : float
        A track is deleted after this time without support; the second holds for people who were last seen at the edge of the room.
    edge_m : float
        Width of that edge.
    unlike_s : float
        A track is deleted when its voxels have not looked like a person for so long, however many they are: furniture that somebody left
        behind (Canton, section 4.2.3, third criterion of deletion). A frame in which they do makes up for two in which they do not.
    established_s : float
        A track whose voxels have looked like a person for so long altogether is one, whatever they look like now: people sit on the floor,
        lie and crouch. Verdicts do not end it (beyond the thesis).
    still_s, still_m : float
        But it ends when what it holds has looked like a thing and has not moved by more than this for so long (beyond the thesis).
    least_lying_m : float
        Things that people leave behind are not as long as what is seen of somebody who lies.
    least_efficiency, efficiency_s : float
        A track is deleted when the survival rate of its filter's particles (Canton, Eq. 3.11) has been below this share for so long
        (section 4.2.3, second criterion). Of Sparse Sampling, the share of the samples that found a voxel of their own.
    least_distance_m : float
        No candidate nearer to a track than this, horizontally (section 4.2.3, criterion of creation).
    same_place_m, same_place_s : float
        Two tracks nearer than this for so long follow one person; the younger is deleted (section 4.2.3, first criterion of deletion).
    fragment_gap_m : float
        Unowned pieces that stand nearer than this, seen from above, are judged together.
    tree : PersonTree or None
        What `person` names; None for "rules". Not to be given.
    """

    person: str = "tree"
    least_top_m: float = 0.9
    most_top_m: float = 2.6
    least_height_m: float = 0.6
    most_bottom_m: float = 0.9
    least_volume_m3: float = 0.025
    most_volume_m3: float = 0.7
    least_joined_m3: float = 0.2
    most_side_m: float = 2.2
    least_side_m: float = 0.25
    keep_volume_m3: float = 0.012
    keep_top_m: float = 0.4
    keep_share: float = 0.2
    confirm_s: float = 0.3
    confirm_frames: int = 4
    patience_s: float = 1.0
    edge_patience_s: float = 0.3
    edge_m: float = 0.3
    unlike_s: float = 2.0
    established_s: float = 3.0
    still_s: float = 8.0
    still_m: float = 0.06
    least_lying_m: float = 0.95
    least_efficiency: float = 0.05
    efficiency_s: float = 1.0
    least_distance_m: float = 0.45
    same_place_m: float = 0.2
    same_place_s: float = 0.5
    fragment_gap_m: float = 0.2
    tree: PersonTree | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        if self.person != "rules":
            object.__setattr__(self, "tree", default_tree() if self.person == "tree" else read_tree(self.person))


@dataclass(frozen=True)
class Row:
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
    rows : tuple of Row
        Every frame in which it was seen; their person number has no meaning yet.
    missed : int
        Frames in which it was not.
    """

    rows: tuple[Row, ...]
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
        Frames in a row in which what it holds looked like a thing and stayed near `rest`.
    rest : ndarray, shape (3,)
        Where it was when that began, world, metres.
    doubtful : tuple of Row
        Where it was in the last frames, as long as its voxels do not look like a person: told only when they do again, or when the
        track outlives the doubt.
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
    doubtful: tuple[Row, ...] = ()


def looks_like_person(blobs: Blobs, settings: LifecycleSettings) -> np.ndarray:
    """Which sets of voxels may be a person who appears; shape (n,) bool. For people who stand, bend, kneel or sit.

    All must be within the settings' limits, and the tree, where there is one, decides what of that is people: groups of fragments and
    noise are unlike anything that it has seen.
    """
    longer = blobs.sides_m[:, 0]
    top, bottom = blobs.top_m, blobs.lowest[:, 2]
    possible = (
        (top >= settings.least_top_m)
        & (top <= settings.most_top_m)
        & (blobs.height_m >= settings.least_height_m)
        & (bottom <= settings.most_bottom_m)
        & (blobs.volume_m3 >= settings.least_volume_m3)
        & (blobs.volume_m3 <= settings.most_volume_m3)
        & (longer >= settings.least_side_m)
        & (longer <= settings.most_side_m)
    )
    return possible if settings.tree is None else possible & predict_person(settings.tree, feature_matrix(blobs))


def still_a_person(owned: Blobs, certain: Blobs, tracks: tuple[Track, ...], fps: float, settings: LifecycleSettings) -> np.ndarray:
    """Which tracks the voxels that they own keep alive.

    Enough of the strict hull does, or a set that looks like a person as a whole (whom one camera cannot see), but not a remnant of what
    the track was: remnants stay behind where somebody leaves the room.

    Parameters
    ----------
    owned, certain : Blobs
        Features of each track's voxels, and of those in the strict hull.
    tracks : tuple of Track
    fps : float
    settings : LifecycleSettings

    Returns
    -------
    ndarray of bool, shape (n_tracks,)
    """
    usual = np.array([track.volume_m3 for track in tracks])
    established = np.array([is_established(track, fps, settings) for track in tracks], bool)
    low = established & (owned.volume_m3 >= LYING_SHARE * usual)
    solid = (certain.volume_m3 >= settings.keep_volume_m3) & ((certain.top_m >= settings.keep_top_m) | low)
    return (solid | looks_like_person(owned, settings)) & (owned.volume_m3 >= settings.keep_share * usual)


def looks_like_thing(blobs: Blobs, settings: LifecycleSettings) -> np.ndarray:
    """Which sets of voxels may be a chair or the like that somebody left behind; shape (n,) bool.

    They do not look like a person and are lower than one who appears; people who sit on the floor or crouch may be so too, but they
    move, and somebody who lies is longer.
    """
    return ~looks_like_person(blobs, settings) & (blobs.top_m < settings.least_top_m + 0.1) & (blobs.sides_m[:, 0] < settings.least_lying_m)


def propose(
    candidates: tuple[Candidate, ...], seen: list[Row], tracks: tuple[Track, ...], settings: LifecycleSettings, parted: Sequence[Row] = ()
) -> tuple[Candidate, ...]:
    """Carry the candidates on with what was seen in this frame, nearest pairs first, and start new ones.

    Parameters
    ----------
    candidates : tuple of Candidate
    seen : list of Row
        Person-like sets of voxels of this frame that no track owns.
    tracks : tuple of Track
        Nothing of what was seen nearer to one of these than `least_distance_m` is a candidate.
    settings : LifecycleSettings
    parted : sequence of Row
        People whom a track let go (`hmc.tracking.association.let_go`): candidates, however near they are.

    Returns
    -------
    tuple of Candidate
        Those missed more often than seen are gone.
    """
    apart = [row for row in seen if all(_gap(row.position, track.position) >= settings.least_distance_m for track in tracks)]
    apart += parted
    pairs = sorted(
        (distance, c, s)
        for c, candidate in enumerate(candidates)
        for s, row in enumerate(apart)
        if (distance := _gap(row.position, _expected(candidate, row.frame))) <= 2 * settings.least_distance_m
    )
    match: dict[int, int] = {}
    for _, c, s in pairs:
        if c not in match and s not in match.values():
            match[c] = s
    kept = [
        replace(candidate, rows=(*candidate.rows, apart[match[c]])) if c in match else replace(candidate, missed=candidate.missed + 1)
        for c, candidate in enumerate(candidates)
    ]
    fresh = [Candidate((row,)) for s, row in enumerate(apart) if s not in match.values()]
    return tuple(candidate for candidate in kept if candidate.missed <= len(candidate.rows)) + tuple(fresh)


def confirm(
    candidates: tuple[Candidate, ...], next_person: int, fps: float, settings: LifecycleSettings
) -> tuple[tuple[Candidate, ...], tuple[Track, ...], list[Row]]:
    """Make persons of the candidates that were seen in enough frames.

    Returns
    -------
    candidates : tuple of Candidate
        The others.
    tracks : tuple of Track
        New ones, numbered from `next_person`.
    rows : list of Row
        Their positions from the first frame in which each was seen.
    """
    needed = max(settings.confirm_frames, round(settings.confirm_s * fps))
    left: list[Candidate] = []
    tracks: list[Track] = []
    rows: list[Row] = []
    for candidate in candidates:
        if len(candidate.rows) < needed:
            left.append(candidate)
            continue
        person = next_person + len(tracks)
        first, last = candidate.rows[0], candidate.rows[-1]
        tracks.append(Track(person, last.position, last.head, candidate.velocity * fps, 0.0, first.frame, last.frame))
        rows += [replace(row, person=person) for row in candidate.rows]
    return tuple(left), tuple(tracks), rows


def delete(
    tracks: tuple[Track, ...],
    frame: int,
    fps: float,
    room: np.ndarray,
    settings: LifecycleSettings,
    *,
    like_person: Mapping[int, bool] | None = None,
    like_thing: Mapping[int, bool] | None = None,
    efficiency: Mapping[int, float] | None = None,
) -> tuple[Track, ...]:
    """The tracks that stay: supported lately, not standing where an older one stands, and doing well.

    Parameters
    ----------
    tracks : tuple of Track
    frame : int
    fps : float
    room : ndarray, shape (2, 3)
        Lowest and highest corner of the grid, metres.
    settings : LifecycleSettings
    like_person : mapping of int to bool, optional
        By person number, whether the voxels of the track looked like a person in this frame (`looks_like_person`). Who is left out is
        not judged, and keeps the count of bad frames.
    like_thing : mapping of int to bool, optional
        The same of `looks_like_thing`; who is left out does not.
    efficiency : mapping of int to float, optional
        By person number, the share of the filter's particles that survive, in [0, 1]; for trackers that have particles.

    Returns
    -------
    tuple of Track
        By person.
    """
    kept: list[Track] = []
    for track in sorted(tracks, key=lambda track: track.person):
        inside = np.all((track.position > room[0] + settings.edge_m)[:2] & (track.position < room[1] - settings.edge_m)[:2])
        if frame - track.last_frame > (settings.patience_s if inside else settings.edge_patience_s) * fps:
            continue
        near = any(_gap(track.position, older.position) < settings.same_place_m for older in kept)
        crowded = track.crowded + 1 if near else 0
        unlike, liked, inefficient = track.unlike, track.liked, track.inefficient
        if like_person is not None and track.person in like_person:
            like = like_person[track.person]
            unlike, liked = max(unlike - FORGIVEN, 0) if like else unlike + 1, liked + like
        if is_established(track, fps, settings):
            unlike = min(unlike, int(settings.unlike_s * fps))
        if efficiency is not None and track.person in efficiency:
            inefficient = inefficient + 1 if efficiency[track.person] < settings.least_efficiency else 0
        rests = bool(like_thing and like_thing.get(track.person)) and _gap(track.position, track.rest) <= settings.still_m
        still, rest = (track.still + 1, track.rest) if rests else (0, track.position)
        counts = (crowded, unlike, inefficient, still)
        limits = (settings.same_place_s, settings.unlike_s, settings.efficiency_s, settings.still_s)
        if all(count <= limit * fps for count, limit in zip(counts, limits, strict=True)):
            kept.append(replace(track, crowded=crowded, unlike=unlike, liked=liked, inefficient=inefficient, still=still, rest=rest))
    return tuple(kept)


def is_established(track: Track, fps: float, settings: LifecycleSettings) -> bool:
    """Whether a track has looked like a person for so long that it is one."""
    return track.liked >= settings.established_s * fps


def _expected(candidate: Candidate, frame: int) -> np.ndarray:
    last = candidate.rows[-1]
    return last.position + candidate.velocity * (frame - last.frame)


def _gap(a: np.ndarray, b: np.ndarray) -> float:
    """Horizontal distance, metres."""
    return float(np.hypot(*(a - b)[:2]))
