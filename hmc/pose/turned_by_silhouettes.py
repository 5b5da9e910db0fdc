"""Cameras that have turned since they were calibrated, as silhouettes tell: by where those of each pair of cameras end.

People's silhouettes in two cameras end at the same two planes through both (`hmc.camera.tangency`), whatever the people look like: two
distances a pair and frame, and no hull that one camera has cut short. A frame in which a camera does not show everybody does not count for
it; furniture, shadows and what segmentation loses are mended by no turn. Planes through cameras at one height touch heads and soles, and
tell little of what is to the side; so cameras that are turned back have to leave a larger hull too: the right ones leave the largest.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import cv2
import numpy as np

from hmc.camera.model import Camera, Rig, project
from hmc.camera.tangency import Outlines, convex_outline, tangent_misses
from hmc.camera.turned_cameras import LEAST_CAMERAS, TurnedCamera, farthest_off_first, fitted_turn, turn_back, with_turns
from hmc.io.masks import MaskStep, kept_frames
from hmc.io.recording import Recording, spread_frames
from hmc.io.results import TrackTable
from hmc.processes import each_ahead
from hmc.voxels.carving import carve, make_tables
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.run_options import RunOptions

__all__ = ["people_outlines", "turned_by_silhouettes"]

#: Frames that are asked, at most, well spread; and so many planes that touch what a camera shows tell.
FRAMES, LEAST_PLANES = 40, 60
#: A camera has turned that is off by more than this, metres, in the median of its planes, and by no more than the second when it is turned
#: back: one that is late is mended in part. Of well calibrated rigs it is 1 to 5 mm, where furniture hides somebody or segmentation loses
#: clothes up to 8, which no turn mends. A plane that is off by more than the third counts ever less.
OFF_M, LEFT_M, WIDE_M = 0.006, 0.012, 0.01
#: Frames of these whose hulls are carved, the side of their voxels, and how far around people they reach, metres.
HULL_FRAMES, VOXEL_M, AROUND_M = 10, 0.05, 1.2
#: Above and below the middle of a tracked person, metres, a silhouette on the line between is theirs.
REACH_M, STEPS = 0.4, 9


def turned_by_silhouettes(recording: Recording, tracks: TrackTable, run: RunOptions) -> list[TurnedCamera]:
    """Which cameras have turned since they were calibrated, and how, as the silhouettes that a run kept tell.

    Parameters
    ----------
    recording : Recording
    tracks : TrackTable
        Which silhouettes are people is told by where they are tracked.
    run : RunOptions

    Returns
    -------
    list of TurnedCamera
        The one that is farthest off first; empty where too few cameras tell, or silhouettes were not kept.
    """
    if len(recording.rig) < LEAST_CAMERAS or run.masks is None or not len(tracks.frames):
        return []
    masks, frames = run.masks, spread_frames(np.unique(tracks.frames), FRAMES)
    if kept_frames(masks, run.key, frames) is None:
        return []

    def outlined(some: Sequence[int]) -> Iterator[list[tuple[np.ndarray, np.ndarray]]]:
        for step in kept_frames(masks, run.key, some) or ():
            yield people_outlines(recording.rig, tracks.at(step.index), step)

    middles = np.array([np.mean(list(tracks.at(frame).values()), axis=0) for frame in frames])
    found = _turned(recording.rig, _together(list(each_ahead(outlined, frames, run.workers)), middles))
    if not found:
        return []
    some = spread_frames(np.array(frames), HULL_FRAMES)
    room = _around(recording.room, tracks.positions[np.isin(tracks.frames, some)])
    rigs = recording.rig, turn_back(recording.rig, {one.name: one.turn for one in found})
    before, after = (_hull_voxels(rig, room, kept_frames(masks, run.key, some) or ()) for rig in rigs)
    return found if after > before else []


def people_outlines(rig: Rig, people: dict[int, np.ndarray], step: MaskStep) -> list[tuple[np.ndarray, np.ndarray]]:
    """The convex outline of all people in each camera, as of `hmc.camera.tangency.convex_outline`; empty where one of them is not shown.

    Parameters
    ----------
    rig : Rig
    people : dict of int to ndarray, shape (3,)
        Where each is, metres.
    step : MaskStep
    """
    return [_outline(camera, people.values(), mask) for camera, mask in zip(rig, step.masks, strict=True)]


def _outline(camera: Camera, people: Iterable[np.ndarray], mask: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    nothing = np.empty((0, 3)), np.empty(0, bool)
    if mask is None:
        return nothing
    n, blobs = cv2.connectedComponents(mask.view(np.uint8))
    theirs = np.zeros(n, bool)
    for middle in people:
        line = middle + np.linspace(-REACH_M, REACH_M, STEPS)[:, None] * (0.0, 0.0, 1.0)
        pixels, before = project(camera, line)
        column, row = np.round(np.where(before[:, None], pixels, -1)).astype(int).T
        seen = (row >= 0) & (row < mask.shape[0]) & (column >= 0) & (column < mask.shape[1])
        own = blobs[row[seen], column[seen]]
        if not own.any():
            return nothing
        theirs[own] = True
    theirs[0] = False
    return convex_outline(camera, theirs[blobs])


def _together(of_frames: list[list[tuple[np.ndarray, np.ndarray]]], middles: np.ndarray) -> Outlines:
    """Outlines of all frames in one array."""
    most = max(len(inside) for of_cameras in of_frames for _, inside in of_cameras)
    shape = (len(of_frames), len(of_frames[0]), max(most, 1))
    rays, whole = np.full((*shape, 3), np.nan), np.zeros(shape, bool)
    for f, of_cameras in enumerate(of_frames):
        for c, (directions, inside) in enumerate(of_cameras):
            rays[f, c, : len(inside)], whole[f, c, : len(inside)] = directions, inside
    return Outlines(rays, whole, middles)


def _around(room: np.ndarray, places: np.ndarray) -> np.ndarray:
    """The part of a room, (2, 3) metres, in which people at these places are, from floor to ceiling."""
    low, high = np.maximum(room[0], places.min(axis=0) - AROUND_M), np.minimum(room[1], places.max(axis=0) + AROUND_M)
    return np.array([[*low[:2], room[0, 2]], [*high[:2], room[1, 2]]])


def _hull_voxels(rig: Rig, room: np.ndarray, steps: Iterable[MaskStep]) -> int:
    """Voxels of the hulls of all frames together."""
    tables = make_tables(VoxelGrid.from_room(room, VOXEL_M, len(rig)), rig)
    return sum(int(carve(tables, step.masks).sum()) for step in steps)


def _turned(rig: Rig, outlines: Outlines) -> list[TurnedCamera]:
    def missed(c: int, others: Iterable[int], rays: np.ndarray) -> np.ndarray:
        return tangent_misses(rig.centres, replace(outlines, rays=rays), [(c, other) for other in others if other != c])

    telling = [c for c in range(len(rig)) if np.isfinite(missed(c, range(len(rig)), outlines.rays)).sum() >= LEAST_PLANES]

    def tried(c: int, turns: dict[int, np.ndarray]) -> TurnedCamera:
        rays = with_turns(outlines.rays, turns)
        known = np.isfinite(missed(c, telling, rays))

        def misses(turn: np.ndarray) -> np.ndarray:
            return np.nan_to_num(missed(c, telling, with_turns(rays, {c: turn}))[known])[:, None]

        return fitted_turn(misses, WIDE_M, rig[c].name, "silhouettes end beside")

    return farthest_off_first(telling, OFF_M, LEFT_M, tried)
