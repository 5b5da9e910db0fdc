"""One picture a frame: every camera's image with the people drawn in, and the room in 3-D, or from above where there are tracks alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
from scipy.ndimage import uniform_filter1d

from hmc.body.joints import DOF_NAMES, N_CANTON, N_DOF
from hmc.body.model import BodyModel
from hmc.body.proportions import make_bodies
from hmc.camera.model import Camera
from hmc.errors import InputError
from hmc.io.camera_turns import read_turns
from hmc.io.keypoints import KeypointSource
from hmc.io.masks import MaskStep
from hmc.io.recording import Frame, Recording, iterate_frames
from hmc.io.results import PoseStates, PoseTable, TrackTable, no_table, read_joints, read_pose, read_tracks
from hmc.io.silhouettes import KeptSilhouettes, open_silhouettes
from hmc.landmarks import landmark_index
from hmc.view.overlay import LEFT, RIGHT, draw_keypoints, draw_label, draw_outline, draw_paths, draw_sticks, draw_track, person_color
from hmc.view.scene import BACKGROUND, draw_floor, draw_rig, draw_voxels, from_above, viewpoint
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import HullStep, stream_hulls

__all__ = [
    "Layout",
    "Person",
    "Result",
    "make_layout",
    "people_in",
    "read_result",
    "render",
    "run_silhouettes",
    "stream_mosaics",
    "with_bodies",
]

#: Largest picture, (width, height) in pixels, and the most that a camera's image is enlarged.
MAX_SIZE = (1920, 1080)
MAX_SCALE = 2.0
#: How far around the people the 3-D panel looks, metres.
PANEL_MARGIN_M = 0.2
PANEL_HEIGHT_M = 1.9
#: Frames on either side over which the panel's movement is smoothed.
FOLLOW_FRAMES = 20
#: Frames of a person's way that the 3-D panel shows on the floor.
TRAIL_FRAMES = 60


@dataclass(frozen=True)
class Person:
    """What is known of a person in one frame; None where it is not."""

    number: int
    landmarks: np.ndarray | None = None
    position: np.ndarray | None = None
    state: np.ndarray | None = None
    body: BodyModel | None = None
    doubtful: np.ndarray | None = None


@dataclass(frozen=True)
class Result:
    """A result as far as it was written: poses, tracks, states with the bodies, the run's silhouettes, cameras that it turned back."""

    poses: PoseTable | None = None
    tracks: TrackTable | None = None
    states: PoseStates | None = None
    bodies: Mapping[int, BodyModel] | None = None
    silhouettes: KeptSilhouettes | None = None
    turned: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def frames(self) -> np.ndarray:
        """Frame numbers in which there is a person, in order."""
        return np.unique(np.concatenate([table.frames for table in (self.poses, self.tracks) if table is not None]))


