"""A detector's keypoints with faults that real detectors have: displaced, left for right, or of somebody else; for a second or half of one.

The faults are made on the detections as they are read. Whose these are is told by the truth, so the fault is of the first person whatever
a method makes of it; in frames without that person's truth there is none. Cameras, moment and size follow from the seed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hmc.camera.model import Camera, project
from hmc.io.keypoints import KEYPOINTS, KeypointSource
from hmc.io.recording import Recording
from hmc.io.results import PoseTable
from hmc.landmarks import LANDMARKS
from hmc.synthetic.keypoints import body_keypoints

__all__ = ["ANOTHER", "DISPLACED", "EXCHANGED", "FAULTS", "NO_FAULT", "Fault", "fault_frames", "with_fault"]

NO_FAULT = ""
DISPLACED = "wrong for a second in two of four cameras"
EXCHANGED = "left and right exchanged for half a second"
ANOTHER = "another person found"
#: Length of the constant offset, pixels of an image whose longer side has 640; and how far beside the other person is, metres.
OFFSET_PX, BESIDE_M = (40.0, 80.0), (1.0, 1.5)
#: A detection farther than this from the true person is of somebody else, metres.
GATE_M = 0.6

_SHARED = [(KEYPOINTS.index(name), k) for k, name in enumerate(LANDMARKS) if name in KEYPOINTS]
_POINTS, _LANDMARKS = (np.array(column) for column in zip(*_SHARED, strict=True))
_MIRRORED = [
    KEYPOINTS.index({"l_": "r_", "r_": "l_"}[name[:2]] + name[2:]) if name[:2] in ("l_", "r_") else k for k, name in enumerate(KEYPOINTS)
]

#: What becomes of one detection, (26, 3): ``(camera, detection, true landmarks (15, 3)) -> detection``.
Spoil = Callable[[Camera, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Fault:
    """A fault of a detector.

    Parameters
    ----------
    seconds : float
        How long it lasts.
    share : float
        Of the cameras that have it, rounded; one at least.
    draw : callable
        ``draw(rng) -> spoil`` of one camera, the same through all frames of the fault.
    """

    seconds: float
    share: float
    draw: Callable[[np.random.Generator], Spoil]


def _displaced(rng: np.random.Generator) -> Spoil:
    """A constant offset, each camera its own."""
    angle, length = rng.uniform(0, 2 * np.pi), rng.uniform(*OFFSET_PX)
    offset = length * np.array([np.cos(angle), np.sin(angle), 0.0])
    return lambda camera, detection, truth: detection + offset * max(camera.size) / 640


def _exchanged(rng: np.random.Generator) -> Spoil:
    return lambda camera, detection, truth: detection[_MIRRORED]


def _another(rng: np.random.Generator) -> Spoil:
    """Somebody who moves alike beside the person, as sure as what was found."""
    angle, distance = rng.uniform(0, 2 * np.pi), rng.uniform(*BESIDE_M)
    beside = distance * np.array([np.cos(angle), np.sin(angle), 0.0])

    def spoil(camera: Camera, detection: np.ndarray, truth: np.ndarray) -> np.ndarray:
        points = body_keypoints(truth) + beside
        uv, valid = project(camera, np.nan_to_num(points))
        seen = valid & np.isfinite(points).all(axis=1) & ((uv > -0.5) & (uv < np.array(camera.size) - 0.5)).all(axis=1)
        other = np.column_stack([uv, detection[:, 2]])
        other[~seen | (detection[:, 2] == 0)] = (np.nan, np.nan, 0.0)
        return other

    return spoil


FAULTS: dict[str, Fault] = {
    DISPLACED: Fault(1.0, 0.5, _displaced),
    EXCHANGED: Fault(0.5, 0.5, _exchanged),
    ANOTHER: Fault(1.0, 1 / 3, _another),
}


def fault_frames(recording: Recording, fault: str, seed: int) -> tuple[int, int]:
    """First frame of a fault and the one after its last; the whole selection where that is no longer than the fault.

    Parameters
    ----------
    recording : Recording
    fault : str
        A key of `FAULTS`.
    seed : int
    """
    length = min(max(1, round(FAULTS[fault].seconds * recording.fps)), recording.n_frames)
    first = recording.start + int(_rng(fault, seed).integers(recording.n_frames - length + 1))
    return first, first + length


def with_fault(source: KeypointSource, recording: Recording, truth: PoseTable, fault: str, seed: int) -> KeypointSource:
    """Keypoints with a fault in the first person's detections; as they are where there is none.

    Parameters
    ----------
    source : KeypointSource
    recording : Recording
        With the source's cameras.
    truth : PoseTable
    fault : str
        `NO_FAULT` or a key of `FAULTS`.
    seed : int
    """
    if fault == NO_FAULT or not len(truth.frames):
        return source
    first, end = fault_frames(recording, fault, seed)
    rng, n = _rng(fault, seed).spawn(1)[0], len(recording.rig)
    chosen = rng.permutation(n)[: max(1, round(FAULTS[fault].share * n))].tolist()
    spoils = {c: FAULTS[fault].draw(rng) for c in chosen}
    own = truth.of(int(truth.persons[0]))
    bodies = {frame: body for frame, body in zip(own.frames.tolist(), own.positions, strict=True) if first <= frame < end}

    def change(index: int, people: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        body = bodies.get(index)
        if body is None:
            return people
        return tuple(_spoilt(spoils[c], recording.rig[c], given, body) if c in spoils else given for c, given in enumerate(people))

    return source.changed(change)


def _spoilt(spoil: Spoil, camera: Camera, people: np.ndarray, body: np.ndarray) -> np.ndarray:
    """The detections of one camera, (n, 26, 3), with the person's spoilt."""
    points = np.nan_to_num(body[_LANDMARKS])
    uv, valid = project(camera, points)
    depth = points @ camera.rotation[2] + camera.translation[2]
    known = np.isfinite(body[_LANDMARKS]).all(axis=1) & valid
    with np.errstate(invalid="ignore"):
        off = np.linalg.norm(people[:, _POINTS, :2] - uv, axis=-1) * depth / camera.matrix[0, 0]
    off = np.where(known & np.isfinite(off), off, np.nan)
    apart = np.array([np.nanmedian(row) if np.isfinite(row).any() else np.inf for row in off])
    if not (apart < GATE_M).any():
        return people
    k, spoilt = int(apart.argmin()), people.copy()
    spoilt[k] = spoil(camera, people[k], body)
    return spoilt if (spoilt[k, :, 2] > 0).any() else np.delete(spoilt, k, axis=0)


def _rng(fault: str, seed: int) -> np.random.Generator:
    """Of the fault and the seed alone: whatever uses the keypoints meets the same fault."""
    return np.random.default_rng([list(FAULTS).index(fault), seed])
