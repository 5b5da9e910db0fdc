"""``hmc pose``: the pose of every person in every frame."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hmc.cli.common import (
    add_image_option,
    add_plugin_option,
    add_selection_options,
    add_workers_option,
    cameras_table,
    float_from_zero,
    gather_problems,
    image_parameters,
    load_given_plugins,
    note_changes,
    open_given_keypoints,
    open_meanwhile,
    output_path,
    positive_float,
    print_problems,
    recording_source,
    refuse_no_folder,
    selected_workers,
    unlike_its_run,
    was_finished,
    whole_number,
    written_digests,
)
from hmc.cli.kept import MASKS, add_silhouette_options, given_silhouettes, leaving_silhouettes, silhouettes_source, take_silhouettes
from hmc.cli.option_tables import add_like_option, repeated_preset, told_options
from hmc.cli.pose_markers import MARKERS_JOURNAL, add_marker_options, read_markers, refuse_markers
from hmc.cli.run_bar import FIRST_POSE, FITTING, FOLLOWING, LEARNING, SECOND_PASS, TRACKING, VIEWS, RunBar
from hmc.cli.track import JOURNAL, add_tracker_options, selected_frontend, selected_tracker
from hmc.io.files import real_path
from hmc.io.result_files import RESULT
from hmc.pose.registry import BUILT_IN, INITS, METHODS, pose_method

if TYPE_CHECKING:
    from hmc.io.camera_faults import CameraFault

__all__ = ["add_parser", "run"]

#: The journal of a run that is not finished.
POSE_JOURNAL = ".pose.journal"
BACK_JOURNAL = ".back.journal"
#: Time over which poses are smoothed where no other is said, seconds.
SMOOTH_S = 0.3
#: What `--cues` may say.
CUES = ("silhouettes", "silhouettes,keypoints", "keypoints")


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "pose",
        help="the pose of every person in every frame",
        description="Find and follow all persons in a recording and fit an articulated body to each. Writes tracks.csv, joints.csv (frame, "
        "person, joint, x, y, z; metres), pose.npz (state vectors and bodies) and run.toml. A run that was stopped goes on where it was "
        "when it is started again; a finished one is not repeated unless the recording or a parameter changed.",
    )
    add_selection_options(parser)
    add_workers_option(parser)
    parser.add_argument("--out", type=output_path, required=True, metavar="DIR", help="folder of the result")
    add_like_option(parser)
    parser.add_argument(
        "--method",
        metavar="NAME",
        help="; ".join(f"{entry.name}: {entry.help}" for entry in METHODS.values())
        + "; or one of --plugin (default: apf; with --cues keypoints: keypoints)",
    )
    add_plugin_option(parser)
    parser.add_argument(
        "--model",
        action="append",
        default=[],
        metavar="1|2|auto|FILE",
        help="scalable body model: 1 (default; whole limbs first), 2 (upper arms and thighs first), auto (what suits the pose, frame by "
        "frame), or a TOML file; shbm-ddm-apf takes two, one of each kind",
    )
    parser.add_argument(
        "--init",
        choices=INITS,
        help="where poses start, and start anew after a loss: typical poses at every heading (default), or the skeleton in the "
        "voxels themselves",
    )
    named = {name for entry in METHODS.values() for name in entry.presets}
    parser.add_argument(
        "--preset", default="default", metavar="NAME", help=f"{', '.join(sorted(named))}: as printed, where a work is named"
    )
    parser.add_argument(
        "--settings",
        type=Path,
        metavar="FILE.toml",
        help="values in place of the preset's, in tables as [parameters.preset] of run.toml has them: [annealed] layers = 3",
    )
    parser.add_argument("--voxel", type=positive_float, default=0.03, metavar="M", help="side of a voxel, metres (default: 0.03)")
    add_image_option(parser)
    add_tracker_options(parser)
    parser.add_argument(
        "--tracks", type=Path, metavar="FILE", help="tracks.csv of these people, as `hmc track` writes it; made here where left out"
    )
    parser.add_argument("--track-voxel", type=positive_float, default=0.05, metavar="M", help="the same for the tracker (default: 0.05)")
    parser.add_argument("--seed", type=whole_number, default=0, metavar="N", help="seed of the random numbers (default: 0)")
    parser.add_argument(
        "--height",
        default="recording",
        metavar="M|auto",
        help="every person's stature in metres; auto: estimated from each person's volume; by default what recording.toml says of a "
        "single person, else auto",
    )
    parser.add_argument(
        "--cues",
        choices=CUES,
        metavar="|".join(CUES),
        help="what poses are fitted to: silhouettes alone, with the keypoints that a 2-D detector left in the recording, for "
        "methods that refine (default: both where both are there), or with these keypoints alone, without any silhouette",
    )
    parser.add_argument(
        "--passes",
        type=int,
        choices=(1, 2),
        default=2,
        help="1: forward in time only; 2 (default): then backward, with each person's own body, and smooth, where the method has that",
    )
    parser.add_argument(
        "--smooth",
        type=float_from_zero,
        nargs="?",
        const=SMOOTH_S,
        metavar="S",
        help=f"smooth the finished poses over so many seconds (without a number: {SMOOTH_S}); 0: leave them as they were found "
        "(default: .2 after two passes, 0 after one; a time of fewer than five frames smooths nothing)",
    )
    add_silhouette_options(parser)
    add_marker_options(parser)
    return parser


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    with ExitStack() as held:
        return _run(args, held)


def _run(args: argparse.Namespace, held: ExitStack) -> int:
    opened = open_meanwhile(args, held)  # and import meanwhile what poses need
    from hmc.io.files import to_toml
    from hmc.io.lock import only_run
    from hmc.io.results import write_run, write_tracks
    from hmc.pose.chain import ChainRuns, finished_poses
    from hmc.pose.follow import FollowOptions, for_method
    from hmc.pose.keypoint_tracks import tracks_of_keypoints
    from hmc.pose.method import as_found
    from hmc.tracking.resumable import person_grid, track_recording
    from hmc.trials.quality import trust_summary
    from hmc.voxels.run_options import RunOptions

    plugins = load_given_plugins(args)
    name = args.method or ("keypoints" if args.cues == CUES[2] else "apf")
    method = pose_method(name, args.preset, args.model, args.init, args.markers == "skin", args.passes, _settings(args, name))
    if "detections" not in method.needs:
        refuse_markers(args)
    if args.smooth is not None:
        method = as_found(method)
    recording = opened()
    if not args.full_images:
        recording = for_method(recording, method, min(args.voxel, args.track_voxel))
    refuse_no_folder(args.out, recording)
    height, hulls, frontend = _height(args.height, recording), method.needs_hulls, selected_frontend(args)
    source_of_keypoints = _keypoints(args.cues, recording, method)
    parameters: dict[str, Any] = {
        "start": recording.start,
        "frames": recording.n_frames,
        "cameras": list(recording.rig.names),
        "room_m": recording.room,
        "fps": recording.fps,
        "height_m": height or "auto",
        "preset": method.settings,
        "init": args.init,
        "window_s": method.window_s,
        "recovery": getattr(method.recover, "settings", None),
        "legs": method.legs,
        "back": method.back,
        "smooth_s": args.smooth or 0.0,
        **image_parameters(recording),
        **plugins,
    }
    if source_of_keypoints is not None:
        parameters["cues"] = CUES[1 if hulls else 2]
    given = None if args.tracks is None else _given_tracks(args, method, recording)
    if hulls:
        person_grid(recording, args.voxel)  # voxels that will not do are refused before any work is done
        tracker = selected_tracker(args)
        parameters["voxel_size_m"] = args.voxel
        if given is None:
            parameters |= {"track_voxel_size_m": args.track_voxel, "tracker": tracker.settings}
        parameters["frontend"] = frontend
    source, markers = recording_source(recording), None
    silhouettes = given_silhouettes(args, recording, hulls)
    source |= silhouettes_source(silhouettes)
    if given is not None:
        source |= {"tracks": real_path(args.tracks), "tracks_changed": str(args.tracks.stat().st_mtime_ns)}
    if "detections" in method.needs:
        markers = read_markers(args, recording)
        parameters |= markers.parameters
        source |= markers.source
    depends_on = {"method": name, "seed": args.seed, **source, "parameters": parameters}
    key, paths = to_toml(depends_on), {name: args.out / name for name in RESULT}
    held.enter_context(only_run(args.out))
    if was_finished([paths[name] for name in RESULT[:3]], paths["run.toml"], depends_on):
        return 0

    problems: list[str] = [*recording.problems, *([] if given is None else unlike_its_run(args.tracks.parent, [args.tracks.name]))]
    faults: list[CameraFault] = []

    stages = [TRACKING] * (given is None) + [FIRST_POSE, FOLLOWING] + [FITTING, SECOND_PASS] * (method.back is not None) + [VIEWS]
    megapixels = sum(camera.size[0] * camera.size[1] for camera in recording.rig) / 1e6
    bar = RunBar(stages, recording.n_frames, recording.persons or 1, args.quiet, megapixels=megapixels)

    def kept(journal: str, stage: str, first: str | None = None) -> RunOptions:
        """The run of a stage; the tracker leaves its silhouettes for the poses."""
        masks = args.out / MASKS if hulls else None
        return RunOptions(
            frontend,
            args.out / journal,
            masks,
            key,
            problems.append,
            bar.stage(stage, first),
            selected_workers(args),
            bar.phase,
            faults.append,
        )

    take_silhouettes(silhouettes, recording, args.out / MASKS, key, problems.append)
    tracks = given
    if given is None and hulls:
        tracks = track_recording(
            recording, args.track_voxel, tracker, args.seed, kept(JOURNAL, TRACKING, None if silhouettes else LEARNING)
        )
    elif given is None and method.needs_tracks:
        tracks = tracks_of_keypoints(recording, source_of_keypoints, kept(JOURNAL, TRACKING))
    leave = held.enter_context(leaving_silhouettes(args, recording, key, problems.append)) if hulls else None
    bar.people = 1 if tracks is None else len(set(tracks.persons.tolist()))
    detections = None if markers is None else markers.table(args, key, problems)
    runs = ChainRuns(kept(POSE_JOURNAL, FOLLOWING), kept(BACK_JOURNAL, SECOND_PASS), kept(POSE_JOURNAL, VIEWS))
    options = FollowOptions(args.voxel, args.seed, height, detections)
    people = finished_poses(recording, tracks, method, options, runs, source_of_keypoints, args.smooth)
    if markers is not None:
        markers.refuse_nothing(people)
    problems += people.notes
    if source_of_keypoints is not None:
        problems += source_of_keypoints.notes
    if leave is not None:
        leave()
    write_tracks(paths["tracks.csv"], _pelvis_tracks(people) if tracks is None else tracks)
    people.save(args.out)
    note_changes(recording, source, problems)
    trust = trust_summary(people.poses)
    said = ({"trust": trust} if trust else {}) | {"options": told_options(args), "problems": gather_problems(problems)}
    said |= cameras_table(faults)
    if people.known:
        in_percent = {str(person): {name: round(100 * one, 1) for name, one in told.items()} for person, told in people.known.items()}
        said["bodies"] = {"known_to_percent": in_percent}
    said["written"] = written_digests([paths[result] for result in RESULT[:3]])
    write_run(paths["run.toml"], name, parameters, args.seed, **source, **said)
    for name in (JOURNAL, POSE_JOURNAL, BACK_JOURNAL, MARKERS_JOURNAL, MASKS):
        for file in args.out.glob(f"{name}*"):
            file.unlink()
    _tell(people, recording, paths["joints.csv"])
    print_problems(problems)
    return 0


def _settings(args: argparse.Namespace, name: str):
    """Values in place of the preset's: those of the run that is repeated, then those of ``--settings``."""
    from hmc.io.nested_settings import SettingsTable, read_settings_table

    repeated = repeated_preset(args) if name in BUILT_IN else None
    tables = [] if repeated is None else [SettingsTable(*repeated, complete=True)]
    return tables + ([] if args.settings is None else [read_settings_table(args.settings)])


