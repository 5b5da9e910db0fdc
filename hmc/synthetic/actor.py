"""Actors: people whose skin is a smooth closed mesh that bends with a skeleton."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import sparse
from scipy.spatial.transform import Rotation

from hmc.errors import InputError
from hmc.synthetic.clothes import Clothes, dress
from hmc.synthetic.physique import body_sweeps, girth_of
from hmc.synthetic.skeleton import BONE_NAMES, PosedSkeleton, Skeleton, joint_positions, make_skeleton
from hmc.synthetic.surface import Sweep, distances, mesh_of

__all__ = ["PARTS", "Actor", "bind_orientations", "make_actor", "pose_mesh"]

#: Body parts that a surface point can belong to, and the bones of each.
PARTS: dict[str, tuple[str, ...]] = {
    "head": ("neck", "head"),
    "trunk": ("pelvis", "abdomen", "chest", "l_clavicle", "r_clavicle"),
    "l_arm": ("l_upper_arm", "l_forearm", "l_hand"),
    "r_arm": ("r_upper_arm", "r_forearm", "r_hand"),
    "l_leg": ("l_thigh", "l_shank", "l_foot", "l_toes"),
    "r_leg": ("r_thigh", "r_shank", "r_foot", "r_toes"),
}


@dataclass(frozen=True)
class Actor:
    """A person ready to be posed.

    Parameters
    ----------
    skeleton : Skeleton
    vertices, normals : ndarray, shape (n, 3)
        Skin in the pose in which it was modelled, metres.
    triangles : ndarray of int, shape (m, 3)
    weights : csr_matrix, shape (n, n_bones)
        How much each vertex follows each bone; rows sum to one.
    bones : ndarray of int, shape (n,)
        The bone that each vertex belongs to: an index into `BONE_NAMES`.
    parts : ndarray of int, shape (n,)
        The body part of each vertex: an index into the keys of `PARTS`.
    albedo : ndarray, shape (n, 3)
        Linear reflectance, BGR.
    """

    skeleton: Skeleton
    vertices: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray
    weights: sparse.csr_matrix
    bones: np.ndarray
    parts: np.ndarray
    albedo: np.ndarray
    bind_joints: np.ndarray = field(repr=False)
    bind_frames: np.ndarray = field(repr=False)


def bind_orientations() -> np.ndarray:
    """The pose in which skins are modelled: arms half-way down, legs a little apart; shape (n_bones, 3, 3)."""
    frames = np.tile(np.eye(3), (len(BONE_NAMES), 1, 1))
    for side, sign in (("l", 1), ("r", -1)):
        arm = Rotation.from_euler("x", -48 * sign, degrees=True).as_matrix()
        leg = Rotation.from_euler("x", 7 * sign, degrees=True).as_matrix()
        for bones, frame in ((("upper_arm", "forearm", "hand"), arm), (("thigh", "shank"), leg)):
            for bone in bones:
                frames[BONE_NAMES.index(f"{side}_{bone}")] = frame
    return frames


def make_actor(
    height_m: float,
    build: str | float,
    rng: np.random.Generator,
    sex: str = "man",
    clothes: Clothes | None = None,
    cell_m: float = 0.016,
    fists: bool = False,
    longer_left: tuple[float, float] = (0.0, 0.0),
) -> Actor:
    """Model a person.

    Parameters
    ----------
    height_m : float
        Stature, 1.2 to 2.2.
    build : str or float
        A name of `hmc.synthetic.physique.BUILDS` or a number from -1 (thin) to 1 (heavy).
    rng : Generator
        Individual proportions and girths.
    sex : {"man", "woman"}
    clothes : Clothes, optional
    cell_m : float
        Edge length of the mesh, metres; 0.016 gives some 10,000 vertices.
    fists : bool
        Whether the hands are closed.
    longer_left : tuple of (float, float)
        By how much of its length the left arm, and the left leg, is longer than the right one.

    Returns
    -------
    Actor

    Raises
    ------
    InputError
        For a stature, build or sex out of range.
    """
    if not 1.2 <= height_m <= 2.2:
        raise InputError(f"height_m must lie between 1.2 and 2.2; got {height_m}")
    if sex not in ("man", "woman"):
        raise InputError(f"sex must be 'man' or 'woman'; got {sex!r}")
    clothes = clothes or Clothes()
    skeleton = make_skeleton(height_m, sex, rng, longer_left)
    frames = bind_orientations()
    joints = joint_positions(skeleton, np.array([0, 0, skeleton.hip_height]), frames)
    posed = PosedSkeleton(skeleton, joints, frames)
    named = body_sweeps(posed, sex, girth_of(build), clothes.loose_m, clothes.long_hair, rng, fists)
    names, sweeps = [name for name, _ in named], [sweep for _, sweep in named]
    mesh = mesh_of(sweeps, cell_m)
    _, each = distances(sweeps, mesh.vertices)
    nearest = each.argmin(axis=1)
    start = _first_weights(names, sweeps, nearest, mesh.vertices, joints)
    weights = _spread(start, mesh.triangles, steps=round(6 * (0.014 / cell_m) ** 2))
    bones = weights.argmax(axis=1)
    part_of_bone = np.array([next(p for p, members in enumerate(PARTS.values()) if name in members) for name in BONE_NAMES])
    albedo = dress(np.array(names)[nearest], mesh.vertices, posed, clothes, rng)
    return Actor(
        skeleton,
        mesh.vertices,
        mesh.normals,
        mesh.triangles,
        sparse.csr_matrix(weights),
        bones,
        part_of_bone[bones],
        albedo,
        joints,
        frames,
    )


def _first_weights(names: list[str], sweeps: list[Sweep], nearest: np.ndarray, vertices: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """Every vertex to the bone of its nearest sweep; the trunk's are shared out by height."""
    weights = np.zeros((len(vertices), len(BONE_NAMES)))
    weights[np.arange(len(vertices)), np.array([sweep.bone for sweep in sweeps])[nearest]] = 1
    trunk = np.array([name == "trunk" for name in names])[nearest]
    pelvis, abdomen, chest = (BONE_NAMES.index(name) for name in ("pelvis", "abdomen", "chest"))
    z = vertices[trunk, 2]
    reach = 0.05
    to_abdomen = np.clip((z - joints[abdomen, 2] + reach) / (2 * reach), 0, 1)
    to_chest = np.clip((z - joints[chest, 2] + reach) / (2 * reach), 0, 1)
    weights[trunk] = 0
    weights[trunk, pelvis] = 1 - to_abdomen
    weights[trunk, abdomen] = to_abdomen - to_chest
    weights[trunk, chest] = to_chest
    return weights


