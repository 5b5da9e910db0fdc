"""The body as an OpenSim model (.osim, version 4): its coordinates are our angles, so that a .mot moves it as it moved here.

Source: OpenSim API documentation, classes CustomJoint and SpatialTransform: a custom joint turns about its three axes one after the
other, each carried along by those before (``R = R_1 R_2 R_3``), as our joints do, and then its child is moved along the parent's axes. A
model has y up and faces x; its z is to the right. Masses are average shares (Winter 2009, table 4.1) of 23 kg/m2 times stature squared:
enough to be shown and moved, not measured.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from hmc.errors import InputError
from hmc.io.door import read_text_file
from hmc.io.export.axes import FACING_X
from hmc.io.export.joint_tree import Joint, JointTree
from hmc.io.files import atomic_write

__all__ = ["refuse_other_model", "write_osim"]

#: What a model of ours says of itself.
_CREDITS = "a body of hmc: see docs/exports.md"

#: Shares of the body's mass by words in a segment's name.
_MASS = {"pelvis": 0.142, "torso": 0.139, "chest": 0.206, "head": 0.081, "clavicle": 0.005, "upper_arm": 0.028, "forearm": 0.022,
         "thigh": 0.100, "shank": 0.0465, "foot": 0.0145}  # fmt: skip
_LEAST_MASS = 0.005
_BODY_MASS_INDEX = 23.0
_STICK_RADIUS_M = 0.012


def refuse_other_model(path: str | Path) -> None:
    """Refuse to write a model in the place of one that is not ours, such as a user's scaled one of the same name.

    Parameters
    ----------
    path : path
        Of the `.osim`.

    Raises
    ------
    InputError
        When there is such a file, or it cannot be read.
    """
    path = Path(path)
    if path.exists() and _CREDITS not in read_text_file(path, guess=True):
        raise InputError(f"{path}: is another model, in whose place the body's would be written; choose another name for the .mot")


def write_osim(path: str | Path, tree: JointTree) -> None:
    """Write the model of one person, with a marker in each named point and a stick along each bone.

    Parameters
    ----------
    path : path
    tree : JointTree

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    path = Path(path)
    document = ET.Element("OpenSimDocument", Version="40000")
    model = ET.SubElement(document, "Model", name=path.stem)
    _texts(model, credits=_CREDITS, length_units="meters", force_units="N", gravity="0 -9.80665 0")
    ET.SubElement(model, "Ground", name="ground")
    bodies, joints, markers = (
        ET.SubElement(ET.SubElement(model, kind, name=kind.lower()), "objects") for kind in ("BodySet", "JointSet", "MarkerSet")
    )
    for place, joint in enumerate(tree.joints):
        _add_body(bodies, tree, place)
        _add_joint(joints, tree, joint)
    for name, (place, offset) in tree.points.items():
        marker = ET.SubElement(markers, "Marker", name=name)
        _texts(marker, socket_parent_frame=f"/bodyset/{tree.joints[place].name}", location=_vector(offset), fixed="true")
    ET.indent(document, "\t")
    with atomic_write(path) as file:
        file.write('<?xml version="1.0" encoding="UTF-8" ?>\n' + ET.tostring(document, encoding="unicode") + "\n")


