"""The life of tracks as Canton (2009) prints it, and nothing of ours: Figure 4.1, sections 4.2.3 and 4.3.1.

A track has no motion model: it is looked for where it was. Its voxels are those in its region of influence and in no other's (Eq. 4.4 and
4.7). A connected component that the decision tree takes for a person, and that is not too close to a track, begins one at once; a track
ends that is too close to another, whose filter hardly finds anything, or whose voxels are no person for a number of frames. How close, how
little and how many are not printed: they are `least_distance_m`, `same_place_m`, `least_efficiency` with `efficiency_s`, and `unlike_s` of
`LifecycleSettings`.
Shown by tests/tracking/test_printed_rules.py.
"""

from __future__ import annotations

from dataclasses import replace
from time import thread_time

import numpy as np

from hmc.errors import InputError
from hmc.tracking.appearance import adapt
from hmc.tracking.association import head_centre
from hmc.tracking.blobs import Blobs, blob_features
from hmc.tracking.features import feature_matrix
from hmc.tracking.likeness import horizontal_distance
from hmc.tracking.person_tree import predict_person
from hmc.tracking.region import PERSON_RADIUS_M, region_distance
from hmc.tracking.rules.filtering import filter_at
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.state import Track, TrackRow
from hmc.tracking.update import FrameUpdate

__all__ = ["adapt_histograms", "begin_tracks", "claim_regions", "end_tracks", "filter_in_place", "move_tracks"]


def filter_in_place(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with the filter's estimate, of persons who are looked for where they were."""
    return filter_at(update, np.array([track.position for track in update.state.tracks]).reshape(-1, 3))


def claim_regions(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update in which each voxel is owned by the one person in whose region of influence it lies; by none where it lies in several."""
    centres = update.estimate.positions
    across = np.full((len(centres), 2), settings.enlarge_xy * PERSON_RADIUS_M)
    radii = np.column_stack([across, settings.enlarge_z * np.maximum(centres[:, 2], update.observation.voxel_size_m)])
    inside = region_distance(update.observation.points, centres, radii) <= 1
    # With one region its number is the sum of the numbers.
    owners = np.where(inside.sum(axis=1) == 1, inside @ np.arange(len(centres)), -1)
    return replace(update, owners=owners)


def move_tracks(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with each track where its filter says, or at the centroid of its voxels (Eq. 4.5); where it was, without either."""
    tracks = list[Track]()
    for k, track in enumerate(update.state.tracks):
        voxels = update.observation.points[update.owners == k]
        if update.estimate.seen[k]:
            track = replace(track, position=update.estimate.positions[k])
        elif len(voxels):
            track = replace(track, position=voxels.mean(axis=0))
        head = head_centre(voxels) if len(voxels) else track.head
        tracks.append(replace(track, head=head, last_frame=update.frame))
    rows = tuple(TrackRow(update.frame, track.person, track.position, track.head) for track in tracks)
    # Without a filter of its own, sharing out the voxels is what finds the people.
    filter_s = update.filter_s if update.filter else thread_time() - update.begun_s
    return replace(update, tracks=tuple(tracks), rows=rows, filter_s=filter_s)


def adapt_histograms(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with the reference histograms adapted to what everybody looks like now (Eq. 4.11)."""
    if not update.estimate.looks:
        return update
    pairs = zip(update.memories, update.estimate.looks, strict=True)
    return replace(
        update,
        memories=tuple(
            replace(one, histogram=adapt(one.histogram, look, update.estimate.keep_histogram)) if look.size else one for one, look in pairs
        ),
    )


def begin_tracks(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with a new track for each component that is a person and not too close to a track (section 4.2.3)."""
    observation = update.observation
    there, born = [track.position for track in update.tracks], list[Track]()
    for label in np.flatnonzero(_is_person(observation.blobs, settings)).tolist():
        place = observation.blobs.centroid[label]
        if all(horizontal_distance(place, other) >= settings.lifecycle.least_distance_m for other in there):
            head = head_centre(observation.points[observation.labels == label])
            person = update.state.next_person + len(born)
            born.append(Track(person, place, head, np.zeros(3), float(observation.blobs.volume_m3[label]), update.frame, update.frame))
            there.append(place)
    rows = tuple(TrackRow(update.frame, track.person, track.position, track.head) for track in born)
    return replace(update, born=tuple(born), born_rows=rows, next_person=update.state.next_person + len(born))


def end_tracks(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with the tracks that stay, by the three criteria of section 4.2.3; of two in one place the older."""
    limits, fps, kept = settings.lifecycle, update.state.fps, list[Track]()
    owned = blob_features(update.observation.points, update.owners, len(update.tracks), update.observation.voxel_size_m)
    person = _is_person(owned, settings)
    for k, track in enumerate(update.tracks):
        efficiency = float(update.estimate.efficiency[k]) if len(update.estimate.efficiency) else 1.0
        unlike = 0 if person[k] else track.unlike + 1
        inefficient = track.inefficient + 1 if efficiency < limits.least_efficiency else 0
        close = any(horizontal_distance(track.position, other.position) < limits.same_place_m for other in kept)
        if not close and unlike <= limits.unlike_s * fps and inefficient <= limits.efficiency_s * fps:
            kept.append(replace(track, unlike=unlike, inefficient=inefficient))
    alive = {track.person for track in kept}
    ended = tuple(track for track in update.tracks if track.person not in alive)
    return replace(update, tracks=(*kept, *update.born), ended=ended)


def _is_person(blobs: Blobs, settings: FollowingSettings) -> np.ndarray:
    """The verdict of the decision tree alone, shape (n,) bool.

    Raises
    ------
    InputError
        When the settings have no tree.
    """
    if settings.lifecycle.tree is None:
        raise InputError("the thesis's life of tracks needs a decision tree; give LifecycleSettings(person='tree')")
    return predict_person(settings.lifecycle.tree, feature_matrix(blobs)) & (blobs.counts > 0)
