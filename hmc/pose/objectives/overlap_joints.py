"""Volume that a piece of the body shares with the one on which it hangs.

Parts that share a joint always meet. As limbs are round, their shared volume is a function of the direction of the one in
the frame of the other, so it is looked up in a table over the sphere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.joints import SEGMENTS
from hmc.body.model import BodyModel
from hmc.pose.objectives.overlap_pieces import Pieces, basis, shared_volume, spread_points

__all__ = ["JointTable", "joint_volumes", "make_joint_table"]

#: Points tested for the tables, and nodes along each side of one half of a table at which they are: 4 to 7 degrees apart.
POINTS = 512
NODES = 33
#: Cells along each side that are filled in between, so that the nearest is near enough.
CELLS = 128


@dataclass(frozen=True)
class JointTable:
    """Shared volumes of ``n`` pairs of pieces over the direction of the first.

    Parameters
    ----------
    hanging, holding : ndarray of int, shape (n,)
        Pieces.
    volumes : ndarray of float32, shape (n, 2, CELLS, CELLS)
        Cubic metres, over the stereographic maps of the two halves of the sphere (third coordinate positive; negative).
    """

    hanging: np.ndarray
    holding: np.ndarray
    volumes: np.ndarray


def make_joint_table(body: BodyModel, pieces: Pieces) -> JointTable:
    """Fill the tables; once a body.

    Parameters
    ----------
    body : BodyModel
    pieces : Pieces
    """
    hanging = np.flatnonzero(pieces.hangs_on >= 0)
    holding = pieces.hangs_on[hanging]
    nodes = np.linspace(-1, 1, NODES)
    x, y = np.meshgrid(nodes, nodes, indexing="ij")
    between = np.stack([np.interp((np.arange(CELLS) + 0.5) * 2 / CELLS - 1, nodes, node) for node in np.eye(NODES)], axis=1)
    # The inverse of x / (1 + |z|), which goes on smoothly beyond the rim, where no direction falls.
    upper = np.stack([2 * x, 2 * y, 1 - x * x - y * y], axis=-1).reshape(-1, 3)
    directions = np.concatenate([upper, upper * (1, 1, -1)])
    volumes = np.empty((len(hanging), 2, CELLS, CELLS), np.float32)
    dense = np.stack([spread_points(body.cones, run, frame, POINTS) for run, frame in zip(pieces.cones, pieces.frame, strict=True)])
    for row, (i, j) in enumerate(zip(hanging, holding, strict=True)):
        turn = pieces.frame[j, :3, :3]  # to the holding piece's frame
        one = np.empty((3, 4, len(directions)), np.float32)
        one[:, :3] = basis(directions, turn @ pieces.frame[i, 0, :3]).transpose(2, 1, 0)
        joint = turn @ (_joint(body, pieces.segment[i], pieces.segment[j]) - pieces.frame[j, 3, :3])
        one[:, 3] = joint[:, None] + np.einsum("xrn,r->xn", one[:, :3], pieces.frame[i, :3, :3] @ pieces.frame[i, 3, :3])
        other = np.broadcast_to(np.eye(3, 4, dtype=np.float32)[:, :, None], one.shape)
        first, second = (np.full(len(directions), piece) for piece in (i, j))
        volumes[row] = between @ shared_volume(pieces, dense, first, second, one, other).reshape(2, NODES, NODES) @ between.T
    return JointTable(hanging, holding, volumes)


def _joint(body: BodyModel, segment: int, holder: int) -> np.ndarray:
    """A segment's joint in the frame of one that carries it, (3,), metres; what is between, and has no flesh, is at rest."""
    joint = np.zeros(3)
    while segment != holder:
        joint += body.offsets[segment]
        segment = SEGMENTS[segment].parent
    return joint


def joint_volumes(table: JointTable, frames: np.ndarray) -> np.ndarray:
    """Volume shared across each joint, cubic metres, that of the nearest entry in the table.

    Parameters
    ----------
    table : JointTable
    frames : ndarray of float32, shape (k, 3, 4, n)
        From `hmc.pose.objectives.overlap_pieces.place_pieces`.

    Returns
    -------
    ndarray of float32, shape (n_joints, n)
    """
    holding = frames[table.holding]
    holding *= frames[:, :, 2, None][table.hanging]
    direction = holding[:, 0, :3]
    direction += holding[:, 1, :3]
    direction += holding[:, 2, :3]
    size = np.abs(direction[:, 2])
    size += np.float32(1.00001)  # a little more than 1: the rim itself stays inside the last cell
    across = direction[:, :2] / size[:, None]
    across += 1
    across *= np.float32(CELLS / 2)
    cell = across.astype(np.int32)
    place = cell[:, 0] * CELLS
    place += cell[:, 1]
    place += (direction[:, 2] < 0) * np.int32(CELLS * CELLS)
    place += (np.arange(len(place)) * (2 * CELLS * CELLS)).astype(np.int32)[:, None]
    return table.volumes.ravel().take(place)
