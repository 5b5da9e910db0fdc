"""Angles of a person at rest: the one place where they stand.

Three poses, each with its own use; their numbers decide results, so none stands in for another. Angles are given of the right side: turns
about X and Z are mirrored on the left, turns about Y are not.
"""

from __future__ import annotations

from types import MappingProxyType

__all__ = ["HANGING_DEG", "RELAXED_DEG", "SWARM_DEG"]


def _both_sides(right: dict[str, float], trunk: dict[str, float] | None = None) -> MappingProxyType[str, float]:
    angles = dict(trunk or {})
    for name, degrees in right.items():
        angles[f"r_{name}"] = float(degrees)
        angles[f"l_{name}"] = float(degrees if name.endswith("_y") else -degrees)
    return MappingProxyType(angles)


#: Hanging arms (`hmc.body.model.neutral_state`), on which the templates of a first pose are laid and from which inverse kinematics start:
#: all else is zero, so that templates differ in what they name alone.
HANGING_DEG = _both_sides({"shoulder_x": 80, "elbow_z": 15})
#: The middle of what people commonly do (`hmc.body.prior.POSTURE`): the arms a little farther out and more bent, the trunk leaning forward,
#: the knees not locked, because a prior is pulled to both sides.
RELAXED_DEG = _both_sides({"shoulder_x": 75, "elbow_z": 25, "knee_y": 8}, {"torso_y": 5.0})
#: Where the swarms of the skeleton on a trunk's axis begin (`hmc.pose.steps.swarm`): hanging arms, and knees off their limit, at which a
#: particle that is put back has no velocity.
SWARM_DEG = _both_sides({"shoulder_x": 80, "elbow_z": 15, "knee_y": 5})
