"""How far a body's keypoints are from the lines of sight on which a detector saw them.

A line of sight that is missed costs the squared distance in terms of the detector's scatter, and by Cauchy's rule ever less the farther it
is missed: a detection that is altogether wrong pulls little. The scatter is the detector's own in the camera, learnt from how far cameras
agree (`hmc.pose.keypoint_cues`), and with it what a keypoint of this detector may lie beside the body's place of it: that is learnt
in the second pass and known no better than so in the first.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hmc.body.joints import N_DOF
from hmc.body.keypoint_places import BODY_KEYPOINTS, KEYPOINT_PART, KEYPOINT_SEGMENTS, keypoint_places, place_keypoints
from hmc.body.kinematics import dof_masks, joint_twists, point_motions, segment_transforms
from hmc.body.model import PARTS, BodyModel
from hmc.pose.views.keypoints import SCATTER_M, SeenKeypoints

__all__ = ["BESIDE_M", "Beside", "KeypointCost", "KeypointSettings"]

_MASKS = dof_masks()[KEYPOINT_SEGMENTS].astype(float)
#: How far a detector's keypoint may commonly lie beside the body's place of it, metres: hips are guessed through clothes.
_BESIDE = {"hip": 0.035, "shoulder": 0.025, "elbow": 0.015, "wrist": 0.012, "knee": 0.015, "ankle": 0.02, "nose": 0.02, "ear": 0.02}
BESIDE_M = np.array([_BESIDE[name.rpartition("_")[2]] for name in BODY_KEYPOINTS])


@dataclass(frozen=True)
class Beside:
    """Where a detector's keypoints lie beside the body's places of them.

    Parameters
    ----------
    offset_m : ndarray, shape (15, 3)
        On their segments, metres.
    deviation_m : ndarray, shape (15,)
        How far that is not known.
    worth : float
        Factor on what keypoints weigh: the worse hulls are commonly met, the more.
    """

    offset_m: np.ndarray = field(default_factory=lambda: np.zeros((len(BODY_KEYPOINTS), 3)))
    deviation_m: np.ndarray = field(default_factory=lambda: BESIDE_M)
    worth: float = 1.0


@dataclass(frozen=True)
class KeypointSettings:
    """Weights of the keypoints' cost.

    Parameters
    ----------
    weight : float
        Of a keypoint that two cameras or more see one deviation off, against the symmetric cost.
    wide : float
        Deviations from which on a miss counts ever less.
    """

    weight: float = 0.12
    wide: float = 3.0


@dataclass(frozen=True)
class _MissesAt:
    """The lines' misses at one state, and what moves the keypoints."""

    residuals: np.ndarray
    directions: np.ndarray
    keypoint: np.ndarray
    places: np.ndarray
    axes: np.ndarray
    centres: np.ndarray
    near: None = None
    misfit: None = None

    def pulls(self) -> tuple[np.ndarray, np.ndarray]:
        """All residuals, and how they change with the state, shape (2 n, 37)."""
        moves = point_motions(self.axes, self.centres, self.places, _MASKS)
        return np.arange(len(self.residuals)), (self.directions @ moves[self.keypoint]).reshape(-1, N_DOF)


@dataclass(frozen=True)
class KeypointCost:
    """The keypoints' cost of poses in one frame: an objective (`hmc.pose.objectives.objective.Objective`).

    Parameters
    ----------
    body : BodyModel
    seen : SeenKeypoints
    beside : Beside
    settings : KeypointSettings
    """

    body: BodyModel
    seen: SeenKeypoints
    beside: Beside = field(default_factory=lambda: Beside())
    settings: KeypointSettings = field(default_factory=KeypointSettings)

    def cost(self, states: np.ndarray) -> np.ndarray:
        """The sum over lines of sight, square metres: states (n, 37) to (n,)."""
        return self._weights() @ self._by_line(states).T

    def by_part(self, states: np.ndarray) -> np.ndarray:
        """`cost`, each part's share of it, shape (n, n_parts)."""
        return (self._by_line(states) * self._weights()) @ np.eye(len(PARTS))[KEYPOINT_PART[self.seen.keypoint]]

    def linearise(self, state: np.ndarray, near: Any = None) -> _MissesAt:
        """Residuals at one state (37,), two a line."""
        axes, centres, rotations, positions = joint_twists(self.body, state)
        places = place_keypoints(rotations, positions, self._local())
        missed = self.seen.missed(places)
        deviation, wide2 = self._deviation(), self.settings.wide**2
        squared = np.maximum((missed**2).sum(axis=1) / deviation**2, 1e-12)
        # The gradient of the cost is that of these residuals with these jacobians; what a miss's weight changes is left out.
        share = np.sqrt(wide2 * np.log1p(squared / wide2) / squared)
        scale = np.sqrt(self._weights()) / deviation
        directions = (scale / (share * (1 + squared / wide2)))[:, None, None] * self.seen.across
        return _MissesAt(((scale * share)[:, None] * missed).ravel(), directions, self.seen.keypoint, places, axes, centres)

    def coarser(self, rng: np.random.Generator, n: int) -> KeypointCost:
        """Itself: lines of sight are few."""
        return self

    def of_body(self, body: BodyModel, points: object = None) -> KeypointCost:
        """The same of another body; points of its surface are not asked about."""
        return replace(self, body=body)

    def _local(self) -> np.ndarray:
        return keypoint_places(self.body) + self.beside.offset_m

    def _deviation(self) -> np.ndarray:
        return np.hypot(self.seen.deviation_m, self.beside.deviation_m[self.seen.keypoint])

    def _weights(self) -> np.ndarray:
        """Of each line, square metres: all keypoints alike, however many cameras see them, but for those that one alone sees."""
        cameras = np.bincount(self.seen.keypoint, minlength=len(BODY_KEYPOINTS))
        share = 1 / np.maximum(2, cameras)[self.seen.keypoint]
        return self.settings.weight * self.beside.worth * SCATTER_M**2 / len(BODY_KEYPOINTS) * share

    def _by_line(self, states: np.ndarray) -> np.ndarray:
        rotations, positions = segment_transforms(self.body, states)
        places = place_keypoints(rotations, positions, self._local())
        missed = self.seen.missed(places)
        wide2 = self.settings.wide**2
        return wide2 * np.log1p((missed**2).sum(axis=-1) / self._deviation() ** 2 / wide2)
