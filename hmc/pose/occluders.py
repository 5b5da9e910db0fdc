"""What the scene hides from each camera, learnt from the poses of a first pass: a table before somebody's legs.

A silhouette says that nobody is at a place only if its camera sees the place. Where furniture stands before it the camera shows nothing of
whoever is there, so hulls end at the table's edge, and a leg behind it costs least where it is folded up into what is left of them.

Furniture stays where it is, and poses of the whole run tell of it: where bodies that other cameras show are never shown by this one from
some depth on, something stands before that depth; bodies that are shown there tell how far the view is free. Such a camera says nothing of
what lies behind: a body may be wherever all cameras show it that are left (occlusion from silhouette cues: Guan, Franco and Pollefeys
2007, with fitted bodies in place of probable hulls).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np

from hmc.body.flesh import flesh_points, place_points
from hmc.body.kinematics import segment_transforms
from hmc.body.proportions import make_bodies
from hmc.camera.model import Camera, Rig
from hmc.io.masks import MaskStep, kept_frames
from hmc.io.recording import spread_frames
from hmc.io.results import PoseStates
from hmc.processes import share_out
from hmc.voxels.carving import pixel_of_voxel
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.run_options import RunOptions

__all__ = [
    "BlockedView",
    "HiddenPlaces",
    "Sightings",
    "blocked_from",
    "count_bodies",
    "hidden_places",
    "learn_hidden_places",
    "no_sightings",
    "unseen_voxels",
]

#: Frames that are looked at, at most, well spread: furniture does not move, and people do.
MOST_FRAMES = 300
#: Side of a patch of the image on a person, and of a step in depth, metres; and how far from the pelvis limbs reach.
PATCH_M, STEP_M, LIMB_REACH_M = 0.03, 0.1, 1.5
#: Somebody's surface that so many cameras show is where the pose has it.
LEAST_SUPPORT = 2
#: Outlines differ from the flesh by so many patches: as near to a silhouette, nothing is known.
OUTLINE = 2
#: Patches to each side whose bodies count with a patch's own.
AROUND = 3
#: The view is blocked from a depth on when so many bodies were not shown there or nearer ...
LEAST_HIDDEN = 5
#: ... and these are more than this share of them and of those that were shown farther off.
HIDDEN_SHARE = 0.8
#: Of the cameras that see a hidden place one may deny it, as of the tolerant hull, where so many show it.
LEAST_SHOWN = 2


@dataclass(frozen=True)
class Sightings:
    """How often one camera showed bodies, and how often not, by patch of its image and by depth.

    Parameters
    ----------
    side : int
        Of a patch, pixels.
    shown, hidden : ndarray of uint16, shape (n_rows, n_columns, n_steps)
    before : int
        Steps nearer than the first of these, in which nobody is.
    """

    side: int
    shown: np.ndarray
    hidden: np.ndarray
    before: int = 0


@dataclass(frozen=True)
class BlockedView:
    """From which depth on something is before one camera.

    Parameters
    ----------
    side : int
        Of a patch, pixels.
    depth : ndarray, shape (n_rows, n_columns)
        Metres along the camera's axis; infinite where the view is free as far as bodies tell.
    """

    side: int
    depth: np.ndarray


@dataclass(frozen=True)
class HiddenPlaces:
    """The voxels of a grid that the scene hides from some cameras.

    Parameters
    ----------
    voxels : ndarray of int32, shape (n, 3)
    pixels : ndarray of int32, shape (n_cameras, n)
        Flat pixel ``row * width + column`` of each; -1 where the camera does not see it: something is before it, or it is out of the image.
    """

    voxels: np.ndarray
    pixels: np.ndarray


def learn_hidden_places(rig: Rig, grid: VoxelGrid, run: RunOptions, states: PoseStates) -> HiddenPlaces | None:
    """What the scene hides, from finished poses and the silhouettes that were kept.

    Parameters
    ----------
    rig : Rig
    grid : VoxelGrid
    run : RunOptions
        With the silhouettes of all frames that have poses.
    states : PoseStates
        The poses of all people, with their bodies.

    Returns
    -------
    HiddenPlaces or None
        None where nothing is hidden, as far as these poses tell.
    """
    posed = np.isfinite(states.states).all(axis=1)
    frames = spread_frames(np.unique(states.frames[posed]), MOST_FRAMES)
    if not frames or kept_frames(run.masks or "", run.key, frames) is None:
        return None
    bodies = make_bodies(states.bodies)
    skin = {}
    for person, body in bodies.items():
        flesh = flesh_points(body, PATCH_M)
        skin[person] = flesh.points[flesh.is_surface], flesh.segment[flesh.is_surface]
    depths = np.array([states.states[posed, :3] @ camera.rotation[2] + camera.translation[2] for camera in rig])
    away = np.maximum(1.0, np.median(depths, axis=1)).tolist()
    ranges = np.stack([depths.min(axis=1) - LIMB_REACH_M, depths.max(axis=1) + LIMB_REACH_M], axis=1)

    def count(some: list[int]) -> tuple[list[Sightings], np.ndarray]:
        sightings = [no_sightings(*one) for one in zip(rig, away, ranges, strict=True)]
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for step in kept_frames(run.masks or "", run.key, some) or ():
            people = [(int(states.persons[row]), states.states[row]) for row in np.flatnonzero((states.frames == step.index) & posed)]
            points = np.concatenate([place_points(*segment_transforms(bodies[one], state), *skin[one]) for one, state in people])
            low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
            count_bodies(sightings, rig, step, points)
        return sightings, np.stack([low, high])

    parts = share_out([partial(count, frames[k :: run.workers]) for k in range(min(run.workers, len(frames)))], run.workers)
    sightings = [_all_of(own) for own in zip(*(found for found, _ in parts), strict=True)]
    corners = np.array([box for _, box in parts])
    box = np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
    return hidden_places(grid, rig, [blocked_from(one) for one in sightings], box)


def _all_of(parts: Sequence[Sightings]) -> Sightings:
    """One camera's sightings in several lots of frames, together."""
    shown = np.array([one.shown for one in parts]).sum(axis=0, dtype=np.uint16)
    hidden = np.array([one.hidden for one in parts]).sum(axis=0, dtype=np.uint16)
    return replace(parts[0], shown=shown, hidden=hidden)


