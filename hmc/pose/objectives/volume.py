"""How a skeleton lies in a person's voxels: what of the hull it leaves without a limb, and what of it is outside.

Hsiao (2008) compares skeletons with skeleton curves alone (Eq. 3-27).
"""

from __future__ import annotations

import numpy as np

from hmc.body.spin_skeleton import SkeletonModel
from hmc.pose.spectral.volume import FARTHEST_M, BodyVolume

__all__ = ["volume_error"]

#: Half widths over the torso's length: both sides of the torso, then the other segments in the order of
#: `hmc.body.spin_skeleton.SEGMENTS`.
_WIDTHS = np.array([0.22, 0.22, 0.19, 0.10, 0.08, 0.10, 0.08, 0.16, 0.11, 0.16, 0.11])
#: How far out the sides of the torso run: shares of the way to hips and shoulders. So it is wider than deep, and its spin counts.
_HIP_SHARE, _SHOULDER_SHARE = 0.6, 0.35
#: Points of each segment that should be inside, as shares of it: at joints hulls bulge, and a tip may reach out of a thin one.
_SHARES = (0.3, 0.6, 0.9)


def volume_error(model: SkeletonModel, starts: np.ndarray, ends: np.ndarray, volume: BodyVolume) -> np.ndarray:
    """Error of skeletons against the voxels.

    Parameters
    ----------
    model : SkeletonModel
    starts, ends : ndarray, shape (n, 10, 3)
        Of the segments, as from `hmc.body.spin_skeleton.segment_ends`.
    volume : BodyVolume

    Returns
    -------
    ndarray, shape (n,)
        Mean distance of the hull's surface from the nearest segment, less the segment's half width, and mean distance of the segments
        from the hull, added, metres.
    """
    starts, ends = _fleshed(starts, ends)
    # Single precision is enough, near the origin.
    middle = volume.shell.mean(0)
    shell = (volume.shell - middle).astype(np.float32)
    start = (starts - middle).reshape(-1, 3).astype(np.float32)
    along = (ends - starts).reshape(-1, 3).astype(np.float32)
    square = np.maximum((along**2).sum(1), np.float32(1e-9))[:, None]
    # |p - a - t u|^2 with t = (p - a) u / u^2, clipped, by products of matrices: shape (n * segments, m).
    dot = along @ shell.T
    dot -= (along * start).sum(1)[:, None]
    distance = -2 * start @ shell.T
    distance += (start**2).sum(1)[:, None] + (shell**2).sum(1)
    share = np.clip(dot / square, 0, 1)
    dot *= 2
    distance += share * (share * square - dot)
    np.sqrt(np.maximum(distance, 0, out=distance), out=distance)
    distance = distance.reshape(*starts.shape[:2], -1)
    distance -= (model.torso * _WIDTHS + 0.5 * volume.voxel_size_m).astype(np.float32)[:, None]
    bare = np.clip(distance.min(1), 0, FARTHEST_M).mean(1)
    inside = np.concatenate([starts + share * (ends - starts) for share in _SHARES], axis=1)
    place = np.rint((inside - volume.origin) / volume.voxel_size_m).astype(int)
    place = np.clip(place, 0, np.array(volume.outside_m.shape) - 1)
    out = np.minimum(volume.outside_m[place[..., 0], place[..., 1], place[..., 2]], FARTHEST_M).mean(1)
    return bare + out


def _fleshed(starts: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Segments (n, 10, 3) with two for the torso, one a side, (n, 14, 3)."""
    pelvis, neck = starts[:, :1], ends[:, :1]
    hips, shoulders = starts[:, [6, 8]], starts[:, [2, 4]]
    low, high = pelvis + _HIP_SHARE * (hips - pelvis), neck + _SHOULDER_SHARE * (shoulders - neck)
    return np.concatenate([low, starts[:, 1:]], axis=1), np.concatenate([high, ends[:, 1:]], axis=1)