@dataclass(frozen=True)
class Layout:
    """Where the pictures go: cells of one size, row by row, the panel in what is left of the last row."""

    columns: int
    rows: int
    cell: tuple[int, int]
    panel: tuple[int, int, int, int]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the whole, even numbers, as video wants them."""
        width, height = self.columns * self.cell[0], self.rows * self.cell[1]
        return width + width % 2, height + height % 2


def read_result(directory: str | Path) -> Result:
    """Read what there is of `joints.csv`, `tracks.csv` and `pose.npz`, and of cameras that were turned back.

    Raises
    ------
    InputError
        When there is neither of the tables.
    """
    directory = Path(directory)
    poses = read_joints(directory / "joints.csv") if (directory / "joints.csv").exists() else None
    tracks = read_tracks(directory / "tracks.csv") if (directory / "tracks.csv").exists() else None
    if poses is None and tracks is None:
        raise no_table(directory)
    states = read_pose(directory / "pose.npz") if (directory / "pose.npz").exists() else None
    result = Result(poses, tracks, silhouettes=open_silhouettes(directory), turned=read_turns(directory))
    if states is not None and N_CANTON <= len(states.dof_names) < N_DOF and states.dof_names == DOF_NAMES[: len(states.dof_names)]:
        # Of before the trunk bent, or the ankles did: their joints, which come last, are at 0.
        states = replace(states, dof_names=DOF_NAMES, states=np.pad(states.states, ((0, 0), (0, N_DOF - len(states.dof_names)))))
    if states is None or states.dof_names != DOF_NAMES:
        return result
    try:
        return with_bodies(result, states)
    except InputError as error:
        raise InputError(f"{directory / 'pose.npz'}: {error}") from None


def with_bodies(result: Result, states: PoseStates) -> Result:
    """A result with its states and the bodies that they are of, so that flesh can be drawn."""
    bodies = make_bodies(states.bodies)
    return replace(result, states=states, bodies=bodies)


def people_in(result: Result, frame: int) -> list[Person]:
    """All persons in a frame, by number."""
    poses, tracks, states = (
        {} if table is None else {int(table.persons[row]): row for row in np.flatnonzero(table.frames == frame)}
        for table in (result.poses, result.tracks, result.states)
    )
    people, doubtful = [], None if result.poses is None else result.poses.doubtful
    for number in sorted(set(poses) | set(tracks)):
        points = result.poses.positions[poses[number]] if result.poses is not None and number in poses else None
        if points is not None and np.isnan(points).all():
            points = None  # there, but not fitted; then the state means nothing either
        fitted = points is not None and result.states is not None and number in states
        people.append(
            Person(
                number=number,
                landmarks=points,
                position=result.tracks.positions[tracks[number]] if result.tracks is not None and number in tracks else None,
                state=result.states.states[states[number]] if fitted and result.states is not None else None,
                body=(result.bodies or {}).get(number),
                doubtful=None if points is None or doubtful is None else doubtful[poses[number]],
            )
        )
    return people


def make_layout(sizes: Iterable[tuple[int, int]], max_size: tuple[int, int] = MAX_SIZE) -> Layout:
    """The grid in which cameras of given (width, height) and a panel come out largest."""
    sizes = list(sizes)
    width, height = max(w for w, _ in sizes), max(h for _, h in sizes)
    n = len(sizes)

    def fit(columns: int) -> tuple[float, int, float]:
        rows = math.ceil((n + 1) / columns)
        scale = min(MAX_SCALE, max_size[0] / (columns * width), max_size[1] / (rows * height))
        shape = columns * width * max_size[1] / (rows * height * max_size[0])
        return round(scale, 6), -rows * columns, -max(shape, 1 / shape)  # as large as can be, no cells to spare, most like the screen

    columns = max(range(1, n + 2), key=fit)
    scale = fit(columns)[0]
    rows = math.ceil((n + 1) / columns)
    cell = max(1, int(width * scale)), max(1, int(height * scale))
    left, top = n % columns * cell[0], n // columns * cell[1]
    return Layout(columns, rows, cell, (left, top, columns * cell[0] - left, rows * cell[1] - top))


def render(
    layout: Layout,
    recording: Recording,
    frame: Frame | HullStep,
    people: list[Person],
    panel: np.ndarray,
    outlines: bool = True,
    keypoints: Sequence[np.ndarray] | None = None,
) -> np.ndarray:
    """Draw one mosaic.

    Parameters
    ----------
    layout : Layout
    recording : Recording
    frame : Frame or HullStep
        Its images.
    people : list of Person
    panel : ndarray, shape (h, w, 3), uint8
        The 3-D panel, people and all.
    outlines : bool
        Draw the flesh too, where it is known.
    keypoints : sequence of ndarray, shape (n_people, 26, 3), optional
        What a 2-D detector found, an array a camera.

    Returns
    -------
    ndarray, shape (height, width, 3), uint8
    """
    width, height = layout.size
    out = np.full((height, width, 3), BACKGROUND, np.uint8)
    cell_width, cell_height = layout.cell
    silhouettes = getattr(frame, "silhouettes", None) or getattr(frame, "masks", None) or (None,) * len(recording.rig)
    for k, (camera, image, mask) in enumerate(zip(recording.rig, frame.images, silhouettes, strict=True)):
        row, column = divmod(k, layout.columns)
        factor = min(cell_width / camera.size[0], cell_height / camera.size[1])
        small = camera.scaled(factor)
        if image is None and mask is not None and not recording.has_images:
            image = np.repeat(mask[..., None].astype(np.uint8) * 110, 3, axis=2)
        known = image is not None
        picture = (
            cv2.resize(image, small.size, interpolation=cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR)
            if image is not None
            else np.full((*small.size[::-1], 3), 60, np.uint8)
        )
        draw_people(picture, small, people if known else [], outlines)
        if keypoints is not None and known:
            draw_keypoints(picture, _shrunk(keypoints[k], camera, small))
        draw_label(picture, camera.name if known else f"{camera.name}: no image", (8, 18))
        y, x = row * cell_height + (cell_height - small.size[1]) // 2, column * cell_width + (cell_width - small.size[0]) // 2
        out[y : y + small.size[1], x : x + small.size[0]] = picture[: height - y, : width - x]
    left, top = layout.panel[:2]
    out[top : top + panel.shape[0], left : left + panel.shape[1]] = panel
    return out


def _shrunk(points: np.ndarray, camera: Camera, small: Camera) -> np.ndarray:
    """Keypoints, (n, 26, 3), in pixels of the image as it is drawn; the first pixel's centre is half a pixel inside."""
    uv = (points[..., :2] + 0.5) * (np.array(small.size) / camera.size) - 0.5
    return np.concatenate([uv, points[..., 2:]], axis=-1)


