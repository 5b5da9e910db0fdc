"""What ``hmc evaluate`` compares: the tables of a result and of a truth, in the frames that count."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hmc.camera.model import Rig
from hmc.camera.turned_cameras import turn_back
from hmc.errors import InputError
from hmc.io.camera_turns import read_turns
from hmc.io.recording import read_rig
from hmc.io.results import PoseTable, TrackTable, read_joints, read_tracks, run_selection
from hmc.landmarks import FOOT_POINTS
from hmc.metrics.scores import chosen_frames, chosen_truth, read_image_landmarks
from hmc.metrics.scores.images import ImageTable

__all__ = ["Compared", "find_truth", "read_compared"]


@dataclass(frozen=True)
class Compared:
    """A result and the truth, tables of the frames that count; None for what there is not.

    Parameters
    ----------
    directory : Path
        Of the result.
    start : int
        The first frame that counts.
    n_frames : int or None
        How many; None: all that follow.
    poses, true_poses : PoseTable
        Metres.
    tracks, true_tracks : TrackTable
        Metres.
    truth : Path
        Of the true tracks.
    feet, true_feet : PoseTable
        Of `hmc.landmarks.FOOT_POINTS`.
    marked : ImageTable
        Landmarks marked in images, pixels.
    rig : Rig
        The recording's, as the result has turned it back.
    """

    directory: Path
    start: int
    n_frames: int | None
    poses: PoseTable | None
    true_poses: PoseTable | None
    tracks: TrackTable | None
    true_tracks: TrackTable | None
    truth: Path | None
    feet: PoseTable | None
    true_feet: PoseTable | None
    marked: ImageTable | None
    rig: Rig | None


def read_compared(
    directory: Path, recording: Path | None, truth: Path | None, start: int | None, frames: int | None, images: bool
) -> Compared:
    """Read a result and the truth.

    Parameters
    ----------
    directory : Path
        Of the result.
    recording : Path or None
        With the truth in it, unless that is given.
    truth : Path or None
    start, frames : int or None
        Which frames count; None: those that the result was made of.
    images : bool
        Whether poses are compared in images too, which takes the recording's calibration.

    Raises
    ------
    InputError
        When one of them is missing or none of theirs, or has none of these frames.
    """
    if not directory.is_dir():
        raise InputError(f"{directory}: no such folder; a result is the folder that `hmc pose` or `hmc track` wrote")
    true_joints, true_centroids, marked_file = find_truth(recording, truth)
    first, number = run_selection(directory, start, frames)
    poses, tracks, feet = (directory / name for name in ("joints.csv", "tracks.csv", "feet.csv"))
    rig, marked = None, None
    if images or marked_file is not None:
        if recording is None:
            raise InputError("scores in images need the RECORDING, for its calibration")
        if not poses.exists() or (true_joints is None and marked_file is None):
            raise InputError(f"{directory}: scores in images need joints.csv there, and true joints or marked landmarks")
        rig = turn_back(read_rig(recording), read_turns(directory))
        if marked_file is not None:
            marked = chosen_truth(read_image_landmarks(marked_file, rig.names), marked_file, first, number)
    # A truth that is given has no feet: they are of the recording's own people.
    true_feet = None if recording is None or truth is not None else recording / "truth" / "feet.csv"
    has_feet = true_feet is not None and feet.is_file() and true_feet.is_file()
    return Compared(
        directory,
        first,
        number,
        poses=chosen_frames(read_joints(poses), first, number) if poses.exists() else None,
        true_poses=None if true_joints is None else chosen_truth(read_joints(true_joints), true_joints, first, number),
        tracks=chosen_frames(read_tracks(tracks), first, number) if tracks.exists() else None,
        true_tracks=None if true_centroids is None else chosen_truth(read_tracks(true_centroids), true_centroids, first, number),
        truth=true_centroids or true_joints,
        feet=chosen_frames(read_joints(feet, FOOT_POINTS), first, number) if has_feet else None,
        true_feet=read_joints(true_feet, FOOT_POINTS) if has_feet and true_feet is not None else None,
        marked=marked,
        rig=rig,
    )


def find_truth(recording: Path | None, truth: Path | None) -> tuple[Path | None, Path | None, Path | None]:
    """The files of true joints, of true centroids and of landmarks marked in images; None for what there is not.

    Raises
    ------
    InputError
        When there is none.
    """
    if truth is not None:
        if not truth.is_file():
            raise InputError(f"{truth}: no such file (--truth)")
        with open(truth, encoding="utf-8-sig", errors="replace") as file:
            header = file.readline(200).strip()
        names = [name.strip() for name in header.split(",")]
        if not {"frame", "person"} <= set(names):
            raise InputError(
                f"{truth}: no table of the truth: the first line must be frame,person,joint,x,y,z (joints), frame,person,x,y,z (centroids) "
                f"or frame,camera,person,joint,u,v (marked in images), with commas between; got {header[:80]!r}"
            )
        if "joint" in names:
            return (None, None, truth) if "u" in names else (truth, None, None)
        return None, truth, None
    if recording is None:
        raise InputError("give the RECORDING whose truth/ is to be compared with, or --truth FILE")
    if not recording.is_dir():
        raise InputError(f"{recording}: no such folder; give the recording's folder")
    joints, centroids = recording / "truth" / "joints.csv", recording / "truth" / "centroids.csv"
    if not joints.exists() and not centroids.exists():
        raise InputError(f"{recording}: no truth/joints.csv and no truth/centroids.csv to compare with; give another table by --truth FILE")
    return (joints if joints.exists() else None), (centroids if centroids.exists() else None), None
