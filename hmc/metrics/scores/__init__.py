"""Scores of results against truth, as `hmc evaluate` prints them: poses, tracks, angles, constant offsets, and landmarks in images."""

from hmc.metrics.scores.angles import angle_rows
from hmc.metrics.scores.images import evaluate_images, image_landmarks, read_image_landmarks
from hmc.metrics.scores.offsets import OffsetEvaluation, evaluate_offsets
from hmc.metrics.scores.poses import (
    PersonErrors,
    PoseEvaluation,
    evaluate_pose,
)
from hmc.metrics.scores.selection import chosen_frames, chosen_truth
from hmc.metrics.scores.tracks import comparable_tracks, evaluate_tracks, pelvis_tracks

__all__ = [
    "OffsetEvaluation",
    "PersonErrors",
    "PoseEvaluation",
    "angle_rows",
    "chosen_frames",
    "chosen_truth",
    "comparable_tracks",
    "evaluate_images",
    "evaluate_offsets",
    "evaluate_pose",
    "evaluate_tracks",
    "image_landmarks",
    "pelvis_tracks",
    "read_image_landmarks",
]
