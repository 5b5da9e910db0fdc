"""Cameras that have turned since they were calibrated, as silhouettes tell: by where those of each pair of cameras end.

People's silhouettes in two cameras end at the same two planes through both (`hmc.camera.tangency`), whatever the people look like: two
distances a pair and frame, and no hull that one camera has cut short. A frame in which a camera does not show everybody does not count for
it; furniture, shadows and what segmentation loses are mended by no turn.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import cv2
import numpy as np

from hmc.camera.model import Camera, Rig, project
from hmc.camera.tangency import Outlines, convex_outline, tangent_misses
from hmc.camera.turned_cameras import LEAST_CAMERAS, TurnedCamera, farthest_off_first, fitted_turn, with_turns
from hmc.io.masks import MaskStep, kept_frames
from hmc.io.recording import Recording, spread_frames
from hmc.io.results import TrackTable
from hmc.processes import each_ahead
from hmc.voxels.run_options import RunOptions

__all__ = ["people_outlines", "turned_by_silhouettes"]

#: Frames that are asked, at most, well spread; and so many planes that touch what a camera shows tell.
FRAMES, LEAST_PLANES = 40, 60
#: A camera has turned that is off by more than this, metres, in the median of its planes, and by no more than the second when it is turned
#: back: one that is late is mended in part. Of well calibrated rigs it is 1 to 5 mm, where furniture hides somebody or segmentation loses
#: clothes up to 8, which no turn mends. A plane that is off by more than the third counts ever less.
OFF_M, LEFT_M, WIDE_M = 0.006, 0.012, 0.01
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
    return _turned(recording.rig, _together(list(each_ahead(outlined, frames, run.workers)), middles))


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
