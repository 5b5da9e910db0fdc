"""The public face: each stage of the chain as one function, with the choices that most users make.

Recordings are opened with `hmc.open_recording`. The stages can be had apart: images to silhouettes, silhouettes to hulls, hulls to tracks,
hulls and tracks to what each frame shows of each person, and that to poses; each is a plain function over arrays, streamed frame by frame.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from hmc.errors import InputError, whole_seed
from hmc.io.masks import MaskStep
from hmc.io.recording import Recording, for_voxels, open_recording
from hmc.io.results import PoseTable, TrackTable, read_joints, read_table, read_tracks
from hmc.processes import one_thread
from hmc.voxels.hulls import HullStep, stream_hulls, stream_masks

if TYPE_CHECKING:
    from hmc.check import Finding
    from hmc.io.detections import DetectionTable
    from hmc.io.keypoints import KeypointSource
    from hmc.metrics.mot import MotScores
    from hmc.metrics.scores.poses import PoseEvaluation
    from hmc.motion.gaps import Fill
    from hmc.pose.follow import PosedPeople
    from hmc.pose.method import PoseMethod
    from hmc.pose.views.person_view import PersonView
    from hmc.tracking.trackers import Tracker
    from hmc.view.mosaic import Result

__all__ = ["check", "evaluate", "export", "hulls", "pose", "silhouettes", "track", "view", "views"]

#: Sides of a voxel, metres: for poses and hulls, for tracks, and in pictures.
POSE_VOXEL_M, TRACK_VOXEL_M = 0.03, 0.05
#: Under which the silhouettes of a call are kept between tracking and poses.
_KEY = "api"


def check(recording: Recording | str | Path) -> list[Finding]:
    """What is wrong with a recording, errors first: to be asked before anything else.

    Parameters
    ----------
    recording : Recording or path
        One that is open is looked at as it was opened: its cameras alone, in its session, or of what is in memory all that needs no files.

    Returns
    -------
    list of Finding
        Each with a severity ("error", "warning", "note") and a line that says what to do; empty where there is nothing to say.

    Examples
    --------
    >>> import hmc
    >>> [finding.severity for finding in hmc.check("data/synthetic/tiny")]
    []
    """
    from hmc.check.findings import check_opened, check_recording

    return check_opened(recording) if isinstance(recording, Recording) else check_recording(recording)


def silhouettes(recording: Recording | str | Path) -> Iterator[MaskStep]:
    """The silhouettes of every frame, in order: `index`, `images` and `masks`, one entry a camera.

    Parameters
    ----------
    recording : Recording or path

    Examples
    --------
    >>> import hmc
    >>> recording = hmc.open_recording("data/synthetic/tiny", frames=1)
    >>> [mask.shape for mask in next(hmc.silhouettes(recording)).masks[:2]]
    [(240, 320), (240, 320)]
    """
    return stream_masks(_opened(recording))


def hulls(
    recording: Recording | str | Path, voxel_size_m: float = POSE_VOXEL_M, masks: Iterable[MaskStep] | None = None
) -> Iterator[HullStep]:
    """The visual hulls of every frame, in order: `strict`, `tolerant` and `loose`, bool, shape (nx, ny, nz), beside the silhouettes.

    Parameters
    ----------
    recording : Recording or path
    voxel_size_m : float
        Side of a voxel, metres.
    masks : iterable of MaskStep, optional
        Silhouettes of these frames; made here where left out.

    Examples
    --------
    >>> import hmc
    >>> recording = hmc.open_recording("data/synthetic/tiny", frames=1)
    >>> hull = next(hmc.hulls(recording, 0.05))
    >>> bool(0.04 < hull.strict.sum() * 0.05**3 < 0.2)  # cubic metres: one person
    True
    """
    from hmc.tracking.resumable import person_grid

    recording = _opened(recording)
    return stream_hulls(recording, person_grid(recording, voxel_size_m), masks=masks)


@one_thread()
def track(
    recording: Recording | str | Path,
    tracker: str | Tracker | None = None,
    seed: int = 0,
    voxel_size_m: float = TRACK_VOXEL_M,
    keypoints: KeypointSource | None = None,
    full_images: bool = False,
) -> TrackTable:
    """The track of every person: where each is in every frame.

    Parameters
    ----------
    recording : Recording or path
    tracker : str or Tracker, optional
        A key of `hmc.TRACKERS`, or a tracker; "sparse" by default.
    seed : int
        The same seed gives the same result.
    voxel_size_m : float
        Side of a voxel, metres.
    keypoints : KeypointSource, optional
        What a detector of 2-D keypoints saw (`hmc.io.keypoints.open_keypoints`): people are found by these alone then, without silhouettes,
        voxels and a tracker.
    full_images : bool
        Use images as large as they are; else no larger than the voxels show (`hmc.camera.reduction`).

    Returns
    -------
    TrackTable
        `frames`, `persons`, `positions` and `heads`; metres.

    Raises
    ------
    InputError
        When the voxels are too coarse, the seed is none, there is no such tracker, or one is given beside keypoints.

    Examples
    --------
    >>> import hmc
    >>> tracks = hmc.track(hmc.open_recording("data/synthetic/tiny", frames=8))
    >>> sorted(set(tracks.persons.tolist())), tracks.positions.shape
    ([0], (8, 3))
    """
    recording, seed = _opened(recording), whole_seed(seed)
    if keypoints is None:
        recording = recording if full_images else for_voxels(recording, voxel_size_m)
        return _tracked(recording, tracker or "sparse", seed, voxel_size_m)
    if tracker is not None:
        raise InputError("track: keypoints have no use for a tracker; leave one of both out")
    from hmc.pose.keypoint_tracks import tracks_of_keypoints

    return tracks_of_keypoints(recording, _in_images(keypoints, recording))


def views(
    recording: Recording | str | Path,
    tracks: TrackTable,
    needs: Sequence[str] = ("hulls",),
    voxel_size_m: float = POSE_VOXEL_M,
    masks: Iterable[MaskStep] | None = None,
) -> Iterator[dict[int, PersonView]]:
    """What each frame shows of each person: what pose methods work on.

    Parameters
    ----------
    recording : Recording or path
    tracks : TrackTable
        As from `track`.
    needs : sequence of str
        What is to be there: "hulls", "skin", "voxels" (`hmc.pose.views.person_view`).
    voxel_size_m, masks
        As for `hulls`.

    Examples
    --------
    >>> import hmc
    >>> recording = hmc.open_recording("data/synthetic/tiny", frames=8)
    >>> first = next(hmc.views(recording, hmc.track(recording)))
    >>> first[0].target.surface.shape[1]  # points of the strict hull's surface
    3
    """
    from hmc.pose.views.person_view import check_needs, views_of
    from hmc.tracking.resumable import person_grid

    recording = _opened(recording)
    grid, wanted = person_grid(recording, voxel_size_m), check_needs(needs)
    return (views_of(recording, grid, tracks, hull, wanted) for hull in stream_hulls(recording, grid, masks=masks))


@one_thread()
def pose(
    recording: Recording | str | Path,
    tracks: TrackTable | None = None,
    method: str | PoseMethod = "apf",
    seed: int = 0,
    height_m: float | Literal["auto"] | None = None,
    smooth_s: float | None = None,
    detections: DetectionTable | None = None,
    on_frame: Callable[[int, int], None] | None = None,
    keypoints: KeypointSource | None = None,
    full_images: bool = False,
) -> PosedPeople:
    """The pose of every person in every frame.

    Parameters
    ----------
    recording : Recording or path
    tracks : TrackTable, optional
        As from `track`; made here where left out.
    method : str or PoseMethod
        A key of `hmc.METHODS`, or a method, such as ``hmc.pose_method("smd", preset="kehl2006")``, or ``hmc.pose_method("apf", passes=1)``
        for who cannot wait for the second pass (`hmc.pose.backward`).
    seed : int
        The same seed gives the same result.
    height_m : float or "auto", optional
        Stature of every person; "auto": estimated for each; where left out what the recording says of a single person, else "auto".
    smooth_s : float, optional
        Time over which finished poses are smoothed, seconds; 0: they are left as they were found. By default .2 s after a second pass, and
        0 where there is none.
    detections : DetectionTable, optional
        Of markers (`hmc.io.detections.read_detections`), for the methods that need them; without hulls they need no tracks.
    on_frame : callable, optional
        Called with the number of frames that are done and that of all.
    keypoints : KeypointSource, optional
        What a detector of 2-D keypoints saw (`hmc.io.keypoints.open_keypoints`), to be used beside the silhouettes; with the method
        "keypoints" without any, and people are tracked by them too.
    full_images : bool
        As for `track`.

    Returns
    -------
    PosedPeople
        `positions`, shape (n, 15, 3), metres; `angles`, radians; `frames`, `persons`; `poses.views`, how many cameras show each landmark
        clear (`hmc.pose.clear_views`; by keypoints alone: agree on it, `hmc.pose.keypoint_views`); `poses.trust`, how likely each is within
        60 mm of the truth (`hmc.pose.trust`; not by keypoints alone), and `poses.doubtful`; `to_frame()` as a pandas frame.

    Raises
    ------
    InputError
        When there is no such method, what it needs is not there, or `seed` or `smooth_s` is none.

    Examples
    --------
    >>> import hmc
    >>> people = hmc.pose(hmc.open_recording("data/synthetic/tiny", frames=8))
    >>> list(people.to_frame().columns)
    ['frame', 'person', 'joint', 'x', 'y', 'z', 'views', 'trust']
    """
    from hmc.pose.chain import ChainRuns, finished_poses
    from hmc.pose.follow import FollowOptions, for_method
    from hmc.pose.keypoint_tracks import tracks_of_keypoints
    from hmc.pose.method import as_found
    from hmc.pose.registry import pose_method
    from hmc.voxels.run_options import RunOptions

    if smooth_s is not None and not 0 <= smooth_s < float("inf"):
        raise InputError(f"`smooth_s` must be a number of seconds, 0 or more; got {smooth_s}")
    seed = whole_seed(seed)
    recording, method = _opened(recording), pose_method(method) if isinstance(method, str) else method
    method = method if smooth_s is None else as_found(method)
    height = None if height_m == "auto" else recording.known_height_m if height_m is None else height_m
    recording = recording if full_images else for_method(recording, method, POSE_VOXEL_M)
    keypoints = None if keypoints is None else _in_images(keypoints, recording)

    def counted(steps: Iterable[HullStep], total: int) -> Iterator[HullStep]:
        for n, step in enumerate(steps, start=1):
            yield step
            if on_frame is not None:
                on_frame(n, total)

    with tempfile.TemporaryDirectory() as folder:
        masks = Path(folder) / "masks" if method.needs_hulls else None
        if tracks is None and keypoints is not None and "keypoints" in method.needs and not method.needs_hulls:
            tracks = tracks_of_keypoints(recording, keypoints)
        elif tracks is None and method.needs_hulls:
            tracks = _tracked(recording, "sparse", seed, TRACK_VOXEL_M, masks)
        run = RunOptions(masks=masks, key=_KEY)
        runs = ChainRuns(replace(run, progress=counted), run, run)
        options = FollowOptions(POSE_VOXEL_M, seed, height, detections)
        return finished_poses(recording, tracks, method, options, runs, keypoints, smooth_s)


def evaluate(found: PosedPeople | TrackTable | str | Path, recording: Recording | str | Path) -> PoseEvaluation | MotScores:
    """The errors of poses or tracks against the truth in a recording's folder.

    Parameters
    ----------
    found : PosedPeople, TrackTable or path
        A path: the folder of a result.
    recording : Recording or path
        With ``truth/joints.csv``, or ``truth/centroids.csv`` for tracks (the true pelvis where there is none). Only its frames count.

    Returns
    -------
    PoseEvaluation or MotScores
        Of poses, `summary` has plain numbers by name, such as ``mean_mm`` and ``mmta_at_50mm``, and `persons` what was compared, for more:
        ``hmc.metrics.scores.evaluate_offsets(evaluation.persons)`` has the errors without each landmark's constant offset.

    Raises
    ------
    InputError
        When there is no truth, or none of these frames.

    Examples
    --------
    >>> import hmc
    >>> recording = hmc.open_recording("data/synthetic/tiny", frames=8)
    >>> bool(hmc.evaluate(hmc.pose(recording), recording).summary["mean_mm"] < 40)
    True
    """
    from hmc.metrics.scores import chosen_frames, chosen_truth, evaluate_pose, evaluate_tracks, pelvis_tracks

    recording = _opened(recording)
    table = _table_of(found)
    joints, centroids = (recording.path / "truth" / name for name in ("joints.csv", "centroids.csv"))
    path = centroids if isinstance(table, TrackTable) and centroids.is_file() else joints
    if not path.is_file():
        raise InputError(f"{path}: no such file; there is no truth to evaluate against")
    first, number = recording.start, recording.n_frames
    if isinstance(table, PoseTable):
        return evaluate_pose(chosen_frames(table, first, number), chosen_truth(read_joints(path), path, first, number))
    truth = chosen_truth(read_tracks(path) if path == centroids else pelvis_tracks(read_joints(path)), path, first, number)
    return evaluate_tracks(chosen_frames(table, first, number), truth)


def view(
    found: PosedPeople | TrackTable | str | Path, recording: Recording | str | Path, out: str | Path, frames: Sequence[int] = ()
) -> None:
    """Write poses or tracks drawn over every camera: a picture (.png, .jpg) of some frames, a video (.mp4) of all, or a page
    (.html) for a browser.

    Parameters
    ----------
    found : PosedPeople, TrackTable or path
        A path: the folder of a result.
    recording : Recording or path
    out : path
    frames : sequence of int
        Of a picture; by default one in the middle.

    Raises
    ------
    InputError
        When the ending is of none of these, a frame is not in the recording, the file cannot be written, or it is, or would lie among, the
        recording's own files.

    Examples
    --------
    >>> import hmc, pathlib, tempfile
    >>> recording = hmc.open_recording("data/synthetic/tiny", frames=8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     hmc.view(hmc.track(recording), recording, f"{folder}/tracks.png")
    ...     pathlib.Path(folder, "tracks.png").is_file()
    True
    """
    from hmc.io.own_files import refuse_own_file
    from hmc.io.places import places_of
    from hmc.view.write import write_view

    recording = _opened(recording)
    refuse_own_file(out, places_of(recording))
    write_view(out, recording, _result_of(found), frames)


def export(
    found: PosedPeople | str | Path,
    out: str | Path,
    fps: float | None = None,
    person: int | None = None,
    fill: Fill = "none",
    max_gap_s: float | None = None,
) -> list[Path]:
    """Write poses in a format of other programs, by the suffix: TRC, C3D, BVH, OpenSim's MOT with its model, GLB, CSV, Parquet.

    Parameters
    ----------
    found : PosedPeople or path
        Poses, or the folder of a result.
    out : path
        Such as ``"walk.trc"``; where the format holds one person and there are several, one file a person.
    fps : float, optional
        Frames a second; by default those of the recording.
    person : int, optional
        This one alone.
    fill : {"none", "linear", "spline"}
        What is done about gaps; formats without any are filled in any case.
    max_gap_s : float, optional
        Longer gaps stay, seconds; of `fill` "linear" or "spline".

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    InputError
        When the frames a second are not known, a number is not above 0, there is no such way to fill gaps or nothing for `max_gap_s` to act
        on, there is no such format, it needs angles that there are not, there are more frames than it holds (C3D), a package is missing,
        or the file is one of the result's own.

    Examples
    --------
    >>> import hmc, tempfile
    >>> people = hmc.pose(hmc.open_recording("data/synthetic/tiny", frames=8))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [path.name for path in hmc.export(people, f"{folder}/walk.mot")]
    ['walk.mot', 'walk.osim']
    """
    from hmc.io.own_files import refuse_result_file
    from hmc.motion.export import export_trajectories
    from hmc.motion.gaps import check_fill, fill_trajectory
    from hmc.motion.trajectory import chosen, read_trajectories

    check_fill(fill, max_gap_s)
    if isinstance(found, str | Path):
        refuse_result_file(out, found)
    people = read_trajectories(found, fps, person) if isinstance(found, str | Path) else chosen(found.trajectories(fps), person, "export")
    return list(export_trajectories([fill_trajectory(one, fill, max_gap_s) for one in people], out).paths)


def _in_images(keypoints: KeypointSource, recording: Recording) -> KeypointSource:
    """Keypoints in pixels of the images as they are read; as they are where that is as they were recorded."""
    return keypoints if set(recording.factors) <= {1} else keypoints.reduced(recording.factors)


def _opened(recording: Recording | str | Path) -> Recording:
    return recording if isinstance(recording, Recording) else open_recording(recording)


def _table_of(found: PosedPeople | TrackTable | str | Path) -> PoseTable | TrackTable:
    """The poses of what somebody has, or the tracks where there are no poses."""
    if isinstance(found, str | Path):
        return read_table(found)
    return found if isinstance(found, TrackTable) else found.poses


def _result_of(found: PosedPeople | TrackTable | str | Path) -> Result:
    from hmc.view.mosaic import Result, read_result, with_bodies

    if isinstance(found, str | Path):
        return read_result(found)
    return Result(tracks=found) if isinstance(found, TrackTable) else with_bodies(Result(found.poses, turned=found.turned), found.states)


def _tracked(recording: Recording, tracker: str | Tracker, seed: int, voxel_size_m: float, masks: Path | None = None) -> TrackTable:
    from hmc.tracking.resumable import track_recording
    from hmc.tracking.trackers import make_tracker
    from hmc.voxels.run_options import RunOptions

    chosen = make_tracker(tracker) if isinstance(tracker, str) else tracker
    return track_recording(recording, voxel_size_m, chosen, seed, RunOptions(masks=masks, key=_KEY))
