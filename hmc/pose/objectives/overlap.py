"""Double occupancy, estimated: how much of each body part lies inside other parts (Canton 2009, Eq. 6.12 and 6.14).

`hmc.pose.objectives.overlap_exact` counts voxels. Here some points of each piece of the body are tested against the others:
the volume that two pieces share is the same seen from either, so each pair is tested once, with the points of the smaller,
and only in the particles in which the two come near each other. All pairs and particles go through one pass. Where one piece
hangs on the other, the volume comes from a table.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.flesh import FleshTable
from hmc.body.model import PARTS, BodyModel
from hmc.pose.objectives.overlap_joints import JointTable, joint_volumes, make_joint_table
from hmc.pose.objectives.overlap_pieces import Pieces, make_pieces, place_pieces, shared_volume
from hmc.pose.objectives.overlap_screen import near_pieces

__all__ = ["OverlapTable", "make_overlap_table", "quick_overlap"]

#: Points tested a piece: more hardly raise the correlation with the exact count, .99 over a first layer's particles.
TEST_POINTS = 16


@dataclass(frozen=True)
class OverlapTable:
    """What `quick_overlap` needs of a body.

    Parameters
    ----------
    pieces : Pieces
    pairs : ndarray of int, shape (n_pairs, 2)
        Pieces of different parts that do not share a joint, the smaller first; in order.
    joints : JointTable
        For those that do.
    joint_shares : ndarray of float32, shape (n_parts, n_joints)
        From volumes shared at the joints to fractions of the parts.
    """

    pieces: Pieces
    pairs: np.ndarray
    joints: JointTable
    joint_shares: np.ndarray


def make_overlap_table(body: BodyModel, flesh: FleshTable, test_points: int = TEST_POINTS) -> OverlapTable:
    """Divide the body into pieces and choose their test points; once a body.

    Parameters
    ----------
    body : BodyModel
    flesh : FleshTable
        For the volumes of the parts, and for its spacing: a point counts in full from half a voxel inside a piece.
    test_points : int
        How many points a piece.
    """
    pieces = make_pieces(body, flesh, test_points)
    rank = np.argsort(np.argsort(pieces.volume, kind="stable"))
    first, second = np.nonzero((rank[:, None] < rank) & (pieces.part[:, None] != pieces.part))
    apart = (pieces.hangs_on[first] != second) & (pieces.hangs_on[second] != first)
    joints = make_joint_table(body, pieces)
    shares = np.zeros((len(PARTS), len(joints.hanging)), np.float32)
    for piece in (joints.hanging, joints.holding):
        part = pieces.part[piece]
        shares[part, np.arange(len(part))] = 1 / pieces.part_volume[part]
    return OverlapTable(pieces, np.stack([first[apart], second[apart]], axis=1), joints, shares)


def quick_overlap(table: OverlapTable, placed: np.ndarray) -> np.ndarray:
    """Estimate of the fraction of each part inside other parts.

    Parameters
    ----------
    table : OverlapTable
    placed : ndarray of float32, shape (16, 3, 4, n)
        From `hmc.body.kinematics.place_segments`.

    Returns
    -------
    ndarray of float32, shape (n, n_parts)
    """
    pieces, n = table.pieces, placed.shape[-1]
    frames = place_pieces(pieces, placed)
    shares = table.joint_shares @ joint_volumes(table.joints, frames)
    first, second, particle = near_pieces(pieces, table.pairs, frames)
    one, other = (_frames_at(frames, piece, particle) for piece in (first, second))
    volume = shared_volume(pieces, pieces.points, first, second, one, other)
    for piece in (first, second):
        part = pieces.part[piece]
        shares += np.bincount(part * n + particle, volume / pieces.part_volume[part], shares.size).reshape(shares.shape)
    return np.minimum(shares, 1, out=shares).T


def _frames_at(frames: np.ndarray, piece: np.ndarray, particle: np.ndarray) -> np.ndarray:
    """The frames of some pieces in some particles, shape (3, 4, t)."""
    n = frames.shape[-1]
    rows = np.arange(12)[:, None] * n
    return frames.reshape(-1).take(rows + (piece * (12 * n) + particle)).reshape(3, 4, -1)