def draw_people(image: np.ndarray, camera: Camera, people: list[Person], outlines: bool) -> None:
    """Draw all persons: outlines first, sticks over them; a person without a pose as an ellipsoid."""
    width = float(np.clip(min(camera.size) / 160, 1.5, 3.0))
    for person in people:
        if outlines and person.body is not None and person.state is not None:
            draw_outline(image, camera, person.body, person.state, person.number)
    for person in people:
        if person.landmarks is not None:
            draw_sticks(image, camera, person.landmarks, person.number, width, person.doubtful)
        elif person.position is not None:
            draw_track(image, camera, person.position, person.number, width)
    for person in people:
        _draw_number(image, camera, person)


def stream_mosaics(
    recording: Recording,
    result: Result,
    *,
    first: int | None = None,
    last: int | None = None,
    voxel_size_m: float | None = 0.04,
    outlines: bool = True,
    keypoints: KeypointSource | None = None,
    on_problem: Callable[[str], None] | None = None,
) -> Iterator[tuple[int, np.ndarray]]:
    """A mosaic of every selected frame, in order; memory does not grow with their number.

    Parameters
    ----------
    recording : Recording
    result : Result
    first, last : int, optional
        Absolute frame numbers; `last` is not included.
    voxel_size_m : float, optional
        Of the voxels in the panel; None draws none, and then nothing is segmented.
    outlines : bool
        Draw the flesh too, where it is known.
    keypoints : KeypointSource, optional
        What a 2-D detector found, drawn over the people.
    on_problem : callable, optional
        Called with one line for everything that was survived.

    Yields
    ------
    frame : int
    mosaic : ndarray, shape (height, width, 3), uint8
    """
    layout = make_layout(camera.size for camera in recording.rig)
    frames: Iterator[Frame | HullStep]
    if voxel_size_m is None:
        grid = None
        frames = iterate_frames(recording, first, last, on_problem)
    else:
        grid = VoxelGrid.from_room(recording.room, voxel_size_m, len(recording.rig))
        masks = run_silhouettes(recording, result, first, last, on_problem)
        frames = stream_hulls(recording, grid, first=first, last=last, masks=masks, on_problem=on_problem)
    view_of = panel_views(result, recording.room, layout.panel[2:])
    for frame in frames:
        camera = view_of(frame.index)
        panel = np.full((*camera.size[::-1], 3), BACKGROUND, np.uint8)
        draw_floor(panel, camera, recording.room)
        draw_rig(panel, camera, recording.rig)
        draw_trails(panel, camera, result, frame.index)
        if grid is not None and isinstance(frame, HullStep):
            draw_voxels(panel, camera, grid, frame.strict)
        people = people_in(result, frame.index)
        draw_people(panel, camera, people, outlines)
        draw_label(panel, f"{recording.name}, frame {frame.index}, {frame.index / recording.fps:.2f} s", (8, 18))
        if any(person.landmarks is not None for person in people):
            draw_label(panel, "left", (8, panel.shape[0] - 10), LEFT)
            draw_label(panel, "right", (44, panel.shape[0] - 10), RIGHT)
        found = None if keypoints is None else keypoints.frame(frame.index)
        yield frame.index, render(layout, recording, frame, people, panel, outlines, found)


