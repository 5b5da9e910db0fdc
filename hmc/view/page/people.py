"""What a page holds of the people of a result: landmarks, flesh, angles, costs and ways, frame by frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from hmc.body.flesh import surface_samples
from hmc.body.joints import N_DOF
from hmc.body.kinematics import segment_transforms
from hmc.body.model import BodyModel
from hmc.view.mosaic import Result
from hmc.view.overlay import person_color
from hmc.view.page.packed import pack, pack_fixed

__all__ = ["chosen_frames", "page_people"]

#: Rows of people at most, so that the page stays small; of longer results every second frame is shown, or every third and so on.
MOST_ROWS = 10_000
#: Points around each end of a cone of the flesh.
RING = 12
#: Steps of lengths, metres; of ring points, metres; of angles, degrees; of quaternions.
LENGTH_M, RING_M, ANGLE_DEG, QUATERNION = 1e-3, 1e-4, 0.01, 1 / 32767
#: Of bytes of trust and of views: it is not known.
UNKNOWN = 255


def chosen_frames(result: Result, start: int, n_frames: int) -> np.ndarray:
    """The frames that a page shows, rising: all of a selection, or every second and so on where there are too many rows of people."""
    inside = [
        int(((table.frames >= start) & (table.frames < start + n_frames)).sum())
        for table in (result.poses, result.tracks)
        if table is not None
    ]
    stride = max(1, -(-max(max(inside, default=0), n_frames // 4) // MOST_ROWS))
    return np.arange(start, start + n_frames, stride)


def page_people(result: Result, frames: np.ndarray) -> list[dict[str, Any]]:
    """Everybody, by number, each with arrays over the frames that are shown.

    Parameters
    ----------
    result : Result
    frames : ndarray of int, shape (n,)
        Rising.

    Returns
    -------
    list of dict
        ``number``, ``color``, and, as far as they are known, packed (`hmc.view.page.packed`): ``landmarks`` (n, 15, 3), ``views`` (n, 15),
        ``trust`` (n, 15) in 200ths, ``way`` (n, 3), ``rings`` (n_cones, 24, 3) with ``segments`` (n_cones), ``turns`` (n, 14, 4) and
        ``places`` (n, 14, 3) of the segments, ``angles`` (n, 30) in degrees, ``costs`` (n).
    """
    tables = [table for table in (result.poses, result.tracks) if table is not None]
    inside = [table.persons[np.isin(table.frames, frames)] for table in tables]
    return [_person(result, frames, int(number)) for number in np.unique(np.concatenate(inside))]


def _person(result: Result, frames: np.ndarray, number: int) -> dict[str, Any]:
    blue, green, red = person_color(number)
    out: dict[str, Any] = {"number": number, "color": f"#{red:02x}{green:02x}{blue:02x}"}
    poses, tracks = result.poses, result.tracks
    if tracks is not None:
        out["way"] = pack_fixed(_over(tracks, frames, number, tracks.positions), LENGTH_M)
    if poses is None:
        return out
    out["landmarks"] = pack_fixed(_over(poses, frames, number, poses.positions), LENGTH_M)
    if poses.views is not None:
        out["views"] = pack(_bytes(_over(poses, frames, number, poses.views)))
    if poses.trust is not None:
        out["trust"] = pack(_bytes(200 * np.clip(_over(poses, frames, number, poses.trust), 0, 1)))
    if result.states is not None:
        states = result.states
        values = _over(states, frames, number, states.states)
        out["angles"] = pack_fixed(np.degrees(values[:, 3:]), ANGLE_DEG)
        if states.costs is not None:
            out["costs"] = pack(_over(states, frames, number, states.costs[:, None])[:, 0].astype(np.float32))
        body = (result.bodies or {}).get(number)
        if body is not None and values.shape[1] == N_DOF:
            out |= _flesh(body, values)
    return out


def _over(table, frames: np.ndarray, number: int, values: np.ndarray) -> np.ndarray:
    """A person's values at the frames that are shown; NaN where there are none."""
    out = np.full((len(frames), *values.shape[1:]), np.nan)
    rows = np.flatnonzero((table.persons == number) & np.isin(table.frames, frames))
    out[np.searchsorted(frames, table.frames[rows])] = values[rows]
    return out


def _bytes(values: np.ndarray) -> np.ndarray:
    """Small numbers as bytes, `UNKNOWN` for NaN."""
    return np.where(np.isnan(values), UNKNOWN, np.clip(np.nan_to_num(values), 0, UNKNOWN - 1).round()).astype(np.uint8)


def _flesh(body: BodyModel, states: np.ndarray) -> dict[str, Any]:
    """The rings around the ends of the body's cones, once, and how its segments lie in every frame."""
    n = len(body.cones.segment)
    along = np.tile(np.repeat([0.0, 1.0], RING), n)
    angle = np.tile(np.arange(RING) * 2 * np.pi / RING, 2 * n)
    rings = surface_samples(body, (np.repeat(np.arange(n), 2 * RING), along, angle)).points.reshape(n, 2 * RING, 3)
    rotations, places = segment_transforms(body, np.nan_to_num(states))
    # A limb whose angles are not known moves nothing of what it hangs on; what hangs on it is not known either.
    lost = np.isnan(segment_transforms(body, states)[0]).any(axis=(-2, -1))
    turns = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat().reshape(*rotations.shape[:2], 4)
    places = np.where(lost[..., None], np.nan, places)
    return {
        "rings": pack_fixed(rings, RING_M),
        "segments": pack(body.cones.segment.astype(np.uint8)),
        "turns": pack_fixed(turns, QUATERNION),
        "places": pack_fixed(places, LENGTH_M),
    }
