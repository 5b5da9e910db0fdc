"""The moments of a page that show more than poses: every camera's image with the people drawn in, and the voxels of the hull."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import cv2
import numpy as np

from hmc.camera.model import Camera
from hmc.io.masks import MaskStep
from hmc.io.recording import Frame, Recording, iterate_frames
from hmc.view.mosaic import Result, draw_people, people_in
from hmc.view.page.packed import pack
from hmc.view.scene import shading
from hmc.voxels.carving import shared_tables
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import FrontendSettings, carve_step, stream_masks
from hmc.voxels.surface import surface

__all__ = ["moments_of", "shown_moments"]

#: Moments at most, and images of all cameras together.
MOST_MOMENTS, MOST_IMAGES = 30, 240
#: The longer side of an image, pixels, and its quality as JPEG.
IMAGE_PX, QUALITY = 400, 76
#: Voxels of a moment at most: of more, every second is shown and so on.
MOST_VOXELS = 9_000

Report = Callable[[str], None] | None


def shown_moments(frames: np.ndarray, n_cameras: int) -> list[int]:
    """The frames of which a page has images and voxels, evenly spread over those it shows.

    Parameters
    ----------
    frames : ndarray of int, shape (n,)
    n_cameras : int
    """
    most = min(len(frames), MOST_MOMENTS, max(4, MOST_IMAGES // n_cameras))
    return frames[np.unique(np.linspace(0, len(frames) - 1, most).round().astype(int))].tolist()


def moments_of(
    recording: Recording, result: Result, wanted: list[int], voxel_size_m: float | None, outlines: bool, on_problem: Report
) -> Iterator[dict[str, Any] | None]:
    """Go through the recording once; of every frame a moment, or None where none is wanted.

    Parameters
    ----------
    recording : Recording
    result : Result
        Its silhouettes are used where the run kept them; else they are made.
    wanted : list of int
        Absolute frame numbers, rising.
    voxel_size_m : float or None
        None: no voxels, and nothing is segmented.
    outlines : bool
        Draw the outline of the flesh into the images.
    on_problem : callable, optional

    Yields
    ------
    dict or None
        ``frame``, ``images`` (data URIs or None, one a camera), and, with voxels, ``voxels`` (n, 3) and ``shades`` (n,), packed.
    """
    grid = None if voxel_size_m is None else VoxelGrid.from_room(recording.room, voxel_size_m, len(recording.rig))
    tables, settings = None if grid is None else shared_tables(grid, recording.rig), FrontendSettings()
    chosen = frozenset(wanted)
    for frame, step in _frames(recording, result, chosen, grid is not None, on_problem):
        if frame.index not in chosen:
            yield None
            continue
        people, masks = people_in(result, frame.index), step.masks if step is not None else frame.silhouettes or (None,) * len(frame.images)
        images = [
            _image(camera, image, mask, people, outlines) for camera, image, mask in zip(recording.rig, frame.images, masks, strict=True)
        ]
        moment: dict[str, Any] = {"frame": frame.index, "images": images}
        if grid is not None and tables is not None and step is not None:
            moment |= _voxels(carve_step(tables, step, settings).strict)
        yield moment


def _frames(
    recording: Recording, result: Result, chosen: frozenset[int], masks: bool, on_problem: Report
) -> Iterator[tuple[Frame, MaskStep | None]]:
    """All frames of the selection up to the last that is wanted, with silhouettes where these are."""
    first, last, kept = recording.start, max(chosen) + 1, result.silhouettes
    if masks and (kept is None or kept.missing(recording)):
        for made in stream_masks(recording, last=last, on_problem=on_problem):
            yield Frame(made.index, made.images, None), made
        return
    for frame in iterate_frames(recording, first, last, on_problem):
        steps: Iterable[MaskStep] = kept.steps(recording, [frame.index]) if masks and kept is not None and frame.index in chosen else ()
        yield frame, next(iter(steps), None)


def _image(camera: Camera, image: np.ndarray | None, mask: np.ndarray | None, people: list, outlines: bool) -> str | None:
    """A camera's image, small, with the people drawn in, as a data URI; of silhouettes alone these in grey."""
    if image is None and mask is not None:
        image = np.repeat(mask[..., None].astype(np.uint8) * 110, 3, axis=2)
    if image is None:
        return None
    small = camera.scaled(min(1.0, IMAGE_PX / max(camera.size)))
    picture = cv2.resize(image, small.size, interpolation=cv2.INTER_AREA)
    draw_people(picture, small, people, outlines)
    data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()
    return "data:image/jpeg;base64," + base64.b64encode(data).decode("ascii")


def _voxels(occupied: np.ndarray) -> dict[str, Any]:
    """The surface of a hull, with how light its voxels are."""
    indices = surface(occupied)
    indices = indices[:: max(1, -(-len(indices) // MOST_VOXELS))]
    if not len(indices):
        return {}
    shades = (255 * shading(occupied, indices)).astype(np.uint8)
    return {"voxels": pack(indices.astype(np.uint16)), "shades": pack(shades)}