def run_silhouettes(
    recording: Recording, result: Result, first: int | None, last: int | None, on_problem: Callable[[str], None] | None
) -> Iterator[MaskStep] | None:
    """The silhouettes that the run kept, with the images of their frames; None where it kept none, or not all of these.

    Parameters
    ----------
    recording : Recording
    result : Result
    first, last : int, optional
        As for `stream_mosaics`.
    on_problem : callable, optional
        Called with one line for everything that was survived.
    """
    kept, first = result.silhouettes, recording.start if first is None else first
    last = recording.start + recording.n_frames if last is None else last
    if kept is None or kept.missing(recording, first, last):
        return None
    frames = iterate_frames(recording, first, last, on_problem)
    return (replace(step, images=frame.images) for step, frame in zip(kept.steps(recording, range(first, last)), frames, strict=True))


def panel_views(result: Result, room: np.ndarray, size: tuple[int, int]) -> Callable[[int], Camera]:
    """The panel's viewpoint in a frame: near the people where there are poses, else from above the whole room."""
    if result.poses is None:
        above = from_above(room, size)
        return lambda frame: above
    bounds_of = follow(result, room)
    return lambda frame: viewpoint(bounds_of(frame), size)


def follow(result: Result, room: np.ndarray) -> Callable[[int], np.ndarray]:
    """A box that goes along with the people, of one size for the whole result, so that the panel neither jumps nor zooms.

    Returns
    -------
    callable
        Frame number to the box, shape (2, 3), metres; the whole room where there is no person at all.
    """
    tables = [table for table in (result.poses, result.tracks) if table is not None]
    frames = np.concatenate([np.repeat(table.frames, table.positions[0].size // 3 if len(table.frames) else 1) for table in tables])
    points = np.concatenate([table.positions.reshape(-1, 3) for table in tables])
    known = ~np.isnan(points).any(axis=1)
    frames, points = frames[known], points[known, :2]
    if not len(frames):
        return lambda frame: room
    numbers, place = np.unique(frames, return_inverse=True)
    low, high = np.full((len(numbers), 2), np.inf), np.full((len(numbers), 2), -np.inf)
    np.minimum.at(low, place, points)
    np.maximum.at(high, place, points)
    smooth = uniform_filter1d((low + high) / 2, 2 * FOLLOW_FRAMES + 1, axis=0, mode="nearest")
    reach = np.maximum(high - smooth, smooth - low).max() + PANEL_MARGIN_M

    def bounds(frame: int) -> np.ndarray:
        centre = np.array([np.interp(frame, numbers, smooth[:, k]) for k in (0, 1)])
        return np.array([[*(centre - reach), 0.0], [*(centre + reach), PANEL_HEIGHT_M]])

    return bounds


def draw_trails(image: np.ndarray, camera: Camera, result: Result, frame: int) -> None:
    """Draw every person's way through the last frames on the floor."""
    table = result.tracks
    if table is None and result.poses is not None:
        table = TrackTable(result.poses.frames, result.poses.persons, result.poses.positions[:, landmark_index("pelvis")])
    if table is None:
        return
    recent = table.where((table.frames <= frame) & (table.frames > frame - TRAIL_FRAMES))
    for number in np.unique(recent.persons):
        way = recent.of(number).positions * np.array([1, 1, 0])
        draw_paths(image, camera, way, person_color(int(number)), 1)


def _draw_number(image: np.ndarray, camera: Camera, person: Person) -> None:
    from hmc.camera.model import project

    if person.landmarks is not None and not np.isnan(person.landmarks[landmark_index("head_top")]).any():
        top = person.landmarks[landmark_index("head_top")] + np.array([0, 0, 0.08])
    elif person.position is not None:
        top = person.position * np.array([1, 1, 2]) + np.array([0, 0, 0.05])
    else:
        return
    uv, valid = project(camera, top)
    if valid and (np.abs(uv) < 10_000).all():
        draw_label(image, str(person.number), uv + np.array([4, -2]), person_color(person.number), 0.5)
