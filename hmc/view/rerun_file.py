"""A result as a file for the Rerun viewer (package rerun-sdk, the extra `viewer`)."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from hmc.errors import InputError
from hmc.io.files import sibling
from hmc.io.recording import Recording
from hmc.landmarks import BONES, LANDMARKS, landmark_index
from hmc.view.mosaic import Person, Result, people_in
from hmc.view.overlay import LEFT, RIGHT, person_color
from hmc.view.page.moments import moments_of, shown_moments
from hmc.view.page.people import chosen_frames
from hmc.voxels.grid import VoxelGrid

__all__ = ["write_rrd"]

#: Radii of what is drawn, metres, and how a guess is drawn: of 255.
BONE_M, POINT_M, GUESS_ALPHA = 0.012, 0.018, 70
ENDS = np.array([[landmark_index(a), landmark_index(b)] for a, b in BONES])


def write_rrd(
    path: str | Path,
    recording: Recording,
    result: Result,
    voxel_size_m: float | None = 0.04,
    outlines: bool = True,
    on_problem: Callable[[str], None] | None = None,
    progress: Callable[[Iterable, int], Iterable] | None = None,
) -> None:
    """Write a result for the Rerun viewer: people, cameras with some images, the hull, heights of landmarks and angles, on two time lines.

    Parameters
    ----------
    path, recording, result, voxel_size_m, outlines, on_problem, progress
        As for `hmc.view.page.write.write_page`, which shows the same frames and moments.

    Raises
    ------
    InputError
        When rerun-sdk is not installed, there is nothing of the result in the recording's selection, or the file cannot be written.
    """
    try:
        import rerun
    except ImportError:
        raise InputError(f'{path}: needs the package rerun-sdk; install it: pip install "hmc-mocap[viewer]"') from None
    frames = chosen_frames(result, recording.start, recording.n_frames)
    if not np.isin(result.frames, frames).any():
        raise InputError(f"{path}: the result has nobody in these frames; choose others with --start and --frames")
    wanted = shown_moments(frames, len(recording.rig))
    stream: Iterable = moments_of(recording, result, wanted, voxel_size_m, outlines, on_problem)
    stream = progress(stream, wanted[-1] + 1 - recording.start) if progress else stream
    with sibling(path) as temporary:
        to = rerun.RecordingStream("hmc", recording_id=recording.name)
        to.save(temporary)
        _log_room(rerun, to, recording)
        for frame, moment in zip(range(recording.start, wanted[-1] + 1), stream, strict=True):
            to.set_time("frame", sequence=frame)
            to.set_time("time", duration=frame / recording.fps)
            if moment is not None:
                _log_moment(rerun, to, recording, moment, voxel_size_m)
            if frame in frames:
                _log_people(rerun, to, result, people_in(result, frame))
        to.flush()
        to.disconnect()


def _log_room(rerun: Any, to: Any, recording: Recording) -> None:
    """What does not change: axes, room and cameras, their lenses without distortion."""
    low, high = np.asarray(recording.room)
    to.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    to.log("world/room", rerun.Boxes3D(mins=[low], sizes=[high - low], colors=[(90, 98, 110)]), static=True)
    for camera in recording.rig:
        place = f"world/cameras/{camera.name}"
        pose = rerun.Transform3D(translation=camera.translation, mat3x3=camera.rotation, relation=rerun.TransformRelation.ChildFromParent)
        to.log(place, pose, static=True)
        lens = rerun.Pinhole(image_from_camera=camera.matrix, resolution=camera.size, image_plane_distance=0.35)
        to.log(place, lens, static=True)


def _log_moment(rerun: Any, to: Any, recording: Recording, moment: dict[str, Any], voxel_size_m: float | None) -> None:
    for camera, uri in zip(recording.rig, moment["images"], strict=True):
        if uri is not None:
            data = base64.b64decode(uri.partition(",")[2])
            to.log(f"images/{camera.name}", rerun.EncodedImage(contents=data, media_type="image/jpeg"))
    if voxel_size_m is not None and "voxels" in moment:
        packed = moment["voxels"]
        indices = np.frombuffer(base64.b64decode(packed["data"]), "<u2").reshape(packed["shape"]).astype(int)
        centres = VoxelGrid.from_room(recording.room, voxel_size_m, len(recording.rig)).centres(indices)
        to.log("world/hull", rerun.Points3D(centres, radii=voxel_size_m / 2, colors=(188, 200, 214)))
    else:
        to.log("world/hull", rerun.Clear(recursive=False))


def _log_people(rerun: Any, to: Any, result: Result, people: list[Person]) -> None:
    """Everybody in a frame; who is not there is cleared."""
    there = {person.number: person for person in people}
    numbers = np.unique(np.concatenate([table.persons for table in (result.poses, result.tracks) if table is not None]))
    for number in numbers.tolist():
        place, person = f"world/people/{number}", there.get(number)
        if person is None:
            to.log(place, rerun.Clear(recursive=True))
            continue
        color = person_color(number)[::-1]
        if person.position is not None:
            to.log(f"{place}/position", rerun.Points3D([person.position], radii=0.04, colors=color, labels=[str(number)]))
        if person.landmarks is None:
            to.log(f"{place}/bones", rerun.Clear(recursive=False))
            to.log(f"{place}/landmarks", rerun.Clear(recursive=False))
            continue
        points, guessed = person.landmarks, np.zeros(len(LANDMARKS), bool) if person.doubtful is None else person.doubtful
        known = np.isfinite(points).all(axis=1)
        bones = ENDS[known[ENDS].all(axis=1)]
        sides = {"l_": LEFT[::-1], "r_": RIGHT[::-1]}
        colors = [(*sides.get(LANDMARKS[end][:2], color), GUESS_ALPHA if guessed[end] else 255) for _, end in bones]
        to.log(f"{place}/bones", rerun.LineStrips3D(points[bones], radii=BONE_M, colors=colors))
        dots = [(*color, GUESS_ALPHA if one else 255) for one in guessed[known]]
        names = [name for name, one in zip(LANDMARKS, known, strict=True) if one]
        to.log(f"{place}/landmarks", rerun.Points3D(points[known], radii=POINT_M, colors=dots, labels=names, show_labels=False))
        for name in ("l_wrist", "r_wrist", "l_ankle", "r_ankle"):
            if known[landmark_index(name)]:
                to.log(f"heights/{number}/{name}", rerun.Scalars(points[landmark_index(name), 2]))
        if person.state is not None and result.states is not None:
            for name, angle in zip(result.states.dof_names[3:], person.state[3:], strict=True):
                if np.isfinite(angle):
                    to.log(f"angles/{number}/{name}", rerun.Scalars(np.degrees(angle)))
