"""Keypoints of a rendered recording as a learnt detector might leave them, for tests and experiments.

It is no measure of any detector: sizes of errors are round numbers in the range of what such detectors show, and what hides a landmark is
told by thin rules (the body is a few capsules, furniture is boxes that the caller names). What has been tried on it has to be tried on
a real detector's keypoints too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from hmc.camera.model import Camera, project
from hmc.errors import InputError
from hmc.io.keypoints import KEYPOINTS, write_openpose
from hmc.io.recording import open_recording
from hmc.io.results import read_joints
from hmc.landmarks import BONES, LANDMARKS, landmark_index

__all__ = ["KeypointNoise", "body_keypoints", "hidden_keypoints", "write_keypoints"]

#: Where a detector's landmark lies from the joint's centre, metres forward, outward and up in the trunk's frame.
OFFSETS_M = {
    "shoulder": (0.0, -0.02, 0.01), "elbow": (0.0, 0.01, 0.0), "hip": (0.0, 0.025, -0.03), "knee": (0.02, 0.0, 0.0),
    "ankle": (0.0, 0.0, 0.01), "wrist": (0.0, 0.0, 0.0),
}  # fmt: skip
#: The face, from the head's middle, and the feet, from the ankle: metres forward, outward (of the nose: left) and up.
FACE_M = {"nose": (0.11, 0.0, 0.0), "eye": (0.09, 0.032, 0.03), "ear": (0.0, 0.075, 0.01)}
FEET_M = {"heel": (-0.05, 0.0, -0.06), "big_toe": (0.16, -0.02, -0.07), "small_toe": (0.13, 0.05, -0.07)}
#: Radius of the capsule around a bone by its further end, metres.
RADII_M = {"neck": 0.12, "head_top": 0.09, "elbow": 0.05, "wrist": 0.04, "knee": 0.07, "ankle": 0.05}
#: A landmark is hidden by what is at least so far before it, metres: its own flesh does not hide it.
CLEARANCE_M = 0.12
STEPS = 40


@dataclass(frozen=True)
class KeypointNoise:
    """Errors of a pretended detector; probabilities are those of one frame and camera.

    Parameters
    ----------
    noise_px : float
        Standard deviation of each coordinate for an image whose longer side has 640 pixels; others in proportion.
    correlation_frames : float
        Frames after which the noise has forgotten itself but for 1/e.
    offset_spread_m : float
        Standard deviation of what a person's landmarks lie off beyond the constant offsets, the same in all frames, metres.
    hidden_factor : float
        How much more noise there is where a landmark is hidden.
    miss_rate, hidden_miss_rate : float
        Probability that a landmark is not given, seen and hidden.
    swap_rate : float
        Probability that left and right are exchanged.
    lost_rate : float
        Probability that a person is not found at all.
    false_rate : float
        Probability that somebody is found who is not there.

    Raises
    ------
    InputError
        When a number is out of its range.
    """

    noise_px: float = 3.0
    correlation_frames: float = 5.0
    offset_spread_m: float = 0.005
    hidden_factor: float = 3.0
    miss_rate: float = 0.01
    hidden_miss_rate: float = 0.2
    swap_rate: float = 0.01
    lost_rate: float = 0.01
    false_rate: float = 0.02

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not value >= 0 or (field.name.endswith("_rate") and value > 1) or not np.isfinite(value):
                raise InputError(f"`{field.name}` must be at least 0, and a rate at most 1; got {value!r}")


def write_keypoints(
    folder: str | Path, rng: np.random.Generator, noise: KeypointNoise | None = None, furniture: np.ndarray | None = None
) -> Path:
    """Write ``keypoints/`` of a recording with truth, as OpenPose's BODY_25; no measure of any detector.

    Every true person is projected with the lens's distortion; a person of whom fewer than 5 points are left in an image is not found
    there.

    Parameters
    ----------
    folder : path
        The recording, with ``truth/joints.csv``.
    rng : numpy.random.Generator
        The same state gives the same files.
    noise : KeypointNoise, optional
    furniture : ndarray, shape (n, 2, 3), optional
        Boxes that hide what is behind them: lower and upper corner, metres.

    Returns
    -------
    Path
        The folder ``keypoints``.

    Raises
    ------
    InputError
        When recording or truth cannot be read, or `furniture` has another shape.
    """
    folder = Path(folder)
    noise = KeypointNoise() if noise is None else noise
    boxes = np.zeros((0, 2, 3)) if furniture is None else np.asarray(furniture, float)
    if boxes.ndim != 3 or boxes.shape[1:] != (2, 3):
        raise InputError(f"`furniture` must be (n, 2, 3), lower and upper corners; got {boxes.shape}")
    recording = open_recording(folder)
    truth = read_joints(folder / "truth" / "joints.csv")
    people = np.unique(truth.persons)
    spread = dict(zip(people, rng.normal(0, noise.offset_spread_m, (len(people), len(KEYPOINTS), 3)), strict=True))
    # One generator a camera: a camera's keypoints do not depend on how many others there are.
    for camera, own in zip(recording.rig, rng.spawn(len(recording.rig)), strict=True):
        drift = {person: _drift(own, noise.correlation_frames) for person in people}
        for frame in range(recording.start, recording.start + recording.n_frames):
            rows = np.flatnonzero(truth.frames == frame)
            bodies = truth.positions[rows]
            found = []
            for row in rows:
                person = truth.persons[row]
                points = body_keypoints(truth.positions[row], spread[person])
                hidden = hidden_keypoints(camera, points, bodies, boxes)
                found.append(_detect(own, camera, points, hidden, next(drift[person]), noise))
            if own.random() < noise.false_rate:
                found.append(_nobody(own, camera))
            kept = [one for one in found if (one[:, 2] > 0).sum() >= 5]
            write_openpose(folder / "keypoints", camera.name, frame, np.array(kept).reshape(-1, len(KEYPOINTS), 3))
    return folder / "keypoints"


def body_keypoints(joints: np.ndarray, spread: np.ndarray | None = None) -> np.ndarray:
    """A detector's landmarks on a body: the joints with constant offsets, and a face and feet that look where the trunk does.

    Parameters
    ----------
    joints : ndarray, shape (15, 3)
        World, metres; NaN where one is not known.
    spread : ndarray, shape (26, 3), optional
        Further offsets in the trunk's frame (forward, left, up), metres.

    Returns
    -------
    ndarray, shape (26, 3)
        In the order of `hmc.io.keypoints.KEYPOINTS`.
    """
    at = {name: joints[landmark_index(name)] for name in LANDMARKS}
    up = _unit(at["neck"] - at["pelvis"])
    across = at["l_shoulder"] - at["r_shoulder"] + at["l_hip"] - at["r_hip"]
    left = _unit(across - (across @ up) * up)
    trunk = np.stack([np.cross(left, up), left, up])
    # Feet stand as the trunk is turned, but level.
    ahead = _unit(trunk[0] * (1, 1, 0)) if np.linalg.norm(trunk[0, :2]) > 1e-3 else trunk[0]
    level = np.stack([ahead, np.cross([0, 0, 1.0], ahead), [0, 0, 1.0]])
    middle = 0.45 * at["neck"] + 0.55 * at["head_top"]
    points = np.empty((len(KEYPOINTS), 3))
    for place, name in enumerate(KEYPOINTS):
        side, _, part = name.partition("_")
        outward = np.array([1.0, -1.0 if side == "r" else 1.0, 1.0])
        part = part if side in ("l", "r") else name
        if part in FACE_M:
            points[place] = middle + (outward * FACE_M[part]) @ trunk
        elif part in FEET_M:
            points[place] = at[f"{side}_ankle"] + (outward * FEET_M[part]) @ level
        elif name == "pelvis":
            points[place] = at["pelvis"] + np.array([0, 0, OFFSETS_M["hip"][2]]) @ trunk
        else:
            points[place] = at[name] + (outward * OFFSETS_M.get(part, (0.0, 0.0, 0.0))) @ trunk
    return points if spread is None else points + spread @ trunk


def hidden_keypoints(camera: Camera, points: np.ndarray, bodies: np.ndarray, furniture: np.ndarray) -> np.ndarray:
    """Which points the camera does not see past bodies and furniture.

    A cheap rule: bodies are capsules around their bones, sampled along the line of sight; what is nearer to the point than 12 cm does
    not count.

    Parameters
    ----------
    camera : Camera
    points : ndarray, shape (n, 3)
    bodies : ndarray, shape (n_people, 15, 3)
        Everybody's joints, the points' owner among them.
    furniture : ndarray, shape (n_boxes, 2, 3)

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    away = camera.centre - points
    distance = np.linalg.norm(away, axis=-1, keepdims=True)
    reach = np.linspace(0, 1, STEPS) * np.maximum(distance - 2 * CLEARANCE_M, 0) + CLEARANCE_M  # (n, STEPS)
    line = points[:, None] + (away / distance)[:, None] * reach[..., None]
    inside = ((line[:, :, None] >= furniture[:, 0]) & (line[:, :, None] <= furniture[:, 1])).all(axis=-1)
    hidden = inside.any(axis=(1, 2))
    # Only within reach of a body can it hide anything: half of the steps are spent on the last 1.5 m.
    reach = np.linspace(0, 1, STEPS) * np.maximum(np.minimum(distance, 1.5) - CLEARANCE_M, 0) + CLEARANCE_M
    near = points[:, None] + (away / distance)[:, None] * reach[..., None]
    for body in bodies:
        for one, other in BONES:
            radius = RADII_M.get(other.removeprefix("l_").removeprefix("r_"))
            if radius is not None:
                a, b = body[landmark_index(one)], body[landmark_index(other)]
                for samples in (line, near):
                    along = np.clip((samples - a) @ (b - a) / max(float((b - a) @ (b - a)), 1e-9), 0, 1)
                    gap = np.linalg.norm(samples - (a + along[..., None] * (b - a)), axis=-1)
                    hidden |= (gap < radius).any(axis=1)
    return hidden


