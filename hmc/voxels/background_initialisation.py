"""Recordings without frames of the empty scene: what is learnt from images with people in them, and what must be told from frame to frame.

The scene behind people who move about in place comes back bit by bit (`hmc.camera.empty_scene`). A place that a person hardly ever leaves
does not: there, no difference from the scene tells when a person is in it. So in every frame people are cut out by their colors as well,
in small images, and the silhouettes take that over where the scene was never seen.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np

from hmc.camera.empty_scene import add_bodies, cut_again, cut_samples, replace_people, scenes_behind, shrunk
from hmc.camera.model import Rig
from hmc.camera.people_cut import PeopleColors, View, cut_people, disc
from hmc.camera.segmentation import BackgroundModel, SegmentationSettings, train_background
from hmc.camera.shade import floor_pixels
from hmc.camera.standing import Standing
from hmc.camera.standing_cut import around
from hmc.errors import InputError
from hmc.io.recording import Recording, iterate_frames, whole_recording
from hmc.voxels.agreement import agreed_views
from hmc.voxels.carving import CarvingTables, make_tables
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.known_bodies import known_hulls, places_at_times
from hmc.voxels.still_people import StillPerson, cut_still_people, find_still_people

__all__ = ["UnseenPlaces", "learn_from_people", "with_unseen_places"]

#: Bytes that the images of which the scene is made may fill, and the fewest of them.
SAMPLE_BYTES = 400e6
FEWEST_SAMPLES = 9
#: Longer side of the images on which people are told from the scene, pixels, and the voxels in which cameras agree on them, metres.
SMALL_PX = 320
COARSE_M = 0.05
#: Who moves on the spot is no further from it than this, metres, limbs and all.
REACH_M = 0.6
#: Width of the seam between what differs from the scene and what was cut out, pixels of an image whose longer side is 320.
SEAM_PX = 2.5


@dataclass(frozen=True)
class UnseenPlaces:
    """What tells people where the scene was never seen.

    Attributes
    ----------
    cameras : tuple of int
        Those without frames of the empty scene; the other entries are in their order.
    tables : CarvingTables
        Of coarse voxels, and of the cameras made small.
    unseen : tuple of ndarray of bool, shape (height, width)
        In full size.
    small_unseen : tuple of ndarray of bool
        The same in the size of the small cameras.
    asked : tuple of ndarray of bool
        Pixels of the small cameras that make out those of full size where the scene is unseen.
    colors : tuple of PeopleColors or None
    still : tuple of StillPerson
        People who were there all the time and hardly moved (`hmc.voxels.still_people`).
    doubted : tuple of Standing
        Places at which a person seemed to stand, but of which the views do not show one body.
    """

    cameras: tuple[int, ...]
    tables: CarvingTables
    unseen: tuple[np.ndarray, ...]
    small_unseen: tuple[np.ndarray, ...]
    asked: tuple[np.ndarray, ...]
    colors: tuple[PeopleColors | None, ...]
    still: tuple[StillPerson, ...] = ()
    doubted: tuple[Standing, ...] = ()


def learn_from_people(
    recording: Recording, cameras: Sequence[int], settings: SegmentationSettings, n_samples: int, span: int, pool: Executor | None = None
) -> tuple[dict[int, BackgroundModel], UnseenPlaces]:
    """Models of the empty scene from frames with people in them.

    Parameters
    ----------
    recording : Recording
    cameras : sequence of int
    settings : SegmentationSettings
    n_samples, span : int
        Images of each camera to learn from, and the number of frames, around the selection, over which they are spread.
    pool : concurrent.futures.Executor, optional
        Threads to spread the cameras over; the result does not depend on it.

    Returns
    -------
    models : dict from camera to BackgroundModel
    places : UnseenPlaces

    Raises
    ------
    InputError
        When a camera has no readable image.
    """
    samples = _samples(recording, cameras, n_samples, span)
    rig = Rig(tuple(recording.rig[c].scaled(min(1.0, SMALL_PX / max(recording.rig[c].size))) for c in cameras))
    tables = make_tables(VoxelGrid.from_room(recording.room, COARSE_M, len(rig)), rig)
    views = partial(agreed_views, tables)
    small = shrunk(samples, [camera.size for camera in rig])
    people = cut_samples(small, views, pool)
    at_times = places_at_times(tables.grid, known_hulls(tables, people.masks))
    if at_times:
        regions = [np.logical_or.reduce([around(camera, place, REACH_M) for place in at_times]) for camera in rig]
        people = cut_again(small, people, regions, views, pool)
    still, doubted = find_still_people(tables, small, people.masks)
    if still:
        bodies = [[cut_still_people(still, c, image) for c, image in enumerate(frame)] for frame in small]
        people = add_bodies(small, people, bodies, views, pool)
    scenes = scenes_behind(samples, people, pool)
    models = {}
    for i, c in enumerate(cameras):
        # Each image is let go once it is learnt from: large ones and the growing models would not fit side by side.
        images = (replace_people(image, scenes[i].image) for image in _take(samples, i) if image is not None)
        floor = floor_pixels(recording.rig.cameras[c], recording.room)
        models[c] = train_background(images, settings, scenes[i].unseen, floor, recording.factors[c])
    unseen = tuple(scene.unseen for scene in scenes)
    small_unseen = tuple(_resize(mask, camera.size) for mask, camera in zip(unseen, rig, strict=True))
    asked = tuple(_asked(mask, camera.size) for mask, camera in zip(unseen, rig, strict=True))
    colors = tuple(scene.colors for scene in scenes)
    return models, UnseenPlaces(tuple(cameras), tables, unseen, small_unseen, asked, colors, still, doubted)


def with_unseen_places(
    places: UnseenPlaces, images: Sequence[np.ndarray | None], masks: Sequence[np.ndarray | None], pool: Executor | None = None
) -> tuple[np.ndarray | None, ...]:
    """One frame's silhouettes, with the people who are where the scene was never seen.

    Parameters
    ----------
    places : UnseenPlaces
    images : sequence of ndarray of uint8, shape (height, width, 3), or None; one a camera
    masks : sequence of ndarray of bool, shape (height, width), or None; one a camera
        Differences from the scene, as far as it was seen.
    pool : concurrent.futures.Executor, optional

    Returns
    -------
    tuple of ndarray of bool, shape (height, width), or None; one a camera
    """
    sizes = [camera.size for camera in places.tables.rig]
    unseen = places.small_unseen
    given = [masks[c] for c in places.cameras]
    differs = [None if mask is None else _resize(mask, size) for mask, size in zip(given, sizes, strict=True)]
    maybe = [None if differ is None else differ | hidden for differ, hidden in zip(differs, unseen, strict=True)]
    surely, possibly, below = agreed_views(places.tables, maybe)

    def complete(i: int) -> np.ndarray | None:
        image, mask = images[places.cameras[i]], given[i]
        differ, sure, possible, under, colors = differs[i], surely[i], possibly[i], below[i], places.colors[i]
        if image is None or mask is None or differ is None or sure is None or possible is None or under is None or colors is None:
            return mask
        small = cv2.resize(image, sizes[i], interpolation=cv2.INTER_AREA)
        hidden, differ, changed = unseen[i], differ & ~unseen[i], differ & unseen[i]
        body = cut_still_people(places.still, i, small)
        if body is not None:
            hidden, differ = hidden & ~body, differ | body
        people = cut_people(View(small, differ, sure, possible, hidden, under, changed), colors, places.asked[i])
        if body is not None:
            people |= body & possible
        whole = np.where(places.unseen[i], _resize(people, mask.shape[::-1]), mask)
        # The two meet in a seam.
        return cv2.morphologyEx(whole.view(np.uint8), cv2.MORPH_CLOSE, disc(whole, SEAM_PX)).view(bool)

    done = list(map(complete, range(len(sizes))) if pool is None else pool.map(complete, range(len(sizes))))
    result = list(masks)
    for c, mask in zip(places.cameras, done, strict=True):
        result[c] = mask
    return tuple(result)


def _asked(mask: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Pixels of a smaller image that a mask has a part in, and those beside them, which count where it is made large again."""
    part = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0
    return cv2.dilate(part.view(np.uint8), np.ones((3, 3), np.uint8)).view(bool)


