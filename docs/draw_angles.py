"""Draw `docs/images/angles.png`: which way a body goes when each clinical angle grows.

    python docs/draw_angles.py

Grey: the pose before. In color: the same with one angle larger, by the number of degrees in the title, as `hmc.motion.clinical` measures it
on the drawn landmarks.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from hmc.body.joints import dof_index
from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.landmarks import BONES, landmark_index
from hmc.motion.clinical import clinical_angles

OUT = Path(__file__).parent / "images" / "angles.png"
SEEN = {"front": "seen from the front", "right": "seen from the right", "top": "seen from above"}
COLORS = {"l": "tab:orange", "r": "tab:blue"}

#: Angle, from where it is seen, degrees of freedom of the pose before, and what is added to them.
PANELS = (
    ("pelvis_rotation", "top", {}, {"root_rz": 30}),
    ("pelvis_obliquity", "front", {}, {"root_rx": 20}),
    ("trunk_flexion", "right", {}, {"torso_y": 30}),
    ("trunk_lateral_flexion", "front", {}, {"torso_x": 30}),
    ("trunk_rotation", "top", {}, {"torso_z": 30}),
    ("r_hip_flexion", "right", {}, {"r_hip_y": -30}),
    ("r_hip_adduction", "front", {}, {"r_hip_x": 20}),
    ("r_hip_internal_rotation", "front", {"r_knee_y": 80}, {"r_hip_z": 30}),
    ("r_knee_flexion", "right", {}, {"r_knee_y": 60}),
    ("r_shoulder_plane_of_elevation", "top", {}, {"r_shoulder_z": 60}),
    ("r_shoulder_elevation", "front", {"r_shoulder_x": 60}, {"r_shoulder_x": -60}),
    ("r_shoulder_internal_rotation", "right", {"r_elbow_z": 90}, {"r_shoulder_y": 40}),
    ("r_elbow_flexion", "top", {}, {"r_elbow_z": 60}),
)  # fmt: skip


def pose(degrees: dict[str, float]) -> np.ndarray:
    """Landmarks, shape (15, 3), of the body with these angles and the others at 0: upright, arms sideways, facing x."""
    state = np.zeros_like(neutral_state("down"))
    for name, value in degrees.items():
        state[dof_index(name)[0]] = np.radians(value)
    return landmarks(default_body(1.75), state[None])[0]


def flat(points: np.ndarray, view: str) -> np.ndarray:
    """Where points are in the picture, shape (15, 2): from the front and from above left is right of the middle, from the right x is."""
    across = {"front": points[:, 1], "right": points[:, 0], "top": -points[:, 1]}[view]
    return np.column_stack([across, points[:, 0] if view == "top" else points[:, 2]])


def main() -> None:
    """Draw all panels."""
    figure, axes = plt.subplots(3, 5, figsize=(13, 8.6), layout="constrained")
    for ax in axes.flat:
        ax.set_axis_off()
    for ax, (name, view, before, added) in zip(axes.flat, PANELS, strict=False):
        after = {key: before.get(key, 0) + added.get(key, 0) for key in before | added}
        values = [clinical_angles(pose(one)[None])[f"{name}_deg"][0] for one in (before, after)]
        for degrees, strong in ((before, False), (after, True)):
            points = flat(pose(degrees), view)
            for a, b in BONES:
                color = COLORS.get(b[0] if b[1] == "_" else "", "0.2") if strong else "0.8"
                ax.plot(
                    *points[[landmark_index(a), landmark_index(b)]].T, color=color, linewidth=3 if strong else 5, solid_capstyle="round"
                )
        ax.set_aspect("equal")
        start = f"{np.round(values[0]) + 0.0:.0f}"
        title = name.removeprefix("r_").replace("_", " ")
        ax.set_title(f"{title}\n{start}° to {values[1]:.0f}°, {SEEN[view]}", fontsize=9)
    axes.flat[len(PANELS)].text(
        0, 0.5, "grey: before\norange: left\nblue: right\n\nfrom above, the\nperson faces up", fontsize=10, va="center"
    )
    figure.savefig(OUT, dpi=80)


if __name__ == "__main__":
    main()
