"""Which limbs the data of a recording shows, and when a method leaves limbs out and takes them back.

How much of a limb is shown is told by its true pose: the share of its flesh that is in the tolerant hull, of what is free of other parts,
and the number of cameras in whose silhouettes at least half of it lies. It needs true joints and nothing else, so it works on a user's
recording as on a rendered one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hmc.body.flesh import place_points
from hmc.body.inverse import fit_landmarks
from hmc.body.kinematics import segment_transforms
from hmc.body.proportions import default_body
from hmc.body.scalable_models import UNITIVE_PIECES
from hmc.experiments.engine.inputs import Inputs, once
from hmc.experiments.markerless_runs import FRONTEND, MASKS_KEY, VOXEL_M, tracked
from hmc.experiments.truth import HEIGHT_M, first_truth, standing_state, stature_m, truth_track
from hmc.io.door import kept_arrays
from hmc.io.masks import kept_masks
from hmc.landmarks import LANDMARKS, landmark_index
from hmc.pose.method import Capture
from hmc.pose.methods.scalable import method_preset
from hmc.pose.objectives.four_scores import ScoreTable
from hmc.pose.steps.annealed import annealed_subject
from hmc.pose.steps.hidden.shown import flesh_in_hulls, limb_signs, place_flesh
from hmc.pose.steps.presets import PRESETS
from hmc.pose.steps.restrict import part_mask
from hmc.pose.views.person_view import views_of
from hmc.tracking.resumable import person_grid
from hmc.voxels.carving import pixel_of_voxel
from hmc.voxels.hulls import HullStep, stream_hulls

__all__ = ["ENDS", "LimbViews", "hidden_and_shown", "limb_views", "rest_of", "waits"]

#: Limbs that may be missing, and the landmark that tells whether one is.
ENDS = {"r_upper_arm": "r_elbow", "r_forearm": "r_wrist", "l_upper_arm": "l_elbow", "l_forearm": "l_wrist",
        "r_thigh": "r_knee", "r_shank": "r_ankle", "l_thigh": "l_knee", "l_shank": "l_ankle"}  # fmt: skip
#: A limb is hidden where less than this share of it is in the hull, and shown above that; between the two, either is right.
HIDDEN, SHOWN = 0.3, 0.6


@dataclass(frozen=True)
class LimbViews:
    """What a recording shows of a person's limbs, in the order of `ENDS`.

    Parameters
    ----------
    occupancy : ndarray, shape (n, n_limbs)
        Share of the limb's flesh in the tolerant hull; NaN where it cannot be told.
    cameras : ndarray, shape (n, n_limbs)
        How many cameras' silhouettes have at least half of it; NaN likewise.
    """

    occupancy: np.ndarray
    cameras: np.ndarray


def limb_views(inputs: Inputs, label: str) -> LimbViews:
    """What a recording shows of the limbs of its first person, in every true frame; computed once and kept beside the recording.

    Raises
    ------
    InputError
        When the recording has no true joints.
    """

    def make(part: Path) -> None:
        views = _limb_views(inputs, label)
        with open(part, "wb") as file:
            np.savez(file, occupancy=views.occupancy, cameras=views.cameras)

    with kept_arrays(once(inputs.folder / label / "limbs.npz", make)) as kept:
        return LimbViews(kept["occupancy"], kept["cameras"])


def _limb_views(inputs: Inputs, label: str) -> LimbViews:
    seen = tracked(inputs, label, 0)
    recording, masks = seen.recording, seen.masks
    truth = first_truth(recording)
    body = default_body(stature_m(recording) or HEIGHT_M)
    preset = method_preset(PRESETS["default"], "ddm-apf")
    table: ScoreTable | None = annealed_subject(body, Capture(recording.fps, VOXEL_M, recording.room), preset).flesh
    limbs, whole = UNITIVE_PIECES.limbs, part_mask(UNITIVE_PIECES.unions[-1].model.parts)
    occupancy, cameras = np.full((2, len(truth.frames), len(limbs)), np.nan)
    first, last = int(truth.frames[0]), int(truth.frames[-1]) + 1
    grid = person_grid(recording, VOXEL_M)
    where = truth_track(truth)
    kept = kept_masks(masks, MASKS_KEY, first, last)
    state = standing_state(body, truth.positions[0])
    for hull in stream_hulls(recording, grid, FRONTEND, first=first, last=last, masks=kept, on_problem=lambda line: None):
        row = np.flatnonzero(truth.frames == hull.index)
        if not len(row) or table is None:
            continue
        target = views_of(recording, grid, where, hull)[0].target
        if target is None:
            continue
        state, _ = fit_landmarks(body, truth.positions[row[0]], state)
        looked, transforms = flesh_in_hulls(table, target, recording.room), segment_transforms(body, state)
        flesh = place_flesh(looked, state, [part for limb in limbs for part in limb.parts])
        for k, limb in enumerate(limbs):
            occupancy[row[0], k] = limb_signs(flesh, limb.parts, whole).occupancy
            own = part_mask(limb.parts)[table.flesh.part]
            points = place_points(*transforms, table.flesh.points[own], table.flesh.segment[own])
            cameras[row[0], k] = sum(share >= 0.5 for share in _shares(recording.rig, hull, points))
    return LimbViews(occupancy, cameras)


def _shares(rig, hull: HullStep, points: np.ndarray) -> Iterator[float]:
    """Of points, the share that is in each camera's silhouette."""
    for camera, mask in zip(rig, hull.masks, strict=True):
        if mask is None:
            continue
        column, row, in_image = pixel_of_voxel(camera, points)
        yield float((in_image & mask[row, column]).sum() / len(points))


def hidden_and_shown(occupancy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which limbs are hidden in which frames, and which are shown; neither where it is in between or unknown."""
    occupancy = np.asarray(occupancy, float)
    return occupancy < HIDDEN, occupancy > SHOWN


def rest_of(hidden: np.ndarray) -> np.ndarray:
    """Landmarks that belong to no hidden limb, bool, shape (n, 15).

    Parameters
    ----------
    hidden : ndarray of bool, shape (n, n_limbs)
    """
    rest = np.ones((len(hidden), len(LANDMARKS)), bool)
    names = list(ENDS)
    for k, parent in enumerate(UNITIVE_PIECES.parent):
        rest[:, landmark_index(ENDS[names[k]])] = ~(hidden[:, k] | hidden[:, parent]) if parent >= 0 else ~hidden[:, k]
    return rest


def waits(since: np.ndarray, reached: np.ndarray) -> list[int]:
    """For every stretch of frames in which something holds, after how many of them something else was reached: all where it was not.

    Parameters
    ----------
    since, reached : ndarray of bool, shape (n,)
    """
    edges = np.flatnonzero(np.diff(np.r_[False, since, False].astype(int)))
    return [int(np.argmax(np.r_[reached[start:stop], True])) for start, stop in edges.reshape(-1, 2)]
