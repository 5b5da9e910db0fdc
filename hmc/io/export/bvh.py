"""A moving skeleton as BVH (Biovision): bones of fixed length, centimetres, y up, facing z with the arms sideways at rest.

Every joint has three turns, in the body's own order; axes that a joint lacks are 0, so that the file's angles are ours. The format has no
gaps.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hmc.io.export.axes import FACING_Z
from hmc.io.export.joint_tree import JointTree
from hmc.io.files import atomic_write

__all__ = ["write_bvh"]

#: What our axes are called in the file: x forward is z there, y to the left is x, z up is y.
_AXIS = {"x": "Z", "y": "X", "z": "Y"}
#: Length of what hangs on the last joints, over stature: readers want an end, and bones of no length are not drawn.
_END = 0.05


def write_bvh(path: str | Path, tree: JointTree, states: np.ndarray, fps: float) -> None:
    """Write the motion of one person.

    Parameters
    ----------
    path : path
    tree : JointTree
    states : ndarray, shape (n, n_dof)
        Metres and radians, without gaps.
    fps : float

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    names, tips, columns = tree.joint_names(), tree.tips(), [np.asarray(100 * states[:, :3] @ FACING_Z.T)]
    lines = ["HIERARCHY"]

    def offset(vector: np.ndarray, depth: int) -> str:
        return "\t" * depth + "OFFSET " + " ".join(f"{value:.6f}" for value in 100 * FACING_Z @ vector)

    def open_joint(name: str, vector: np.ndarray, channels: str, depth: int) -> None:
        indent = "\t" * depth
        lines.extend([f"{indent}{'JOINT' if depth else 'ROOT'} {name}", f"{indent}{{", offset(vector, depth + 1)])
        lines.append(f"{indent}\tCHANNELS {channels}")

    def end_site(vector: np.ndarray, depth: int) -> None:
        indent = "\t" * depth
        lines.extend([f"{indent}End Site", f"{indent}{{", offset(vector, depth + 1), f"{indent}}}"])

    def write(place: int, depth: int) -> None:
        joint = tree.joints[place]
        order = joint.axes + "".join(axis for axis in "xyz" if axis not in joint.axes)
        turns = " ".join(f"{_AXIS[axis]}rotation" for axis in order)
        open_joint(names[place], joint.offset, f"3 {turns}" if depth else f"6 Xposition Yposition Zposition {turns}", depth)
        angles = np.zeros((len(states), 3))
        angles[:, : len(joint.dofs)] = np.degrees(states[:, list(joint.dofs)])
        columns.append(angles)
        children = [k for k, other in enumerate(tree.joints) if other.parent == place]
        own = {name: vector for name, (carrier, vector) in tips.items() if carrier == place}
        for child in children:
            write(child, depth + 1)
        for name, vector in own.items():
            open_joint(name, vector, "3 Zrotation Xrotation Yrotation", depth + 1)
            columns.append(np.zeros((len(states), 3)))
            end_site(vector / np.linalg.norm(vector) * _END * tree.height_m, depth + 2)
            lines.append("\t" * (depth + 1) + "}")
        if not children and not own:
            end_site(np.array([0.0, 0.0, _END * tree.height_m]), depth + 1)
        lines.append("\t" * depth + "}")

    write(0, 0)
    values = np.hstack(columns)
    with atomic_write(path) as file:
        file.write("\n".join(lines) + f"\nMOTION\nFrames: {len(states)}\nFrame Time: {1 / fps:.8f}\n")
        file.writelines(" ".join(f"{value:.6f}" for value in row) + "\n" for row in values)
