"""Some moments of a trial as small pictures: the fitted bodies over two cameras' images, cropped round the people."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from hmc.camera.coverage import in_view
from hmc.camera.model import Camera, project
from hmc.io.camera_turns import as_posed
from hmc.io.files import atomic_write
from hmc.io.recording import Recording, iterate_frames, only_cameras, spread_frames
from hmc.view.mosaic import Person, Result, draw_people, people_in
from hmc.view.overlay import draw_label
from hmc.view.scene import BACKGROUND

__all__ = ["MOMENTS", "choose_cameras", "draw_moment", "moments_of", "write_moments"]

#: Pictures a trial, and the size of one camera's part of each, (width, height) in pixels.
MOMENTS, CELL = 6, (270, 330)
#: How much larger than the people a picture is, and the most that an image is enlarged.
AROUND, MAX_SCALE = 1.35, 6.0
#: Smallest side of what is shown, pixels of the image.
LEAST_PX = 30.0
QUALITY = 85


def moments_of(result: Result) -> list[int]:
    """Frames with a pose, evenly spread; none where there is no pose."""
    if result.poses is None:
        return []
    known = np.isfinite(result.poses.positions).all(axis=(1, 2))
    frames = np.unique(result.poses.frames[known])
    return spread_frames(frames, MOMENTS) if len(frames) else []


def write_moments(folder: Path, recording: Recording, result: Result) -> None:
    """Write a picture of every moment, named by its frame, in place of all that the folder holds.

    Parameters
    ----------
    folder : Path
    recording : Recording
    result : Result
    """
    if folder.is_dir():
        shutil.rmtree(folder)
    frames = moments_of(result)
    if not frames:
        return
    recording = as_posed(recording, result.turned)
    people = {frame: [one for one in people_in(result, frame) if one.landmarks is not None] for frame in frames}
    shown = only_cameras(recording, choose_cameras(recording, list(people.values())))
    for frame in frames:
        read = next(iterate_frames(shown, frame, frame + 1, lambda line: None))
        images = read.images if shown.has_images else [_as_image(mask) for mask in read.silhouettes or ()]
        cells = [draw_moment(image, camera, people[frame]) for camera, image in zip(shown.rig, images, strict=True)]
        with atomic_write(folder / f"{frame:06d}.jpg", "wb") as file:
            file.write(cv2.imencode(".jpg", np.concatenate(cells), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes())


def choose_cameras(recording: Recording, people: Sequence[Sequence[Person]]) -> list[int]:
    """The camera that shows most of the people, largest, and one that shows nearly as much from another side."""
    points = np.concatenate([one.landmarks for moment in people for one in moment if one.landmarks is not None])
    points = points[np.isfinite(points).all(axis=1)]
    middle = points.mean(axis=0)
    shown = np.array([in_view(camera, points).mean() for camera in recording.rig])
    away = np.array([camera.centre - middle for camera in recording.rig])
    size = np.array([camera.matrix[0, 0] for camera in recording.rig]) / np.linalg.norm(away, axis=1)
    worth = shown**4 * np.sqrt(size / size.max())
    first = int(np.argmax(worth))
    if len(recording.rig) == 1:
        return [first]
    flat = away[:, :2] / np.maximum(np.linalg.norm(away[:, :2], axis=1, keepdims=True), 1e-9)
    across = np.abs(flat[:, 0] * flat[first, 1] - flat[:, 1] * flat[first, 0])
    other = worth * (0.1 + across)
    other[first] = -1.0
    return [first, int(np.argmax(other))]


def draw_moment(image: np.ndarray | None, camera: Camera, people: Sequence[Person]) -> np.ndarray:
    """The part of an image in which people are, with their bodies drawn in.

    Parameters
    ----------
    image : ndarray, shape (h, w, 3), uint8, or None
    camera : Camera
    people : sequence of Person
        With landmarks.

    Returns
    -------
    ndarray, shape (CELL[1], CELL[0], 3), uint8
    """
    uv, valid = project(camera, np.concatenate([one.landmarks for one in people if one.landmarks is not None]))
    uv = uv[valid & np.isfinite(uv).all(axis=-1)]
    low, high = (uv.min(axis=0), uv.max(axis=0)) if len(uv) else (np.zeros(2), np.array(camera.size, float))
    low, high = np.clip(low, 0, camera.size), np.clip(high, 0, camera.size)
    side = np.maximum(high - low, LEAST_PX) * AROUND
    factor = float(min((np.array(CELL) / side).min(), MAX_SCALE))
    small = camera.scaled(factor)
    picture: np.ndarray = np.full((*small.size[::-1], 3), 60, np.uint8)
    if image is not None:
        picture = cv2.resize(image, small.size, interpolation=cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC)
    draw_people(picture, small, list(people), outlines=True)
    left, top = np.round((low + high) / 2 * factor - np.array(CELL) / 2).astype(int)
    cell = np.full((CELL[1], CELL[0], 3), BACKGROUND, np.uint8)
    rows = slice(max(0, top), max(0, min(small.size[1], top + CELL[1])))
    columns = slice(max(0, left), max(0, min(small.size[0], left + CELL[0])))
    part = picture[rows, columns]
    y, x = max(0, -top), max(0, -left)
    cell[y : y + part.shape[0], x : x + part.shape[1]] = part
    draw_label(cell, camera.name if image is not None else f"{camera.name}: no image", (6, CELL[1] - 8))
    return cell


def _as_image(mask: np.ndarray | None) -> np.ndarray | None:
    return None if mask is None else np.repeat(mask[..., None].astype(np.uint8) * 110, 3, axis=2)
