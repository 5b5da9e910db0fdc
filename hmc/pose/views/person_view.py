"""What one frame shows of one person: everything that a pose method may read of a frame, in crops around the person.

A frame of hulls is labelled once and its voxels are shared out among the people once (`views_of`), by the rule of the trackers' `default`
whichever tracker found the people; what each method needs is made of that.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from hmc.errors import InputError
from hmc.io.recording import Recording
from hmc.io.results import TrackTable
from hmc.pose.spectral.graph import color_votes, face_neighbours
from hmc.pose.views.hull_target import HullTarget, make_target, sound_hull
from hmc.pose.views.keypoints import SeenKeypoints
from hmc.pose.views.markers import SeenMarkers
from hmc.pose.views.rays import with_rays
from hmc.pose.views.skin import Skin, observe_voxels
from hmc.pose.views.uncovered import on_uncovered_pixels
from hmc.tracking.resumable import observe_step
from hmc.tracking.tracks import person_voxels
from hmc.voxels.grid import VoxelGrid, voxels_of
from hmc.voxels.hulls import HullStep

__all__ = ["EVIDENCE", "HULLS_FOR", "IMAGES_FOR", "PersonView", "VoxelView", "check_needs", "views_of"]

#: What a method may need of a frame: the hulls and the rays of the silhouettes; the colored surface and the images around it; the voxels
#: with the votes of their colors; the detections of markers; the keypoints of a detector.
EVIDENCE = ("hulls", "skin", "voxels", "detections", "keypoints")
#: For these the images are read too.
IMAGES_FOR = frozenset({"skin", "voxels"})
#: For these silhouettes are carved.
HULLS_FOR = frozenset({"hulls", "skin", "voxels"})
#: Of so few cameras, hulls in which one or two may miss are mostly no person: they count only where silhouettes ask for them. Of more, they
#: are little fatter than the strict one, and hold what furniture hides without silhouettes that would ask for it.
FEW_CAMERAS = 4


@dataclass(frozen=True)
class VoxelView:
    """A person's voxels.

    Parameters
    ----------
    voxels : ndarray of int, shape (n, 3)
    points : ndarray, shape (n, 3)
        Their centres, world, metres.
    voxel_size_m : float
    votes : tuple of ndarray, optional
        Of their colors (`hmc.pose.spectral.graph.color_votes`).
    """

    voxels: np.ndarray
    points: np.ndarray
    voxel_size_m: float
    votes: tuple[np.ndarray, np.ndarray] | None = None


@dataclass(frozen=True)
class PersonView:
    """What one frame shows of one person; what a method does not need, and what nothing shows, is None.

    Parameters
    ----------
    frame : int
        Absolute number.
    target : HullTarget or None
        Hulls and rays.
    skin : Skin or None
        Surface voxels with their colors, and the images around them.
    voxels : VoxelView or None
        Of the strict hull, or of the tolerant one where a camera lost the person.
    markers : SeenMarkers or None
    keypoints : SeenKeypoints or None
    velocity : ndarray, shape (3,)
        Of the person's track, metres a second.
    """

    frame: int = 0
    target: HullTarget | None = None
    skin: Skin | None = None
    voxels: VoxelView | None = None
    markers: SeenMarkers | None = None
    keypoints: SeenKeypoints | None = None
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))


def check_needs(needs: Collection[str]) -> frozenset[str]:
    """What a method needs, as a set.

    Raises
    ------
    InputError
        When it is not among `EVIDENCE`.
    """
    unknown = [name for name in needs if name not in EVIDENCE]
    if unknown:
        raise InputError(f"a pose method may need {', '.join(EVIDENCE)}; got {unknown[0]!r}")
    return frozenset(needs)


def views_of(
    recording: Recording,
    grid: VoxelGrid,
    tracks: TrackTable,
    hull: HullStep,
    needs: Collection[str] = ("hulls",),
    unseen: np.ndarray | None = None,
) -> dict[int, PersonView]:
    """What a frame shows of every person who is tracked in it.

    Parameters
    ----------
    recording : Recording
    grid : VoxelGrid
    tracks : TrackTable
    hull : HullStep
    needs : collection of str
        Of `EVIDENCE`, without detections and keypoints.
    unseen : ndarray of int, shape (k, 3), optional
        Voxels where the scene hides people (`hmc.pose.occluders.unseen_voxels`).

    Returns
    -------
    dict of int to PersonView
        By person; velocities are zero.
    """
    rows = np.flatnonzero(tracks.frames == hull.index)
    persons = tracks.persons[rows].tolist()
    observation = observe_step(recording, grid, hull) if persons else None
    if observation is None:
        return {person: PersonView(hull.index) for person in persons}
    tolerant = person_voxels(observation, tracks.positions[rows])
    strict = [voxels[hull.strict[tuple(voxels.T)]] for voxels in tolerant]
    targets: list[HullTarget | None] = [None] * len(persons)
    if "hulls" in needs:
        targets = _targets(recording, grid, hull, strict, tolerant, unseen)
    return {
        person: PersonView(hull.index, target, *_voxels_and_skin(recording, grid, hull, own, fat, needs))
        for person, target, own, fat in zip(persons, targets, strict, tolerant, strict=True)
    }


def _targets(recording, grid, hull, strict, tolerant, unseen) -> list[HullTarget | None]:
    """Every person's hulls and rays. The tolerant hull is shared out among the people; what nobody got, and the rest of the loose one, may
    be any person's: a hand beyond a sleeve that is lost is a piece of its own."""
    spare, floor_z = hull.loose.copy(), float(recording.room[0, 2])
    nothing = np.zeros((0, 3), int)
    spare[tuple(np.concatenate([nothing, *tolerant]).T)] = False
    new = None
    if sum(mask is not None for mask in hull.masks) <= FEW_CAMERAS:
        all_strict = grid.centres(np.concatenate([nothing, *strict]))
        new = partial(on_uncovered_pixels, recording.rig, hull.masks, all_strict, spacing_m=grid.voxel_size_m)
    if hull.doubted is not None:  # a camera that only doubts a place knows as little of it as one from which it is hidden
        unseen = np.concatenate([nothing if unseen is None else unseen, voxels_of(hull.doubted & ~hull.strict)])
    targets = []
    for k in range(len(strict)):
        target = make_target(grid, strict[k], tolerant[k], spare, floor_z, new, unseen)
        if target is not None:
            others = grid.centres(np.concatenate([nothing, *strict[:k], *strict[k + 1 :]]))
            target = with_rays(target, recording.rig, hull.masks, others)
        targets.append(target)
    return targets


def _voxels_and_skin(recording, grid, hull, strict, tolerant, needs) -> tuple[Skin | None, VoxelView | None]:
    """One person's colored surface and voxels, where they are needed and there are any."""
    own = sound_hull(strict, tolerant)
    skin = voxels = None
    if len(own) and "skin" in needs:
        occupied = hull.strict if own is strict else hull.tolerant
        skin = observe_voxels(grid, recording.rig, occupied, own, hull.images, hull.masks)
    if len(own) and "voxels" in needs:
        votes = color_votes(face_neighbours(own), own, grid, recording.rig, hull.images)
        voxels = VoxelView(own, grid.centres(own), grid.voxel_size_m, votes)
    return skin, voxels
