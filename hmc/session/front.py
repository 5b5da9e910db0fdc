"""The door to a session: what it needs is made once, the empty scene is learnt, and `Session` keeps the state between two frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from hmc.camera.coverage import estimate_room
from hmc.camera.model import Rig
from hmc.camera.segmentation import train_background
from hmc.camera.shade import floor_pixels
from hmc.errors import InputError, whole_seed
from hmc.io.recording import Recording, for_voxels
from hmc.pose.method import Capture, PoseMethod
from hmc.pose.person import DecidedFrames, PoseTask
from hmc.pose.registry import pose_method
from hmc.session.images import Images, background_images
from hmc.session.step import LiveFrame, SessionSettings, SessionState, end_session, session_step
from hmc.tracking.following import init
from hmc.tracking.resumable import person_grid
from hmc.tracking.trackers import make_tracker
from hmc.voxels.carving import make_tables
from hmc.voxels.completion import make_completion_tables

__all__ = ["Session", "begin_session", "session_settings"]

Background = Sequence[Iterable[np.ndarray]] | Mapping[str, Iterable[np.ndarray]]

#: Sides of voxels, metres: those of `hmc.pose` and `hmc.track`.
POSE_VOXEL_M, TRACK_VOXEL_M = 0.03, 0.05


class Session:
    """Who is there, frame by frame: a state, and `session_step` upon it.

    Parameters
    ----------
    rig : Rig
        Calibrated cameras; a `Rig` of `Camera`, or that of an opened recording.
    background : sequence or mapping of iterables of ndarray, shape (h, w, 3), uint8 BGR
        Images of the empty scene, camera by camera in the rig's order, or by a camera's name; two seconds of them are plenty.
    fps : float
        Steps a second: of cameras that are quicker than the work, as many as it keeps up with (`hmc.live`).
    room : ndarray, shape (2, 3), optional
        Corners of the space in which people are looked for, metres; estimated from the rig where left out.
    method : str, PoseMethod or None
        A key of `hmc.METHODS` that works on silhouettes, or a method; None: people are tracked, not posed.
    height_m : float or "auto"
        Stature of every person, metres.
    persons : int, optional
        People who are there at once at most, where that is known.
    seed : int
        The same seed gives the same result.
    voxel_size_m : float
        Of the hulls that poses are fitted to, metres; 0.05 is quicker and less exact.
    full_images : bool
        Use images as large as they come; else no larger than the voxels show (`hmc.camera.reduction`).

    Raises
    ------
    InputError
        When something of this is wrong, or a camera has no background.

    Examples
    --------
    >>> import hmc
    >>> from hmc.io.recording import background_frames, iterate_frames
    >>> recording = hmc.open_recording("data/synthetic/tiny", frames=6)
    >>> background = [background_frames(recording, camera) for camera in range(len(recording.rig))]
    >>> session = hmc.Session(recording.rig, background, recording.fps, recording.room, persons=1)
    >>> [sorted(session.step(frame.images).people) for frame in iterate_frames(recording)]  # told once they are surely there
    [[], [], [], [0], [0], [0]]
    """

    def __init__(
        self,
        rig: Rig,
        background: Background,
        fps: float = 30.0,
        room: np.ndarray | None = None,
        method: str | PoseMethod | None = "apf",
        height_m: float | Literal["auto"] = "auto",
        persons: int | None = None,
        seed: int = 0,
        voxel_size_m: float = POSE_VOXEL_M,
        full_images: bool = False,
    ) -> None:
        self.settings = session_settings(rig, fps, room, method, height_m, persons, seed, voxel_size_m, full_images)
        self.state = begin_session(self.settings, background)

    @property
    def fps(self) -> float:
        """Steps a second."""
        return self.settings.scene.fps

    @property
    def first_delay_s(self) -> float:
        """As `SessionSettings.first_delay_s`."""
        return self.settings.first_delay_s

    @property
    def delay_s(self) -> float:
        """As `SessionSettings.delay_s`."""
        return self.settings.delay_s

    def step(self, images: Images) -> LiveFrame:
        """One frame on (`hmc.session.step.session_step`); it takes longest when somebody has been watched for long enough to begin."""
        self.state, found = session_step(self.settings, self.state, images)
        return found

    def end(self) -> tuple[DecidedFrames, ...]:
        """The poses that still waited for later frames (`hmc.session.step.end_session`); frames that follow find everybody anew."""
        self.state, decided = end_session(self.settings, self.state)
        return decided


def session_settings(
    rig: Rig,
    fps: float = 30.0,
    room: np.ndarray | None = None,
    method: str | PoseMethod | None = "apf",
    height_m: float | Literal["auto"] = "auto",
    persons: int | None = None,
    seed: int = 0,
    voxel_size_m: float = POSE_VOXEL_M,
    full_images: bool = False,
) -> SessionSettings:
    """The settings of a session, with all tables that are made once; parameters as of `Session`.

    Raises
    ------
    InputError
        When something of this is wrong.
    """
    if len(rig) < 2:
        raise InputError("one camera does not tell how far away people are; a session needs two at least, better four")
    seed = whole_seed(seed)
    height = None if height_m == "auto" else float(height_m)
    if height is not None and not 0 < height < 3:
        raise InputError(f"`height_m` must be a stature in metres, or 'auto'; got {height_m}")
    corners = estimate_room(rig) if room is None else np.array(room, float)
    if corners.shape != (2, 3) or not np.isfinite(corners).all() or not (corners[0] < corners[1]).all():
        raise InputError(f"`room` must be the lower and the upper corner, shape (2, 3), metres; got {np.asarray(room).tolist()}")
    init(fps)  # says what is wrong with `fps`
    scene = Recording(Path(), "session", float(fps), rig, corners, 0, 0, persons, (), room is None, factors=(1,) * len(rig))
    if not full_images:
        scene = for_voxels(scene, TRACK_VOXEL_M if method is None else min(voxel_size_m, TRACK_VOXEL_M))
    task = None
    if method is not None:
        chosen = pose_method(method, passes=1) if isinstance(method, str) else method
        if not chosen.needs_hulls or chosen.needs & {"detections", "keypoints"}:
            raise InputError(f"method {chosen.name} needs more than images; choose another for a session")
        capture = Capture(scene.fps, voxel_size_m, corners, scene.rig)
        task = PoseTask(replace(chosen, back=None), capture, seed, height)
    coarse = make_tables(person_grid(scene, TRACK_VOXEL_M), scene.rig)
    fine = coarse if task is None or voxel_size_m == TRACK_VOXEL_M else make_tables(person_grid(scene, voxel_size_m), scene.rig)
    return SessionSettings(rig, scene, make_tracker(), task, coarse, fine, make_completion_tables(corners, scene.rig), seed)


def begin_session(settings: SessionSettings, background: Background) -> SessionState:
    """The state before the first frame: the empty scene is learnt, and nobody is there.

    Parameters
    ----------
    settings : SessionSettings
    background : sequence or mapping of iterables of ndarray, shape (h, w, 3), uint8 BGR
        As of `Session`.

    Raises
    ------
    InputError
        When a camera has none, or what it has is no image of its size.
    """
    rig = settings.rig
    if isinstance(background, Mapping):
        missing = [name for name in rig.names if name not in background]
        if missing:
            raise InputError(f"no background for camera '{missing[0]}'; give images of the empty scene for each of {', '.join(rig.names)}")
        background = [background[name] for name in rig.names]
    if background is None:
        raise InputError(f"a session needs a background: images of the empty scene for each of {', '.join(rig.names)}")
    if len(background) != len(rig):
        raise InputError(f"the background is of {len(background)} cameras, the rig has {len(rig)}: {', '.join(rig.names)}")
    models = []
    for camera, images, factor in zip(rig, background, settings.scene.factors, strict=True):
        seen = background_images(camera, images, settings.frontend.background_frames, factor)
        floor = floor_pixels(camera, settings.scene.room)
        models.append(train_background(seen, settings.frontend.segmentation, floor=floor, factor=factor))
    return SessionState(tuple(models), init(settings.scene.fps, settings.scene.persons))
