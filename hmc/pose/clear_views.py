"""What silhouettes bear out of finished poses: which limbs are measured and which are guessed, and how much of them no body covers.

A silhouette says where a forearm is when the forearm stands out of it: not when it lies before the trunk, when another person is
behind it, or when furniture hides it. Two cameras that show it clear locate it; one says where it is not; without any, it is where
posture and the frames before have put it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from hmc.body.flesh import flesh_points, place_points
from hmc.body.kinematics import landmarks, segment_transforms
from hmc.body.limbs import CHAIN_OF_PART, LIMBS
from hmc.body.model import BodyModel, neutral_state
from hmc.body.proportions import make_bodies
from hmc.camera.model import Camera, Rig
from hmc.io.masks import MaskStep, kept_frames, kept_masks
from hmc.io.recording import Recording
from hmc.io.results import PoseStates, PoseTable
from hmc.landmarks import ENOUGH_VIEWS, LANDMARKS
from hmc.processes import each_ahead
from hmc.tracking.views import cell_grid
from hmc.voxels.carving import pixel_of_voxel
from hmc.voxels.run_options import RunOptions

if TYPE_CHECKING:
    from hmc.pose.follow import PosedPeople

__all__ = ["BorneOut", "clear_views", "guess_notes", "with_clear_views"]

#: Flesh of a landmark's limb as near as this to it counts as its own, metres.
NEAR_M = 0.15
#: A camera shows a landmark clear when more than this share of its flesh is.
CLEAR_SHARE = 0.3
#: A person of whose landmarks more than this share are guesses is told of, and silhouettes of which no body covers more than this share.
MANY_GUESSES, MUCH_UNCOVERED = 0.05, 0.1
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
    uncovered : ndarray, shape (n_cameras,)
        Share of each camera's silhouettes that lies beside all bodies; NaN of a camera that has none.
    """

    views: np.ndarray
    uncovered: np.ndarray


@dataclass(frozen=True)
class _Flesh:
    """A body's surface: points and their segments, the chain of each, and of which landmarks it is, shape (n, 15)."""

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
    """Of one frame: its rows of the table, how many cameras show each row's landmarks, and pixels of each camera's silhouette that bodies
    cover and that there are."""

    rows: list[int]
    views: np.ndarray
    covered: np.ndarray
    whole: np.ndarray


def _frames_borne_out(rig: Rig, steps: Iterable[MaskStep], states: PoseStates) -> Iterator[_FrameBorneOut]:
    bodies = make_bodies(states.bodies)
    flesh = {person: _flesh_of(body) for person, body in bodies.items()}
    posed = np.isfinite(states.states).any(axis=1)
    for step in steps:
        rows = np.flatnonzero((states.frames == step.index) & posed).tolist()
        whole = np.array([0 if mask is None else np.count_nonzero(mask) for mask in step.masks])
        people = [flesh[int(states.persons[row])] for row in rows]
        placed = []
        for row, one in zip(rows, people, strict=True):
            # What is not known of a limb is NaN, and so is where its flesh is: it falls on no pixel.
            transforms = segment_transforms(bodies[int(states.persons[row])], states.states[row])
            placed.append(place_points(*transforms, one.points, one.segment))
        views, covered = np.zeros((len(rows), len(LANDMARKS)), int), np.zeros(len(rig))
        for k, (camera, mask) in enumerate(zip(rig, step.masks, strict=True)):
            if rows and mask is not None:
                shown, covered[k] = _shown_by(camera, mask, people, placed)
                views += shown
        yield _FrameBorneOut(rows, views, covered, whole)


def _all_of(rig: Rig, frames: Iterable[_FrameBorneOut], states: PoseStates) -> BorneOut:
    views = np.zeros((len(states.frames), len(LANDMARKS)), int)
    covered, whole = np.zeros((2, len(rig)))
    for frame in frames:
        views[frame.rows] = frame.views
        covered += frame.covered
        whole += frame.whole
    return BorneOut(views, 1 - covered / np.where(whole > 0, whole, np.nan))