def _add_body(bodies: ET.Element, tree: JointTree, place: int) -> None:
    joint = tree.joints[place]
    body = ET.SubElement(bodies, "Body", name=joint.name)
    ends = [other.offset for other in tree.joints if other.parent == place]
    ends += [offset for carrier, offset in tree.points.values() if carrier == place]
    ends = [end for end in ends if np.linalg.norm(end) > 1e-6]
    parts = ET.SubElement(body, "components") if ends else None
    for number, end in enumerate(ends):
        # A cylinder of OpenSim stands along its frame's y axis.
        length, direction = float(np.linalg.norm(end)), FACING_X @ end / np.linalg.norm(end)
        turn, _ = Rotation.align_vectors(direction[None], [[0.0, 1.0, 0.0]])
        frame = ET.SubElement(parts, "PhysicalOffsetFrame", name=f"bone_{number}")  # type: ignore[arg-type]
        geometry = ET.SubElement(ET.SubElement(frame, "attached_geometry"), "Cylinder", name="stick")
        _texts(geometry, socket_frame="..", radius=f"{_STICK_RADIUS_M}", half_height=f"{length / 2:.6f}")
        _texts(frame, socket_parent=f"/bodyset/{joint.name}", translation=_vector(end / 2), orientation=_row(turn.as_euler("XYZ")))
    share = next((value for word, value in _MASS.items() if word in joint.name), _LEAST_MASS)
    mass = share * _BODY_MASS_INDEX * tree.height_m**2
    size = max([float(np.linalg.norm(end)) for end in ends], default=0.05)
    moment = mass * (size**2 / 12 + 0.05**2)
    middle = np.mean(ends, axis=0) / 2 if ends else np.zeros(3)
    _texts(body, mass=f"{mass:.4f}", mass_center=_vector(middle), inertia=_row([moment] * 3 + [0.0] * 3))


def _add_joint(joints: ET.Element, tree: JointTree, joint: Joint) -> None:
    custom = ET.SubElement(joints, "CustomJoint", name=f"{joint.name}_joint")
    _texts(custom, socket_parent_frame="parent_offset", socket_child_frame="child_offset")
    root = joint.parent < 0
    turns = [(axis, tree.dof_names[dof], dof) for axis, dof in zip(joint.axes, joint.dofs, strict=True)]
    shifts = [(axis, tree.dof_names[dof], dof) for dof, axis in enumerate("xyz")] if root else []
    coordinates = ET.SubElement(custom, "coordinates")
    for _, name, dof in [*turns, *shifts]:
        low, high = (
            bound if np.isfinite(bound) else sign * (10.0 if dof < 3 else 100.0)
            for bound, sign in ((tree.low[dof], -1), (tree.high[dof], 1))
        )
        coordinate = ET.SubElement(coordinates, "Coordinate", name=name)
        _texts(coordinate, default_value="0", range=f"{low:.6f} {high:.6f}", clamped="false", locked="false")
    frames = ET.SubElement(custom, "frames")
    parent = "/ground" if root else f"/bodyset/{tree.joints[joint.parent].name}"
    for name, carrier, offset in (("parent_offset", parent, joint.offset), ("child_offset", f"/bodyset/{joint.name}", np.zeros(3))):
        frame = ET.SubElement(frames, "PhysicalOffsetFrame", name=name)
        _texts(frame, socket_parent=carrier, translation=_vector(offset), orientation="0 0 0")
    transform = ET.SubElement(custom, "SpatialTransform")
    # Axes without a coordinate are there too, as OpenSim wants three of each, and no two along one line.
    spare = [axis for axis in "xyz" if axis not in joint.axes]
    for kind, used in (("rotation", turns), ("translation", shifts)):
        free = spare if kind == "rotation" else [axis for axis in "xyz" if not root]
        for number in range(3):
            axis, name = (used[number][0], used[number][1]) if number < len(used) else (free[number - len(used)], "")
            one = ET.SubElement(transform, "TransformAxis", name=f"{kind}{number + 1}")
            _texts(one, coordinates=name, axis=_vector(np.eye(3)["xyz".index(axis)]))
            if name:
                _texts(ET.SubElement(one, "LinearFunction", name="function"), coefficients="1 0")
            else:
                _texts(ET.SubElement(one, "Constant", name="function"), value="0")


def _texts(parent: ET.Element, **values: str) -> None:
    for name, value in values.items():
        ET.SubElement(parent, name).text = value


def _vector(ours: np.ndarray) -> str:
    """A vector of ours in the model's axes."""
    return _row(FACING_X @ ours)


def _row(values) -> str:
    return " ".join(f"{value + 0.0:.8f}" for value in values)