def _resize(mask: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """The mask made smaller or larger, its outline smooth."""
    way = cv2.INTER_AREA if size[0] < mask.shape[1] else cv2.INTER_LINEAR
    return cv2.resize(mask.view(np.uint8) * np.uint8(255), size, interpolation=way) > 127


def _samples(recording: Recording, cameras: Sequence[int], n_samples: int, span: int) -> list[list[np.ndarray | None]]:
    """Some frames' images of some cameras, spread over the recording around the selection."""
    whole = whole_recording(recording)
    frame_bytes = sum(3 * width * height for width, height in (recording.rig[c].size for c in cameras))
    n_samples = int(np.clip(SAMPLE_BYTES // frame_bytes, FEWEST_SAMPLES, n_samples))
    first = max(0, recording.start + recording.n_frames // 2 - span // 2)
    last = min(first + span, whole.n_frames)
    wanted = set(np.unique(np.linspace(first, last - 1, n_samples).round().astype(int)).tolist())
    frames = iterate_frames(whole, first, last, on_problem=lambda line: None, only=wanted)  # the run itself reports what it cannot read
    samples = [[frame.images[c] for c in cameras] for frame in frames]
    for c, images in zip(cameras, zip(*samples, strict=True), strict=True):
        if all(image is None for image in images):
            raise InputError(f"{recording.path}: camera '{recording.rig[c].name}' has no readable image; leave it out: --cameras")
    return samples


def _take(samples: list[list[np.ndarray | None]], camera: int) -> Iterator[np.ndarray | None]:
    """A camera's images, taken out of the samples one by one."""
    for frame in samples:
        image, frame[camera] = frame[camera], None
        yield image