def _keypoints(cues: str | None, recording, method):
    """The keypoints that are to be used, or None: those that are there, unless silhouettes alone are asked for."""
    from hmc.errors import InputError
    from hmc.io.keypoints import open_keypoints

    alone = "keypoints" in method.needs
    if cues == CUES[2] and (method.needs_hulls or not alone):
        raise InputError(f"--cues {cues}: method {method.name} needs more than keypoints; leave --method out")
    if cues in CUES[:2] and alone and not method.needs_hulls:
        raise InputError(f"--cues {cues}: method {method.name} has no use for silhouettes; leave --method or --cues out")
    if cues == CUES[1] and not method.keypoints:
        raise InputError(f"--cues {cues}: this method has no use for keypoints; use the preset `default` of apf, smd or pso, say")
    if cues == CUES[0] or not (method.keypoints or alone):
        return None
    if cues is None and not alone:
        return open_keypoints(recording)
    return open_given_keypoints(recording, f"--cues {cues}" if cues else f"--method {method.name}")


def _given_tracks(args: argparse.Namespace, method, recording):
    """The tracks of ``--tracks`` in the recording's selection."""
    from hmc.errors import InputError
    from hmc.io.results import read_tracks

    if not method.needs_tracks:
        raise InputError(f"--tracks {args.tracks}: method {method.name} needs no tracks; leave one of both out")
    if args.tracker is not None:
        raise InputError(f"--tracks {args.tracks}: --tracker {args.tracker} would have nothing to do; leave one of both out")
    if real_path(args.tracks) == real_path(args.out / "tracks.csv"):
        raise InputError(f"--tracks {args.tracks}: is what --out {args.out} would overwrite; choose another folder")
    table = read_tracks(args.tracks)
    table = table.where((table.frames >= recording.start) & (table.frames < recording.start + recording.n_frames))
    if not len(table.frames):
        raise InputError(f"--tracks {args.tracks}: has nobody in these frames; choose others with --start and --frames")
    return table


def _pelvis_tracks(people):
    """Positions of persons that no tracker gave: the pelvis and the top of the head."""
    from hmc.io.results import TrackTable
    from hmc.landmarks import landmark_index

    positions = people.poses.positions
    fitted = [status == "fitted" for status in people.status]
    pelvis, head = (positions[fitted, landmark_index(name)] for name in ("pelvis", "head_top"))
    return TrackTable(people.poses.frames[fitted], people.poses.persons[fitted], pelvis, head)


def _tell(people, recording, path: Path) -> None:
    """Print the persons that were found."""
    from hmc.trials.quality import person_lines, trust_line

    lines = [*person_lines(people.poses, people.states, recording.n_frames), *trust_line(people.poses)]
    print(*lines, f"wrote {path}", sep="\n")


def _height(text: str, recording) -> float | None:
    """The stature that is given, metres, or None where it is to be estimated."""
    from hmc.errors import InputError

    if text == "auto":
        return None
    if text == "recording":
        return recording.known_height_m
    try:
        height = float(text)
    except ValueError:
        height = float("nan")
    if not 0.5 <= height <= 2.6:
        raise InputError(f"--height {text}: give a stature in metres (1.75) or 'auto'")
    return height
