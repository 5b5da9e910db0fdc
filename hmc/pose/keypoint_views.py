"""What a detector's keypoints bear out of finished poses: how many cameras have each landmark where the body has it.

Two cameras locate it; of one alone, or where all of them guessed something else, it is where posture and the frames before have put it. For
poses by keypoints alone it is what `hmc.pose.clear_views` is for those by silhouettes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hmc.body.keypoint_places import BODY_KEYPOINTS, keypoint_places, place_keypoints
from hmc.body.kinematics import segment_transforms
from hmc.body.model import BodyModel
from hmc.body.proportions import make_bodies
from hmc.io.recording import Recording
from hmc.io.results import TrackTable
from hmc.landmarks import LANDMARKS
from hmc.pose.keypoint_cues import KeypointCues, with_keypoints
from hmc.pose.objectives.keypoints import BESIDE_M
from hmc.pose.trust import doubt_notes
from hmc.pose.views.keypoints import SeenKeypoints
from hmc.pose.views.line_meeting import MEET
from hmc.pose.views.person_view import PersonView

if TYPE_CHECKING:
    from hmc.pose.follow import PosedPeople

__all__ = ["agreeing_cameras", "with_keypoint_views"]

#: The keypoints that tell of a landmark: both hips of the pelvis, both shoulders of the neck, whatever is seen of the face of the crown.
_TELLING = [
    [BODY_KEYPOINTS.index(name) for name in {"pelvis": ("l_hip", "r_hip"), "neck": ("l_shoulder", "r_shoulder")}.get(landmark, (landmark,))]
    if landmark != "head_top"
    else [k for k, name in enumerate(BODY_KEYPOINTS) if name.endswith(("nose", "ear"))]
    for landmark in LANDMARKS
]


def agreeing_cameras(body: BodyModel, state: np.ndarray, seen: SeenKeypoints) -> np.ndarray:
    """How many cameras have each landmark where a pose has it, by their scatter and what a keypoint may lie beside the joint.

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (37,)
    seen : SeenKeypoints

    Returns
    -------
    ndarray of int, shape (15,)
        In the order of `hmc.landmarks.LANDMARKS`.
    """
    rotations, positions = segment_transforms(body, state)
    missed = seen.missed(place_keypoints(rotations, positions, keypoint_places(body)))
    agrees = np.linalg.norm(missed, axis=1) < MEET * np.hypot(seen.deviation_m, BESIDE_M[seen.keypoint])
    cameras = np.bincount(seen.keypoint[agrees], minlength=len(BODY_KEYPOINTS))
    return np.array(
        [cameras[told].max() if landmark == "head_top" else cameras[told].min() for landmark, told in zip(LANDMARKS, _TELLING, strict=True)]
    )


def with_keypoint_views(people: PosedPeople, recording: Recording, tracks: TrackTable, cues: KeypointCues) -> PosedPeople:
    """Poses with the cameras that agree with each landmark, and a line on every person of whom much is guessed.

    Parameters
    ----------
    people : PosedPeople
    recording : Recording
    tracks : TrackTable
        By which the people were followed.
    cues : KeypointCues
    """
    bodies = make_bodies(people.states.bodies)
    views = np.zeros((len(people.frames), len(LANDMARKS)))
    for frame in np.unique(people.frames).tolist():
        rows = np.flatnonzero(people.frames == frame)
        persons = people.persons[rows].tolist()
        shown = with_keypoints({person: PersonView(frame) for person in persons}, recording.rig, tracks, cues)
        for row, person in zip(rows.tolist(), persons, strict=True):
            seen, state = shown[person].keypoints, people.states.states[row]
            if seen is not None and np.isfinite(state).all():
                views[row] = agreeing_cameras(bodies[person], state, seen)
    poses = replace(people.poses, views=views)
    return replace(people, poses=poses, notes=(*people.notes, *doubt_notes(poses)))
