"""``hmc track``: where people are in every frame."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hmc.cli.common import (
    add_image_option,
    add_plugin_option,
    add_selection_options,
    add_workers_option,
    cameras_table,
    gather_problems,
    image_parameters,
    load_given_plugins,
    note_changes,
    open_given_keypoints,
    open_selected,
    output_path,
    positive_float,
    print_problems,
    recording_source,
    refuse_no_folder,
    selected_workers,
    was_finished,
    whole_number,
    written_digests,
)
from hmc.cli.kept import MASKS, add_silhouette_options, given_silhouettes, leave_silhouettes, silhouettes_source, take_silhouettes
from hmc.cli.option_tables import add_like_option, told_options
from hmc.cli.run_bar import LEARNING, TRACKING, RunBar

if TYPE_CHECKING:
    from hmc.io.camera_faults import CameraFault
    from hmc.io.recording import Recording
    from hmc.io.results import TrackTable
    from hmc.tracking.resumable import Timing
    from hmc.voxels.run_options import RunOptions

__all__ = ["add_parser", "add_tracker_options", "run", "selected_frontend", "selected_tracker"]

#: The journal of a run that is not finished.
JOURNAL = ".track.journal"
#: Side of a voxel where no other is said, metres.
VOXEL_M = 0.04
#: What `--cues` may say.
CUES = ("silhouettes", "keypoints")
#: Options of which keypoints alone make no use, with what they are where nothing is said.
OF_SILHOUETTES = {
    "tracker": None, "color": None, "particles": None, "track_preset": "default", "complete": True, "cut_shadows": True, "exclude": True,
    "voxel": None, "full_images": False, "silhouettes": True, "silhouettes_from": None,
}  # fmt: skip


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "track",
        help="where people are in every frame",
        description="Find and follow all persons in a recording. Writes tracks.csv (frame, person, x, y, z of the centroid and of the "
        "head; metres) and run.toml. A run that was stopped goes on where it was when it is started again; a finished one is not repeated "
        "unless the recording or a parameter changed.",
    )
    add_selection_options(parser)
    add_workers_option(parser)
    parser.add_argument("--out", type=output_path, required=True, metavar="DIR", help="folder of the result")
    add_like_option(parser)
    add_tracker_options(parser)
    add_plugin_option(parser)
    parser.add_argument("--voxel", type=positive_float, metavar="M", help=f"side of a voxel, metres (default: {VOXEL_M})")
    add_image_option(parser)
    parser.add_argument("--seed", type=whole_number, default=0, metavar="N", help="seed of the random numbers (default: 0)")
    add_silhouette_options(parser)
    parser.add_argument(
        "--cues",
        choices=CUES,
        default=CUES[0],
        help="what people are found by: silhouettes (default), or the keypoints that a 2-D detector left in the recording, without any "
        "silhouette",
    )
    return parser


class _TrackerHelp(str):
    """Help that names the registered trackers, which are imported when it is shown and not before."""

    def __mod__(self, params: Any) -> str:
        from hmc.tracking.trackers import DEFAULT, TRACKERS

        names = "; ".join(f"{one.name}: {one.summary}{' (default)' * (one.name == DEFAULT)}" for one in TRACKERS.values())
        presets = ", ".join(dict.fromkeys(preset for one in TRACKERS.values() for preset in one.presets))
        return self.format(names=names, presets=presets)


def add_tracker_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--tracker``, ``--color``, ``--particles``, ``--track-preset``, ``--complete``, ``--cut-shadows`` and ``--exclude``."""
    parser.add_argument("--tracker", metavar="NAME", help=_TrackerHelp("method; {names}"))
    parser.add_argument(
        "--color", action=argparse.BooleanOptionalAction, default=None, help="use colors (default, where the tracker can), or do not"
    )
    parser.add_argument("--particles", type=whole_number, default=None, metavar="N", help="particles or samples a person")
    parser.add_argument(
        "--track-preset",
        metavar="NAME",
        default="default",
        help=_TrackerHelp(
            "the tracker's parameters ({presets}); canton2009: the thesis's printed ones; alike: people who are dressed alike"
        ),
    )
    parser.add_argument(
        "--complete",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="let the other cameras decide where one takes pale clothes for a shadow (default), or use each camera's own silhouette",
    )
    parser.add_argument(
        "--cut-shadows",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="tell shadows on the floor from people by how dark the other cameras see it (default), or leave it to each camera's own guess",
    )
    parser.add_argument(
        "--exclude",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="leave a camera out while it is frozen, moved, out of time or does not fit the others (default), or say so and keep it",
    )


def selected_frontend(args: argparse.Namespace):
    """How silhouettes and hulls are made, as the options say."""
    from hmc.voxels.hulls import FrontendSettings

    return FrontendSettings(ask_floor=args.cut_shadows, complete=args.complete, cut_shadows=args.cut_shadows, exclude=args.exclude)


def selected_tracker(args: argparse.Namespace):
    """The tracker that the options describe."""
    from hmc.tracking.trackers import DEFAULT, make_tracker

    return make_tracker(args.tracker or DEFAULT, color=args.color, particles=args.particles, preset=args.track_preset)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    with ExitStack() as held:
        return _run(args, held)