def no_sightings(camera: Camera, depth_m: float, range_m: Sequence[float]) -> Sightings:
    """Nothing seen yet by a camera from which people are mostly so far away, and between these two depths, metres."""
    side = max(1, round(PATCH_M * float(camera.matrix[0, 0]) / depth_m))
    width, height = camera.size
    before, behind = max(0, math.floor(range_m[0] / STEP_M)), max(1, math.ceil(range_m[1] / STEP_M))
    shape = -(-height // side), -(-width // side), max(1, behind - before)
    return Sightings(side, np.zeros(shape, np.uint16), np.zeros(shape, np.uint16), before)


def count_bodies(sightings: Sequence[Sightings], rig: Rig, step: MaskStep, points: np.ndarray) -> None:
    """Add one frame's bodies to what the cameras showed, in place.

    Parameters
    ----------
    sightings : sequence of Sightings
        One a camera.
    rig : Rig
    step : MaskStep
        The frame's silhouettes.
    points : ndarray, shape (n, 3)
        Of the surface of all people in the frame, a patch apart; world, metres.
    """
    pixels = [pixel_of_voxel(camera, points) for camera in rig]
    support = np.zeros(len(points), int)
    for mask, (column, row, seen) in zip(step.masks, pixels, strict=True):
        if mask is not None:
            support += seen & mask[row, column]
    for own, camera, mask, (column, row, seen) in zip(sightings, rig, step.masks, pixels, strict=True):
        if mask is None:
            continue
        n_rows, n_columns, n_steps = own.shown.shape
        depth = points @ camera.rotation[2] + camera.translation[2]
        near_first = np.flatnonzero(seen)[np.argsort(depth[seen], kind="stable")]
        # A patch can show the nearest body alone.
        patch, place = np.unique(row[near_first] // own.side * n_columns + column[near_first] // own.side, return_index=True)
        nearest = near_first[place]
        depth_step = np.clip((depth[nearest] / STEP_M).astype(int) - own.before, 0, n_steps - 1)
        some = _patches_of(mask, own.side, (n_rows, n_columns))
        beside = np.asarray(cv2.dilate(some, np.ones((2 * OUTLINE + 1, 2 * OUTLINE + 1), np.uint8)))
        shown = some.ravel()[patch] > 0
        hidden = (beside.ravel()[patch] == 0) & (support[nearest] >= LEAST_SUPPORT)
        for counts, chosen in ((own.shown, shown), (own.hidden, hidden)):
            counts.reshape(-1, n_steps)[patch[chosen], depth_step[chosen]] += 1


def _patches_of(mask: np.ndarray, side: int, shape: tuple[int, int]) -> np.ndarray:
    """Which patches hold a pixel of a mask: uint8, shape (n_rows, n_columns)."""
    reached = cv2.dilate(mask.view(np.uint8), np.ones((side, side), np.uint8), anchor=(0, 0))
    return np.ascontiguousarray(reached[::side, ::side][: shape[0], : shape[1]])


def blocked_from(sightings: Sightings) -> BlockedView:
    """Where a camera's view is blocked, by what it showed of bodies and what it did not."""
    shown, hidden = _with_around(sightings.shown), _with_around(sightings.hidden)
    nearer = np.cumsum(hidden, axis=-1)
    # A step of slack: poses are not exact in depth.
    farther = np.zeros_like(nearer)
    farther[..., :-1] = np.cumsum(shown[..., :0:-1], axis=-1)[..., ::-1]
    blocked = (nearer >= LEAST_HIDDEN) & (nearer > HIDDEN_SHARE * (nearer + farther))
    first = blocked.argmax(axis=-1)
    # What hides a body stands somewhere before it, and behind what the patch itself has shown: what those around it show, they may show
    # past the edge of a table. In between a camera that shows nothing says nothing.
    n_steps = shown.shape[-1]
    free_to = np.where(sightings.shown.any(axis=-1), n_steps - (sightings.shown[..., ::-1] > 0).argmax(axis=-1), 0)
    step = np.minimum(first, free_to)
    # Of a patch that has shown nobody nothing is known before its first step either.
    depth = np.where(step > 0, (step + sightings.before) * STEP_M, 0.0)
    return BlockedView(sightings.side, np.where(blocked.any(axis=-1), depth, np.inf))


def _with_around(counts: np.ndarray) -> np.ndarray:
    """Sums of counts over each patch and those around it, shape (n_rows, n_columns, n_steps)."""
    total = np.zeros(counts.shape, np.float32)
    for step in np.flatnonzero(counts.any(axis=(0, 1))):
        layer = counts[..., step].astype(np.float32)
        total[..., step] = cv2.boxFilter(layer, -1, (2 * AROUND + 1,) * 2, normalize=False, borderType=cv2.BORDER_CONSTANT)
    return total


def hidden_places(grid: VoxelGrid, rig: Rig, blocked: Sequence[BlockedView], within: np.ndarray) -> HiddenPlaces | None:
    """The voxels that are hidden from some cameras.

    Parameters
    ----------
    grid : VoxelGrid
    rig : Rig
    blocked : sequence of BlockedView
        One a camera.
    within : ndarray, shape (2, 3)
        Lowest and highest corner of where people are, world, metres.

    Returns
    -------
    HiddenPlaces or None
        None where there are none.
    """
    blocking = [c for c, view in enumerate(blocked) if np.isfinite(view.depth).any()]
    low, high = np.clip(grid.index_of(within) + [[0], [1]], 0, grid.shape)
    found = [np.zeros((0, 3), np.int32)]
    for i in range(low[0], high[0]) if blocking else ():
        ranges = np.arange(i, i + 1), np.arange(low[1], high[1]), np.arange(low[2], high[2])
        voxels = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.int32)
        points = grid.centres(voxels)
        hidden = np.zeros(len(points), bool)
        for c in blocking:
            hidden |= _hidden_from(rig.cameras[c], blocked[c], points)[1]
        found.append(voxels[hidden])
    voxels = np.concatenate(found)
    if not len(voxels):
        return None
    points = grid.centres(voxels)
    pixels = [np.where(hidden, -1, pixel) for pixel, hidden in (_hidden_from(*one, points) for one in zip(rig, blocked, strict=True))]
    return HiddenPlaces(voxels, np.stack(pixels).astype(np.int32))


def _hidden_from(camera: Camera, blocked: BlockedView, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The flat pixel of each point, -1 out of the image, and whether something hides it there, both of shape (n,)."""
    column, row, seen = pixel_of_voxel(camera, points)
    depth = points @ camera.rotation[2] + camera.translation[2]
    hidden = seen & (depth >= blocked.depth[row // blocked.side, column // blocked.side])
    return np.where(seen, row * camera.size[0] + column, -1), hidden


def unseen_voxels(places: HiddenPlaces, masks: Sequence[np.ndarray | None]) -> np.ndarray:
    """The hidden voxels in which somebody may be, by the cameras that see the place: all of them show people there, or all but one.

    Parameters
    ----------
    places : HiddenPlaces
    masks : sequence of ndarray of bool, shape (height, width), or None
        A frame's silhouettes, one a camera.

    Returns
    -------
    ndarray of int32, shape (m, 3)
    """
    shown, denied = np.zeros((2, len(places.voxels)), np.uint8)
    for mask, pixels in zip(masks, places.pixels, strict=True):
        if mask is not None:
            there, seen = mask.ravel()[np.maximum(pixels, 0)], pixels >= 0
            shown += there & seen
            denied += ~there & seen
    return places.voxels[((denied == 0) & (shown > 0)) | ((denied == 1) & (shown >= LEAST_SHOWN))]
