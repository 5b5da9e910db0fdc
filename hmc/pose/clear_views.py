"""What silhouettes bear out of finished poses: which limbs they show and which they contradict, and how much of them no body covers.

A silhouette says where a forearm is when the forearm stands out of it: not when it lies before the trunk, when another person is
behind it, or when furniture hides it. Two cameras that show it clear locate it; one says where it is not; without any, it is where
posture and the frames before have put it. How far a landmark can be trusted for that is for `hmc.pose.trust`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from hmc.body.flesh import flesh_points, place_points
from hmc.body.kinematics import landmarks, segment_transforms
from hmc.body.limbs import CHAIN_OF_PART, LIMBS
from hmc.body.model import BodyModel, neutral_state
from hmc.body.proportions import make_bodies
from hmc.camera.model import Camera, Rig, project
from hmc.io.masks import MaskStep, kept_frames, kept_masks
from hmc.io.recording import Recording
from hmc.io.results import PoseStates
from hmc.landmarks import LANDMARKS
from hmc.processes import each_ahead
from hmc.tracking.views import cell_grid
from hmc.voxels.carving import pixel_of_voxel
from hmc.voxels.run_options import RunOptions

if TYPE_CHECKING:
    from hmc.pose.follow import PosedPeople

__all__ = ["BorneOut", "clear_views", "kept_borne_out", "uncovered_notes"]

#: Flesh of a landmark's limb as near as this to it counts as its own, metres.
NEAR_M = 0.15
#: A camera shows a landmark clear when more than this share of its flesh is.
CLEAR_SHARE = 0.3
#: Silhouette that no body covers counts for the landmarks that are as near as this to it, metres.
BARE_M = 0.2
#: Silhouettes of which no body covers more than this share are told of.
MUCH_UNCOVERED = 0.1
#: Between points of the flesh, and sides of an image's cells at the people's distance, metres.
SPACING_M, CELL_M = 0.02, 0.03

_N_CHAINS = len(LIMBS) + 1
#: The chain (`hmc.body.limbs`) of each landmark; 0 for those of the trunk and the head.
_CHAIN = np.zeros(len(LANDMARKS), int)
for _number, _limb in enumerate(LIMBS.values(), 1):
    _CHAIN[_limb.landmarks] = _number


@dataclass(frozen=True)
class BorneOut:
    """What the silhouettes of some frames say of the poses in them.

    Parameters
    ----------
    views : ndarray of int, shape (n, 15)
        Cameras that show each landmark clear; a row for every row of the poses, in the order of `hmc.landmarks.LANDMARKS`. 0 where there is
        no pose or no silhouettes. For trunk and head only other people stand in the way.
    shown, denied : ndarray, shape (n, 15)
        Shares of each landmark's flesh that cameras show clear, and that would stand clear but is in no silhouette, summed over cameras.
    bare_m : ndarray, shape (n, 15)
        Silhouette within `BARE_M` of each landmark that no body covers: the side of a square of its area, a mean over cameras, metres.
    uncovered : ndarray, shape (n_cameras,)
        Share of each camera's silhouettes that lies beside all bodies; NaN of a camera that has none.
    """

    views: np.ndarray
    shown: np.ndarray
    denied: np.ndarray
    bare_m: np.ndarray
    uncovered: np.ndarray


@dataclass(frozen=True)
class _Flesh:
    """A body's surface: points and their segments, the chain of each, and of which landmarks it is, float32 of 0 and 1, shape (n, 15)."""

    points: np.ndarray
    segment: np.ndarray
    chain: np.ndarray
    of_landmark: np.ndarray


def clear_views(rig: Rig, steps: Iterable[MaskStep], states: PoseStates) -> BorneOut:
    """In how many silhouettes each landmark's flesh stands clear of the person's other limbs and of other people, and what is not covered.

    Parameters
    ----------
    rig : Rig
    steps : iterable of MaskStep
        The silhouettes of the frames.
    states : PoseStates
        The poses of all people in them, with their bodies.

    Returns
    -------
    BorneOut
    """
    return _all_of(rig, _frames_borne_out(rig, steps, states), states)


@dataclass(frozen=True)
class _FrameBorneOut:
    """Of one frame: its rows of the table, fields of `BorneOut` for these, shape (n_rows, 15), and pixels of each camera's silhouette that
    bodies cover and that there are."""

    rows: list[int]
    views: np.ndarray
    shown: np.ndarray
    denied: np.ndarray
    bare_m: np.ndarray
    covered: np.ndarray
    whole: np.ndarray


