"""Numbers of a calibration that no ordinary rig has: what can be lived with, but is mostly a slip."""

from __future__ import annotations

import itertools

import numpy as np

from hmc.camera.model import Camera, Rig, undistort

__all__ = ["odd_cameras"]

#: Cameras that are nearer to each other are the same calibration twice, mostly; metres.
ONE_PLACE_M = 0.05
#: A camera that is so many times further from the world's origin than others has its place in another unit.
FAR_TIMES = 50.0
#: So many cameras that are turned alike (entries of their rotations differ by less) have none in their calibration, mostly.
LEAST_ALIKE, ALIKE = 3, 0.01


def odd_cameras(rig: Rig) -> list[str]:
    """A sentence for everything that is odd.

    Parameters
    ----------
    rig : Rig
        In metres, with z up.
    """
    return [*itertools.chain.from_iterable(_odd_camera(camera) for camera in rig), *_same_place(rig), *_far_away(rig), *_one_way(rig)]


def _odd_camera(camera: Camera) -> list[str]:
    """Sentences about numbers that no ordinary camera has."""
    sentences = []
    width, height = camera.size
    fx, fy = camera.matrix[0, 0], camera.matrix[1, 1]
    if not 0.8 < fx / fy < 1.25:
        sentences.append(f"camera '{camera.name}': focal lengths {fx:.0f} and {fy:.0f} differ by more than a quarter")
    if not 0.15 < fx / max(width, height) < 20:
        sentences.append(f"camera '{camera.name}': a focal length of {fx:.0f} does not fit {width} x {height} pixels; is `size` right?")
    offset = np.abs(camera.matrix[:2, 2] / camera.size - 0.5).max()
    if offset > 0.3:
        u, v = camera.matrix[:2, 2]
        sentences.append(f"camera '{camera.name}': its optical centre ({u:.0f}, {v:.0f}) is far from the middle of {width} x {height}")
    edges = np.array([[0, height / 2], [width - 1, height / 2], [width / 2, 0], [width / 2, height - 1]])
    if np.linalg.norm(undistort(camera, edges), axis=1).max() > 0.97 * camera.max_radius:
        sentences.append(f"camera '{camera.name}': its lens distortion folds over inside the image; calibrate with points near the border")
    if camera.centre[2] < -0.2:
        sentences.append(f"camera '{camera.name}' stands {-camera.centre[2]:.1f} m under the floor; z must point up, with the floor at 0")
    return sentences


def _same_place(rig: Rig) -> list[str]:
    return [
        f"cameras '{one.name}' and '{other.name}' stand in one place; is one calibration in the file twice?"
        for one, other in itertools.combinations(rig, 2)
        if np.linalg.norm(one.centre - other.centre) < ONE_PLACE_M
    ]


def _far_away(rig: Rig) -> list[str]:
    distances = np.linalg.norm(rig.centres, axis=1)
    usual = float(np.median(distances))
    return [
        f"camera '{camera.name}' stands {distance:,.0f} m from the origin and the others {usual:.1f}; is its place in another unit?"
        for camera, distance in zip(rig, distances.tolist(), strict=True)
        if distance > FAR_TIMES * max(usual, 1.0)
    ]


def _one_way(rig: Rig) -> list[str]:
    rotations = np.array([camera.rotation for camera in rig])
    if len(rig) < LEAST_ALIKE or np.ptp(rotations, axis=0).max() > ALIKE:
        return []
    return ["all cameras look into one direction; has the calibration no rotations?"]
