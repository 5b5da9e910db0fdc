"""Moving bodies as binary glTF (.glb): a node a segment that carries its flesh, turned over time; metres, y up, facing z. No gaps.

Source: Khronos Group, glTF 2.0 Specification, sections 3 (concepts), 4 (GLB), and 3.11 (animations).
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from hmc.io.export.axes import FACING_Z
from hmc.io.export.joint_tree import JointTree, local_rotations
from hmc.io.files import atomic_write

__all__ = ["Mesh", "MovingBody", "write_glb"]

_FLOAT, _UINT32 = 5126, 5125
_VERTICES, _INDICES = 34962, 34963


@dataclass(frozen=True)
class Mesh:
    """A surface of triangles in a segment's frame.

    Parameters
    ----------
    vertices, normals : ndarray, shape (n, 3)
        Metres, and unit vectors outwards.
    triangles : ndarray of int, shape (m, 3)
        Counter-clockwise from outside.
    """

    vertices: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray


@dataclass(frozen=True)
class MovingBody:
    """A person over time.

    Parameters
    ----------
    name : str
    tree : JointTree
    times_s : ndarray, shape (n,)
        Rising.
    states : ndarray, shape (n, n_dof)
        Without gaps.
    meshes : dict
        Of each segment, by its place; those without one are left out.
    color : tuple of float
        Red, green, blue, in [0, 1].
    """

    name: str
    tree: JointTree
    times_s: np.ndarray
    states: np.ndarray
    meshes: dict[int, Mesh]
    color: tuple[float, float, float]


@dataclass
class _Parts:
    """What a file is made of while it grows."""

    data: bytearray = field(default_factory=bytearray)
    views: list[dict] = field(default_factory=list)
    accessors: list[dict] = field(default_factory=list)
    nodes: list[dict] = field(default_factory=list)
    meshes: list[dict] = field(default_factory=list)
    materials: list[dict] = field(default_factory=list)
    samplers: list[dict] = field(default_factory=list)
    channels: list[dict] = field(default_factory=list)

    def add(self, values: np.ndarray, kind: str, target: int | None = None) -> int:
        """Put an array into the buffer; the number of its accessor."""
        whole = values.dtype.kind in "iu"
        stored = np.ascontiguousarray(values, "<u4" if whole else "<f4")
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self.data), "byteLength": stored.nbytes}
        self.views.append(view if target is None else view | {"target": target})
        self.data += stored.tobytes()
        rows = stored.reshape(len(stored), -1)
        bounds = {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        component = _UINT32 if whole else _FLOAT
        self.accessors.append({"bufferView": len(self.views) - 1, "componentType": component, "count": len(stored), "type": kind} | bounds)
        return len(self.accessors) - 1


def write_glb(path: str | Path, bodies: Sequence[MovingBody]) -> None:
    """Write all persons into one file, with one animation.

    Parameters
    ----------
    path : path
    bodies : sequence of MovingBody
        At least one.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    parts = _Parts()
    roots = [_add_body(parts, body) for body in bodies]
    content = {
        "asset": {"version": "2.0", "generator": "hmc", "extras": {"units": "metres", "axes": "y up, z forward at rest, x to the left"}},
        "scene": 0,
        "scenes": [{"nodes": roots}],
        "nodes": parts.nodes,
        "meshes": parts.meshes,
        "materials": parts.materials,
        "animations": [{"name": "motion", "samplers": parts.samplers, "channels": parts.channels}],
        "accessors": parts.accessors,
        "bufferViews": parts.views,
        "buffers": [{"byteLength": len(parts.data)}],
    }
    text = json.dumps({name: value for name, value in content.items() if value != []}, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    data = bytes(parts.data) + b"\0" * (-len(parts.data) % 4)
    with atomic_write(path, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(data)))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", len(data), b"BIN\0") + data)


def _add_body(parts: _Parts, body: MovingBody) -> int:
    """Nodes, meshes and channels of one person; the number of the root's node."""
    tree, first, names = body.tree, len(parts.nodes), body.tree.joint_names()
    parts.materials.append({"name": body.name, "pbrMetallicRoughness": {"baseColorFactor": [*body.color, 1.0], "metallicFactor": 0.0}})
    material, times = len(parts.materials) - 1, parts.add(body.times_s, "SCALAR")
    for place, joint in enumerate(tree.joints):
        node: dict[str, Any] = {"name": f"{body.name}:{names[place]}", "translation": (FACING_Z @ joint.offset).tolist()}
        children = [first + k for k, other in enumerate(tree.joints) if other.parent == place]
        if children:
            node["children"] = children
        if place in body.meshes:
            node["mesh"] = _add_mesh(parts, body.meshes[place], material, node["name"])
        parts.nodes.append(node)
        turned = Rotation.from_matrix(FACING_Z @ local_rotations(joint, body.states).as_matrix() @ FACING_Z.T).as_quat()
        # Neighbors on the same half of the sphere, as viewers turn from one to the next by the shorter way anyhow.
        turned *= np.where(np.cumsum(np.r_[False, (turned[1:] * turned[:-1]).sum(axis=1) < 0]) % 2, -1.0, 1.0)[:, None]
        _add_channel(parts, first + place, "rotation", times, parts.add(turned, "VEC4"))
    _add_channel(parts, first, "translation", times, parts.add(body.states[:, :3] @ FACING_Z.T, "VEC3"))
    for name, (place, offset) in tree.tips().items():
        parts.nodes.append({"name": f"{body.name}:{name}", "translation": (FACING_Z @ offset).tolist()})
        parts.nodes[first + place].setdefault("children", []).append(len(parts.nodes) - 1)
    return first


def _add_channel(parts: _Parts, node: int, what: str, times: int, values: int) -> None:
    parts.samplers.append({"input": times, "output": values, "interpolation": "LINEAR"})
    parts.channels.append({"sampler": len(parts.samplers) - 1, "target": {"node": node, "path": what}})


def _add_mesh(parts: _Parts, mesh: Mesh, material: int, name: str) -> int:
    attributes = {
        "POSITION": parts.add(mesh.vertices @ FACING_Z.T, "VEC3", _VERTICES),
        "NORMAL": parts.add(mesh.normals @ FACING_Z.T, "VEC3", _VERTICES),
    }
    indices = parts.add(mesh.triangles.ravel(), "SCALAR", _INDICES)
    parts.meshes.append({"name": name, "primitives": [{"attributes": attributes, "indices": indices, "material": material}]})
    return len(parts.meshes) - 1