@dataclass(frozen=True)
class _Placed:
    """The people in one frame: points of all surfaces in the world, metres, whose each is, of which chain, and whether it is known where;
    person by person the points' landmarks and how many each landmark has, and where landmarks are."""

    points: np.ndarray
    person: np.ndarray
    chain: np.ndarray
    known: np.ndarray
    of_landmark: list[np.ndarray]
    counts: np.ndarray
    landmarks: list[np.ndarray]


def _frames_borne_out(rig: Rig, steps: Iterable[MaskStep], states: PoseStates) -> Iterator[_FrameBorneOut]:
    bodies = make_bodies(states.bodies)
    flesh = {person: _flesh_of(body) for person, body in bodies.items()}
    posed = np.isfinite(states.states).any(axis=1)
    for step in steps:
        rows = np.flatnonzero((states.frames == step.index) & posed).tolist()
        whole = np.array([0 if mask is None else np.count_nonzero(mask) for mask in step.masks])
        people = [(flesh[number], bodies[number], states.states[row]) for row in rows for number in [int(states.persons[row])]]
        placed = _placed(people) if people else None
        views = np.zeros((len(rows), len(LANDMARKS)), int)
        shown, denied, bare_m2 = np.zeros((3, *views.shape))
        covered = np.zeros(len(rig))
        for k, (camera, mask) in enumerate(zip(rig, step.masks, strict=True)):
            if placed is not None and mask is not None:
                seen = _seen_by(camera, mask, placed)
                views += seen.shown > CLEAR_SHARE
                shown += seen.shown
                denied += seen.denied
                bare_m2 += seen.bare_m2
                covered[k] = seen.covered
        n_masks = max(1, sum(mask is not None for mask in step.masks))
        yield _FrameBorneOut(rows, views, shown, denied, np.sqrt(bare_m2 / n_masks), covered, whole)


def _all_of(rig: Rig, frames: Iterable[_FrameBorneOut], states: PoseStates) -> BorneOut:
    views = np.zeros((len(states.frames), len(LANDMARKS)), int)
    shown, denied, bare_m = np.zeros((3, *views.shape))
    covered, whole = np.zeros((2, len(rig)))
    for frame in frames:
        views[frame.rows], shown[frame.rows], denied[frame.rows] = frame.views, frame.shown, frame.denied
        bare_m[frame.rows] = frame.bare_m
        covered += frame.covered
        whole += frame.whole
    return BorneOut(views, shown, denied, bare_m, 1 - covered / np.where(whole > 0, whole, np.nan))


def kept_borne_out(people: PosedPeople, recording: Recording, run: RunOptions) -> BorneOut | None:
    """`clear_views` of finished poses by the silhouettes that their run kept.

    Parameters
    ----------
    people : PosedPeople
    recording : Recording
    run : RunOptions

    Returns
    -------
    BorneOut or None
        None where silhouettes were not kept.
    """
    first, end = recording.start, recording.start + recording.n_frames
    if run.masks is None or kept_masks(run.masks, run.key, first, end) is None:
        return None

    def borne_out(some: Sequence[int]) -> Iterator[_FrameBorneOut]:
        return _frames_borne_out(recording.rig, kept_frames(run.masks or "", run.key, some) or (), people.states)

    frames: Iterable[_FrameBorneOut] = each_ahead(borne_out, range(first, end), run.workers)
    return _all_of(recording.rig, run.progress(frames, end - first) if run.progress else frames, people.states)


def uncovered_notes(rig: Rig, uncovered: np.ndarray) -> list[str]:
    """A line where much of the silhouettes is covered by no body; `uncovered` is that of `BorneOut`."""
    told = np.isfinite(uncovered)
    if not told.any() or np.mean(uncovered[told]) <= MUCH_UNCOVERED:
        return []
    shares = ", ".join(f"{camera.name} {share:.0%}" for camera, share in zip(rig, uncovered, strict=True) if np.isfinite(share))
    return [f"of the silhouettes no body covers {shares}: people who were not found, limbs that are astray, or things taken for people"]


def _flesh_of(body: BodyModel) -> _Flesh:
    table = flesh_points(body, SPACING_M)
    skin = table.is_surface
    points, segment, chain = table.points[skin], table.segment[skin], CHAIN_OF_PART[table.part[skin]]
    state = neutral_state("sideways", body.limits)
    apart = np.linalg.norm(place_points(*segment_transforms(body, state), points, segment)[:, None] - landmarks(body, state), axis=2)
    near = (apart <= NEAR_M) & (chain[:, None] == _CHAIN)
    return _Flesh(points, segment, chain, near.astype(np.float32))


@dataclass(frozen=True)
class _Seen:
    """What one camera shows: of each person's landmarks the terms of `BorneOut`, shape (n_people, 15), and how many pixels of the mask
    bodies cover."""

    shown: np.ndarray
    denied: np.ndarray
    bare_m2: np.ndarray
    covered: int