def _detect(
    rng: np.random.Generator, camera: Camera, points: np.ndarray, hidden: np.ndarray, drift: np.ndarray, noise: KeypointNoise
) -> np.ndarray:
    """One person in one image, shape (26, 3); all NaN when not found."""
    uv, valid = project(camera, np.nan_to_num(points))
    scale = noise.noise_px * max(camera.size) / 640
    uv = uv + drift * scale * np.where(hidden, noise.hidden_factor, 1.0)[:, None]
    confidence = np.where(hidden, rng.uniform(0.15, 0.7, len(points)), rng.uniform(0.75, 1.0, len(points)))
    missed = rng.random(len(points)) < np.where(hidden, noise.hidden_miss_rate, noise.miss_rate)
    inside = ((uv > -0.5) & (uv < np.array(camera.size) - 0.5)).all(axis=-1)
    swapped, lost = rng.random(2) < (noise.swap_rate, noise.lost_rate)
    found = np.column_stack([uv, confidence])
    found[missed | ~inside | ~valid | np.isnan(points).any(axis=-1) | lost] = (np.nan, np.nan, 0.0)
    return found[_MIRRORED] if swapped else found


_MIRRORED = [
    KEYPOINTS.index({"l_": "r_", "r_": "l_"}[name[:2]] + name[2:]) if name[:2] in ("l_", "r_") else k for k, name in enumerate(KEYPOINTS)
]


def _nobody(rng: np.random.Generator, camera: Camera) -> np.ndarray:
    """A person who is not there: points about a place, of low confidence."""
    width, height = camera.size
    centre, extent = rng.uniform((0, 0), (width, height)), np.array([0.05, 0.15]) * max(width, height)
    uv = centre + rng.normal(size=(len(KEYPOINTS), 2)) * extent
    found = np.column_stack([uv, rng.uniform(0.1, 0.5, len(KEYPOINTS))])
    found[~((uv > 0) & (uv < (width, height))).all(axis=-1)] = (np.nan, np.nan, 0.0)
    return found


def _drift(rng: np.random.Generator, frames: float) -> Iterator[np.ndarray]:
    """Noise of unit deviation that forgets itself over some frames, (26, 2) at a time."""
    keep = np.exp(-1 / frames) if frames > 0 else 0.0
    now = rng.standard_normal((len(KEYPOINTS), 2))
    while True:
        yield now
        now = keep * now + np.sqrt(1 - keep**2) * rng.standard_normal(now.shape)


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / max(float(np.linalg.norm(vector)), 1e-9)
