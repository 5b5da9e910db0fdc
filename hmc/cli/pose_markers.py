"""``hmc pose --method marker-apf``: the pose of one person who wears markers."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hmc.cli.common import print_problems, progress, recording_source, was_finished

__all__ = ["add_marker_options", "run_markers"]

#: Found in the recording's folder where no option says otherwise.
DETECTIONS, LABELS = Path("markers/detections.csv"), Path("markers/labels.csv")
#: Detections of a run that is not finished.
JOURNAL = ".markers.journal"
#: Frames of the empty scene of which the median is taken.
BACKGROUND_FRAMES = 15


def add_marker_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this method."""
    group = parser.add_argument_group("with --method marker-apf")
    group.add_argument(
        "--detections",
        type=Path,
        metavar="FILE",
        help="2-D detections (frame, camera, u, v); default: markers/detections.csv of the recording",
    )
    group.add_argument(
        "--labels",
        type=Path,
        metavar="FILE",
        help="points on markers in some images (frame, camera, u, v), of which the markers' colour is learnt to detect them in all "
        "images; default: markers/labels.csv of the recording",
    )
    group.add_argument(
        "--markers", choices=("skin", "joints"), default="skin", help="where detections lie: on the skin (default), or at the joint centres"
    )


def run_markers(args: argparse.Namespace, height_m: float | None, recording) -> int:
    """Run the method.

    Parameters
    ----------
    args : Namespace
        Of `hmc pose`.
    height_m : float or None
        Stature, or None where it is to be estimated.
    recording : Recording
    """
    import numpy as np

    from hmc.camera.marker_color import ColourSettings
    from hmc.errors import InputError
    from hmc.io.detections import write_detections
    from hmc.io.files import to_toml
    from hmc.io.results import TrackTable, write_joints, write_pose, write_run, write_tracks
    from hmc.landmarks import LANDMARKS
    from hmc.pose.methods.marker_apf import pose_from_markers
    from hmc.pose.steps.marker_filter import marker_preset

    preset, colour = marker_preset(args.preset), ColourSettings()
    used, ready = _source(args, recording)
    if args.out.is_file():
        raise InputError(f"--out {args.out}: is a file; give a folder")
    parameters: dict[str, Any] = {
        "start": recording.start, "frames": recording.n_frames, "cameras": list(recording.rig.names), "fps": recording.fps,
        "room_m": recording.room, "height_m": height_m or "auto", "markers": args.markers, "preset": preset,
    }  # fmt: skip
    parameters |= {"detections": used.resolve()} if ready else {"labels": used.resolve(), "colour": colour}
    source = recording_source(recording) | {"markers_changed": str(used.stat().st_mtime_ns)}
    depends_on = {"method": args.method, "seed": args.seed, **source, "parameters": parameters}
    key = to_toml(depends_on)
    paths = {name: args.out / name for name in ("tracks.csv", "joints.csv", "pose.npz", "run.toml")}
    if was_finished([paths["joints.csv"], paths["tracks.csv"], paths["pose.npz"]], paths["run.toml"], depends_on):
        return 0

    problems = [*recording.problems]
    frames = list(range(recording.start, recording.start + recording.n_frames))
    table = _read(used, recording) if ready else _detect(args, recording, used, colour, args.out / JOURNAL, key, problems)
    if not len(table.frames):
        raise InputError(f"{used}: no marker in these frames; check the labelled points or the detections")
    people = pose_from_markers(
        recording.rig, table, frames, recording.fps, preset, args.seed, height_m=height_m, skin=args.markers == "skin",
        room=recording.room, progress=lambda steps, total: progress(steps, total, "pose", args.quiet),
    )  # fmt: skip
    problems += people.notes
    fitted = np.isfinite(people.poses.positions).all(axis=(1, 2))
    pelvis, head = (people.poses.positions[fitted, LANDMARKS.index(name)] for name in ("pelvis", "head_top"))
    write_tracks(paths["tracks.csv"], TrackTable(people.poses.frames[fitted], people.poses.persons[fitted], pelvis, head))
    write_joints(paths["joints.csv"], people.poses)
    write_pose(paths["pose.npz"], people.states)
    if not ready:
        write_detections(args.out / "detections.csv", table)
    write_run(paths["run.toml"], args.method, parameters, args.seed, **source, problems=list(dict.fromkeys(problems)))
    (args.out / JOURNAL).unlink(missing_ok=True)
    print(f"person 0: {fitted.sum()} of {len(frames)} frames, {len(table.frames) / len(frames):.0f} detections a frame")
    print(f"wrote {paths['joints.csv']}")
    print_problems(problems)
    return 0