def _spread(weights: np.ndarray, triangles: np.ndarray, steps: int) -> np.ndarray:
    """Diffuse weights over the mesh, so that they change smoothly across joints and never jump across air."""
    n = len(weights)
    rows, columns = np.concatenate([triangles, triangles[:, [1, 2, 0]], triangles[:, [2, 0, 1]]])[:, :2].T
    neighbours = sparse.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n))
    neighbours = neighbours.maximum(neighbours.T) + sparse.identity(n)
    average = sparse.diags(1 / np.asarray(neighbours.sum(axis=1)).ravel()) @ neighbours
    for _ in range(steps):
        weights = average @ weights
    # Elbows and knees bend sharply; shoulders, hips and the trunk over a longer stretch.
    wide = weights
    for _ in range(2 * steps):
        wide = average @ wide
    trunk = [BONE_NAMES.index(name) for name in PARTS["trunk"]]
    share = np.clip(3 * wide[:, trunk].sum(axis=1, keepdims=True), 0, 1)
    weights = share * wide + (1 - share) * weights
    weights = np.where(weights < 0.01, 0, weights)
    return weights / weights.sum(axis=1, keepdims=True)


def pose_mesh(actor: Actor, root: np.ndarray, orientations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The skin in a pose, by linear blend skinning.

    Parameters
    ----------
    actor : Actor
    root : ndarray, shape (3,)
        Position of the pelvis, world, metres.
    orientations : ndarray, shape (n_bones, 3, 3)
        World from bone.

    Returns
    -------
    vertices, normals : ndarray, shape (n, 3)
        World, metres; triangles are `actor.triangles`.
    """
    turn = orientations @ actor.bind_frames.transpose(0, 2, 1)
    joints = joint_positions(actor.skeleton, root, orientations)
    shift = joints - np.einsum("bij,bj->bi", turn, actor.bind_joints)
    blended = actor.weights @ np.concatenate([turn.reshape(-1, 9), shift], axis=1)
    matrices = blended[:, :9].reshape(-1, 3, 3)
    vertices = np.einsum("nij,nj->ni", matrices, actor.vertices) + blended[:, 9:]
    normals = np.einsum("nij,nj->ni", matrices, actor.normals)
    return vertices, normals / np.linalg.norm(normals, axis=1, keepdims=True)