def with_clear_views(people: PosedPeople, recording: Recording, run: RunOptions) -> PosedPeople:
    """Poses with `clear_views` beside their landmarks, and a line on every person of whom much is guessed and on what no body covers.

    Parameters
    ----------
    people : PosedPeople
    recording : Recording
    run : RunOptions
        With the silhouettes that were kept; where they were not, the poses stay as they are.
    """
    first, end = recording.start, recording.start + recording.n_frames
    if run.masks is None or kept_masks(run.masks, run.key, first, end) is None:
        return people

    def borne_out(some: Sequence[int]) -> Iterator[_FrameBorneOut]:
        return _frames_borne_out(recording.rig, kept_frames(run.masks or "", run.key, some) or (), people.states)

    frames: Iterable[_FrameBorneOut] = each_ahead(borne_out, range(first, end), run.workers)
    found = _all_of(recording.rig, run.progress(frames, end - first) if run.progress else frames, people.states)
    poses = replace(people.poses, views=found.views)
    notes = (*people.notes, *guess_notes(poses), *_uncovered_notes(recording.rig, found.uncovered))
    return replace(people, poses=poses, notes=notes)


def guess_notes(poses: PoseTable) -> list[str]:
    """A line on every person of whose landmarks many are guesses: how many, and which most of all."""
    notes = []
    for person in np.unique(poses.persons).tolist():
        own = poses.of(person)
        there = np.isfinite(own.positions).all(axis=2)
        guessed = there & (np.zeros(there.shape) if own.views is None else own.views < ENOUGH_VIEWS)
        if guessed.sum() > MANY_GUESSES * there.sum():
            counts = guessed.sum(axis=0)
            most = ", ".join(f"{LANDMARKS[k]} {counts[k]}" for k in np.argsort(-counts, kind="stable")[:4] if counts[k])
            notes.append(
                f"person {person}: {guessed.sum() / there.sum():.0%} of the landmarks are guesses, as fewer than two cameras show them "
                f"clear (`views` in joints.csv); in how many of {len(there)} frames, most of all: {most}"
            )
    return notes


def _uncovered_notes(rig: Rig, uncovered: np.ndarray) -> list[str]:
    """A line where much of the silhouettes is covered by no body."""
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
    return _Flesh(points, segment, chain, near)


def _shown_by(camera: Camera, mask: np.ndarray, people: list[_Flesh], placed: list[np.ndarray]) -> tuple[np.ndarray, int]:
    """Whether a camera shows each person's landmarks clear, bool, shape (n_people, 15); and how many of the mask's pixels bodies cover."""
    points = np.concatenate(placed)
    person = np.repeat(np.arange(len(people)), [len(one) for one in placed])
    chain = np.concatenate([one.chain for one in people])
    known = np.isfinite(points).all(axis=1)
    column, row, seen = pixel_of_voxel(camera, np.where(known[:, None], points, 0.0))
    seen &= known
    side, (n_rows, n_columns) = cell_grid(camera, points[known], CELL_M)
    cell = row // side * n_columns + column // side
    there = np.zeros((len(people), _N_CHAINS, n_rows * n_columns), bool)
    there[person[seen], chain[seen], cell[seen]] = True
    chains_in, people_in = there.sum(axis=(0, 1))[cell], there.any(axis=1).sum(axis=0)[cell]
    clear = seen & mask[row, column] & np.where(chain > 0, chains_in == 1, people_in == 1)
    shown = [own.of_landmark[clear[person == k]].sum(axis=0) > CLEAR_SHARE * own.of_landmark.sum(axis=0) for k, own in enumerate(people)]
    cells = np.zeros((n_rows, n_columns), np.uint8)
    cells.ravel()[cell[seen]] = 1
    # Outlines are a cell thick: flesh is sampled by points, and clothes are wider than it.
    wide = np.asarray(cv2.dilate(cells, np.ones((3, 3), np.uint8)))
    height, width = mask.shape
    bodies = wide.repeat(side, axis=0).repeat(side, axis=1)[:height, :width]
    return np.array(shown), int(np.count_nonzero(mask & (bodies > 0)))