def _source(args: argparse.Namespace, recording) -> tuple[Path, bool]:
    """The file of detections, or that of labelled points, and which of the two it is."""
    from hmc.errors import InputError

    if args.detections and args.labels:
        raise InputError("--detections and --labels: give one of them; with detections no colour is learnt")
    for name, given in (("--detections", args.detections), ("--labels", args.labels)):
        if given and not given.is_file():
            raise InputError(f"{name} {given}: no such file")
        if given:
            return given, name == "--detections"
    for path in (DETECTIONS, LABELS):
        if (recording.path / path).is_file():
            return recording.path / path, path == DETECTIONS
    raise InputError(
        f"{recording.path}: has neither {DETECTIONS} nor {LABELS}; give --detections FILE (where markers were seen), or --labels FILE "
        "(some points on markers, to learn their colour from): tables with the columns frame,camera,u,v"
    )


def _read(path: Path, recording):
    """The detections of the recording's selection."""
    from hmc.io.calibration import read_entries
    from hmc.io.detections import DetectionTable, read_detections

    table = read_detections(path, [entry.name for entry in read_entries(recording.path)])
    chosen = (table.frames >= recording.start) & (table.frames < recording.start + recording.n_frames)
    return DetectionTable(table.frames[chosen], table.cameras[chosen], table.uv[chosen])


def _detect(args: argparse.Namespace, recording, labels: Path, settings, journal: Path, key: str, problems: list[str]):
    """Learn the colour and detect in every image; what is done is kept in the journal."""
    import numpy as np

    from hmc.camera.marker_color import detect_markers, learn_marker_colour
    from hmc.errors import InputError
    from hmc.io.detections import DetectionTable, read_detections
    from hmc.io.journal import append_journal, open_journal
    from hmc.io.recording import background_frames, iterate_frames, open_recording

    whole = open_recording(args.recording, cameras=args.cameras)
    points = read_detections(labels, whole.rig.names)
    samples = []
    for frame in np.unique(points.frames).tolist():
        if not 0 <= frame < whole.n_frames:
            raise InputError(f"{labels}: frame {frame} is not in the recording, which has {whole.n_frames} frames")
        (images,) = (one.images for one in iterate_frames(whole, first=frame, last=frame + 1))
        samples += [(image, uv) for image, uv in zip(images, points.in_frame(frame, whole.rig.names), strict=True) if image is not None]
    colour = learn_marker_colour(samples, settings)
    empty = []
    for camera in range(len(recording.rig)):
        without = list(background_frames(recording, camera, limit=BACKGROUND_FRAMES))
        empty.append(np.median(np.stack(without), axis=0).astype(np.uint8) if without else None)
    records = open_journal(journal, key)
    first = recording.start + len(records)
    steps = iterate_frames(recording, first=first, on_problem=problems.append) if first < recording.start + recording.n_frames else iter(())
    for frame in progress(steps, recording.start + recording.n_frames - first, "markers", args.quiet):
        found = [
            np.zeros((0, 2)) if image is None else detect_markers(image, colour, settings, back)
            for image, back in zip(frame.images, empty, strict=True)
        ]
        records.append({"frame": frame.index, "uv": [uv.tolist() for uv in found]})
        append_journal(journal, records[-1])
    rows = [(one["frame"], name, u, v) for one in records for name, uv in zip(recording.rig.names, one["uv"], strict=True) for u, v in uv]
    frames, cameras, u, v = zip(*rows, strict=True) if rows else ((), (), (), ())
    return DetectionTable(np.array(frames, int), np.array(cameras, str), np.array([u, v], float).T.reshape(-1, 2))