def _run(args: argparse.Namespace, held: ExitStack) -> int:
    from hmc.errors import InputError
    from hmc.io.files import to_toml
    from hmc.io.lock import only_run
    from hmc.io.results import read_tracks, write_run, write_tracks
    from hmc.voxels.run_options import RunOptions

    plugins, recording = load_given_plugins(args), open_selected(args)
    work = _by_keypoints(args, recording) if args.cues == CUES[1] else _by_silhouettes(args, recording)
    tracks_path, run_path, journal = args.out / "tracks.csv", args.out / "run.toml", args.out / JOURNAL
    refuse_no_folder(args.out, recording)
    if (args.out / "joints.csv").exists() or (args.out / "pose.npz").exists():
        raise InputError(f"--out {args.out}: holds poses, whose tracks must stay as they are; choose another folder")
    parameters: dict[str, Any] = {
        "start": recording.start,
        "frames": recording.n_frames,
        "cameras": list(recording.rig.names),
        "room_m": recording.room,
        "fps": recording.fps,
        **work.parameters,
        **plugins,
    }
    silhouettes = given_silhouettes(args, recording, args.cues == CUES[0])
    source = recording_source(recording) | silhouettes_source(silhouettes)
    depends_on = {"method": work.method, "seed": args.seed, **source, "parameters": parameters}
    key = to_toml(depends_on)
    held.enter_context(only_run(args.out))
    if was_finished([tracks_path], run_path, depends_on):
        print(_summary(read_tracks(tracks_path), recording.n_frames))
        return 0

    problems: list[str] = [*recording.problems]
    timings: list[Timing] = []
    faults: list[CameraFault] = []
    run = RunOptions(
        selected_frontend(args),
        journal,
        args.out / MASKS if args.cues == CUES[0] else None,
        key=key,
        on_problem=problems.append,
        progress=RunBar([TRACKING], recording.n_frames, quiet=args.quiet).stage(TRACKING, LEARNING if args.cues == CUES[0] else None),
        workers=selected_workers(args),
        on_fault=faults.append,
    )
    take_silhouettes(silhouettes, work.recording, args.out / MASKS, key, problems.append)
    table = work.track(run, timings.append)
    problems += work.notes
    if args.cues == CUES[0]:
        leave_silhouettes(args, work.recording, key, problems.append)
    write_tracks(tracks_path, table)
    speed = {name: value for timing in timings for name, value in _speed(timing, recording.fps).items()}
    note_changes(recording, source, problems)
    said = {"options": told_options(args), "problems": gather_problems(problems), "speed": speed, **cameras_table(faults)}
    said["written"] = written_digests([tracks_path])
    write_run(run_path, work.method, parameters, args.seed, **source, **said)
    for path in (journal, args.out / MASKS):
        path.unlink(missing_ok=True)
    print(_summary(table, recording.n_frames))
    if speed:
        print(
            f"real-time factor {speed['real_time_factor']:.2f}; of the filter alone {speed['filter_real_time_factor']:.1f} "
            f"({speed['input_s']:.1f} s input, {speed['filter_s']:.2f} s filter, {speed['lifecycle_s']:.2f} s tracks' beginning and end)"
        )
    print(f"wrote {tracks_path}")
    print_problems(problems)
    return 0


@dataclass(frozen=True)
class _Work:
    """What is to be done: the recording as it is read, the method's name and parameters, a function from a run and what takes its
    timing to the tracks, and what is to be said besides."""

    recording: Recording
    method: str
    parameters: Mapping[str, Any]
    track: Callable[[RunOptions, Callable[[Timing], None]], TrackTable]
    notes: Sequence[str] = ()


def _by_silhouettes(args: argparse.Namespace, recording: Recording) -> _Work:
    from hmc.io.recording import for_voxels
    from hmc.tracking.resumable import track_recording

    voxel, tracker = args.voxel or VOXEL_M, selected_tracker(args)
    recording = recording if args.full_images else for_voxels(recording, voxel)
    parameters = {"voxel_size_m": voxel, "tracker": tracker.settings, "frontend": selected_frontend(args)} | image_parameters(recording)
    return _Work(recording, tracker.name, parameters, lambda run, timed: track_recording(recording, voxel, tracker, args.seed, run, timed))


def _by_keypoints(args: argparse.Namespace, recording: Recording) -> _Work:
    from hmc.errors import InputError
    from hmc.pose.keypoint_tracks import tracks_of_keypoints

    said = {name: getattr(args, name) for name, unsaid in OF_SILHOUETTES.items() if getattr(args, name) != unsaid}
    given = ["--" + ("no-" if value is False else "") + name.replace("_", "-") for name, value in said.items()]
    if given:
        raise InputError(f"--cues {args.cues}: has no use for {', '.join(given)}; leave {'it' if len(given) == 1 else 'them'} out")
    source = open_given_keypoints(recording, f"--cues {args.cues}")
    return _Work(recording, "keypoints", {"cues": args.cues}, lambda run, timed: tracks_of_keypoints(recording, source, run), source.notes)


def _speed(timing, fps: float) -> dict[str, float]:
    """Seconds and real-time factors (Canton 2009, Eq. 4.24-4.27), of the whole chain and of the filter alone; empty without frames."""
    from dataclasses import asdict

    from hmc.metrics.timing import real_time_factor

    seconds = timing.input_s + timing.filter_s + timing.lifecycle_s
    if not timing.frames or not timing.filter_s > 0:
        return {}
    return asdict(timing) | {
        "real_time_factor": real_time_factor(timing.frames, seconds, fps),
        "filter_real_time_factor": real_time_factor(timing.frames, timing.filter_s, fps),
    }


def _summary(table, n_frames: int) -> str:
    import numpy as np

    persons, counts = np.unique(table.persons, return_counts=True)
    if len(persons) == 0:
        return f"no person in {n_frames} frames"
    lines = [f"{len(persons)} person{'s' if len(persons) > 1 else ''} in {n_frames} frames"]
    for person, count in zip(persons[:20], counts, strict=False):
        frames = table.frames[table.persons == person]
        lines.append(f"  person {person}: {count} frames, from {frames.min()} to {frames.max()}")
    if len(persons) > 20:
        lines.append(f"  and {len(persons) - 20} more")
    return "\n".join(lines)