def _placed(people: Sequence[tuple[_Flesh, BodyModel, np.ndarray]]) -> _Placed:
    """Some people, each with body and pose (37,)."""
    # What is not known of a limb is NaN, and so is where its flesh is: it falls on no pixel.
    of_each = [place_points(*segment_transforms(body, state), own.points, own.segment) for own, body, state in people]
    points = np.concatenate(of_each)
    known = np.isfinite(points).all(axis=1)
    return _Placed(
        np.where(known[:, None], points, 0.0),
        np.repeat(np.arange(len(people)), [len(one) for one in of_each]),
        np.concatenate([own.chain for own, _, _ in people]),
        known,
        [own.of_landmark for own, _, _ in people],
        np.array([np.maximum(own.of_landmark.sum(axis=0), 1) for own, _, _ in people]),
        [landmarks(body, state) for _, body, state in people],
    )


def _seen_by(camera: Camera, mask: np.ndarray, people: _Placed) -> _Seen:
    person, chain, n_people = people.person, people.chain, len(people.landmarks)
    column, row, seen = pixel_of_voxel(camera, people.points)
    seen &= people.known
    side, (n_rows, n_columns) = cell_grid(camera, people.points[people.known], CELL_M)
    cell = row // side * n_columns + column // side
    places = cell[seen]
    there = np.zeros((n_people, _N_CHAINS, n_rows * n_columns), bool)
    there[person[seen], chain[seen], places] = True
    # Sums of bytes, as no place has more than 255 limbs or people.
    chains_in, people_in = (
        kinds.view(np.uint8).sum(axis=0, dtype=np.uint8)[places] for kinds in (there.reshape(-1, n_rows * n_columns), there.any(axis=1))
    )
    alone = np.zeros(len(seen), bool)
    alone[seen] = np.where(chain[seen] > 0, chains_in == 1, people_in == 1)
    inside = mask[row, column]
    shown, denied = (
        # Counts, whole numbers that single precision holds.
        np.array([clear[person == k].astype(np.float32) @ own for k, own in enumerate(people.of_landmark)], float) / people.counts
        for clear in (alone & inside, alone & ~inside)
    )
    cells = np.zeros((n_rows, n_columns), np.uint8)
    cells.ravel()[places] = 1
    # Outlines are a cell thick: flesh is sampled by points, and clothes are wider than it.
    wide = np.asarray(cv2.dilate(cells, np.ones((3, 3), np.uint8)))
    pixels, (top, left) = _in_cells(mask, side)
    wide = wide[top : top + pixels.shape[0], left : left + pixels.shape[1]]
    bare = np.stack(divmod(np.flatnonzero((2 * pixels > side**2) & (wide == 0)), pixels.shape[1]), axis=1) + (top, left)
    bare_m2 = np.array([_bare_near(camera, points, (bare[:, ::-1] + 0.5) * side, side) for points in people.landmarks])
    return _Seen(shown, denied, bare_m2, int(pixels[wide > 0].sum()))


def _in_cells(mask: np.ndarray, side: int) -> tuple[np.ndarray, tuple[int, int]]:
    """How many pixels of a mask are in each of the cells that it reaches, and the row and the column of the first of these cells."""
    left, top, width, height = cv2.boundingRect(mask.view(np.uint8))
    if not width:
        return np.zeros((0, 1), int), (0, 0)
    first = top // side, left // side
    corners = [np.arange(start * side, end + side, side) for start, end in zip(first, (top + height, left + width), strict=True)]
    part = mask[corners[0][0] : corners[0][-1], corners[1][0] : corners[1][-1]].view(np.uint8)
    rows, columns = (np.minimum(at - at[0], size) for at, size in zip(corners, part.shape, strict=True))
    counts = cv2.integral(part)[rows[:, None], columns]
    return np.asarray(np.diff(np.diff(counts, axis=0), axis=1)), first


def _bare_near(camera: Camera, places: np.ndarray, bare: np.ndarray, side: int) -> np.ndarray:
    """Area of the cells, whose middles (m, 2) are given, around each landmark (15, 3) at its distance, square metres, shape (15,)."""
    uv, valid = project(camera, np.nan_to_num(places))
    valid = valid & np.isfinite(places).all(axis=1)
    depth = np.nan_to_num(places) @ camera.rotation[2] + camera.translation[2]
    metres = np.where(valid, depth, 0.0) / camera.matrix[0, 0]
    apart = np.linalg.norm(bare[None] - np.where(valid[:, None], uv, 0.0)[:, None], axis=2) * metres[:, None]
    return (apart < BARE_M).sum(axis=1) * (side * metres) ** 2
