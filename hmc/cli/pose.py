"""``hmc pose``: the pose of everybody in every frame."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hmc.cli.common import (
    add_selection_options,
    open_selected,
    positive_float,
    print_problems,
    progress,
    recording_source,
    was_finished,
    whole_number,
)
from hmc.cli.pose_markers import add_marker_options, run_markers
from hmc.cli.track import JOURNAL, add_tracker_options, selected_tracker

__all__ = ["add_parser", "run"]

METHODS = ("apf", "shbm-apf", "ddm-apf", "shbm-ddm-apf", "smd", "pso", "marker-apf")
#: The journal of a run that is not finished.
POSE_JOURNAL = ".pose.journal"
#: Methods whose poses can be smoothed.
SMOOTHABLE = ("apf", "shbm-apf", "ddm-apf", "shbm-ddm-apf")
#: Time over which poses are smoothed where no other is said, seconds.
SMOOTH_S = 0.3
#: Its silhouettes, which the tracker leaves for the poses.
MASKS = ".masks"


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "pose",
        help="the pose of everybody in every frame",
        description="Find and follow everybody in a recording and fit an articulated body to each. Writes tracks.csv, joints.csv (frame, "
        "person, joint, x, y, z; metres), pose.npz (state vectors and bodies) and run.toml. A run that was stopped goes on where it was "
        "when it is started again; a finished one is not repeated unless the recording or a parameter changed.",
    )
    add_selection_options(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the result")
    parser.add_argument(
        "--method",
        choices=METHODS,
        default="apf",
        help="apf: annealed particle filter (default); shbm-apf: by models of rising "
        "detail; ddm-apf: without the limbs that the data does not show; shbm-ddm-apf: both; smd: superellipsoids by stochastic "
        "meta descent, the quickest; pso: spectral skeleton and particle swarm, without tracking of the pose; marker-apf: on markers",
    )
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
        choices=("hypotheses", "spectral"),
        help="where particle filters start, and start anew after a loss: typical poses at every heading (default), or the skeleton in the "
        "voxels themselves",
    )
    parser.add_argument("--preset", default="default", metavar="NAME", help="default, or canton2009 or kehl2006 (smd): as printed")
    parser.add_argument("--voxel", type=positive_float, default=0.03, metavar="M", help="side of a voxel, metres (default: 0.03)")
    add_tracker_options(parser)
    parser.add_argument("--track-voxel", type=positive_float, default=0.05, metavar="M", help="the same for the tracker (default: 0.05)")
    parser.add_argument("--seed", type=whole_number, default=0, metavar="N", help="seed of the random numbers (default: 0)")
    parser.add_argument(
        "--height",
        default="recording",
        metavar="M|auto",
        help="everybody's stature in metres; auto: estimated from each person's volume; by default what recording.toml says of a "
        "single person, else auto",
    )
    parser.add_argument(
        "--smooth",
        type=positive_float,
        nargs="?",
        const=SMOOTH_S,
        metavar="S",
        help=f"smooth the finished poses over so many seconds (without a number: {SMOOTH_S})",
    )
    add_marker_options(parser)
    return parser


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from dataclasses import replace

    import numpy as np

    from hmc.body.proportions import stature
    from hmc.errors import InputError
    from hmc.io.files import to_toml
    from hmc.io.results import write_joints, write_pose, write_run, write_tracks
    from hmc.pose.methods.pso import SwarmTask, pose_by_swarm, swarm_preset, write_fits
    from hmc.pose.methods.scalable import method_preset
    from hmc.pose.methods.smd import smd_preset
    from hmc.pose.methods.smd_sequence import SmdTask, pose_by_descent
    from hmc.pose.person import FollowSettings
    from hmc.pose.sequence import pose_recording
    from hmc.pose.smoothing import smooth_people
    from hmc.pose.steps.preset import pose_preset
    from hmc.tracking.resumable import person_grid, track_recording
    from hmc.voxels.hulls import FrontendSettings

    if args.smooth and args.method not in SMOOTHABLE:
        raise InputError(f"--smooth: not for --method {args.method}; it is for {', '.join(SMOOTHABLE)}")
    recording = open_selected(args)
    if args.method == "marker-apf":
        return run_markers(args, _height(args.height, recording), recording)
    smd, pso = args.method == "smd", args.method == "pso"
    if args.init and (smd or pso):
        raise InputError(f"--init: not for --method {args.method}; it is for the particle filters")
    preset: Any
    if pso:
        preset = swarm_preset(args.preset)
    else:
        preset = smd_preset(args.preset) if smd else method_preset(pose_preset(args.preset), args.method, args.model)
    if args.init:
        preset = replace(preset, start=args.init)
    if args.out.is_file():
        raise InputError(f"--out {args.out}: is a file; give a folder")
    height = _height(args.height, recording)
    person_grid(recording, args.voxel)  # voxels that will not do are refused before any work is done
    tracker, frontend, following = selected_tracker(args), FrontendSettings(), FollowSettings()
    parameters: dict[str, Any] = {
        "voxel_size_m": args.voxel,
        "track_voxel_size_m": args.track_voxel,
        "start": recording.start,
        "frames": recording.n_frames,
        "cameras": list(recording.rig.names),
        "room_m": recording.room,
        "fps": recording.fps,
        "height_m": height or "auto",
        "preset": preset,
        "following": following,
        "tracker": tracker.settings,
        "frontend": frontend,
        "smooth_s": args.smooth or 0.0,
    }
    source = recording_source(recording)
    depends_on = {"method": args.method, "seed": args.seed, **source, "parameters": parameters}
    key = to_toml(depends_on)
    paths = {name: args.out / name for name in ("tracks.csv", "joints.csv", "pose.npz", "run.toml")}
    if was_finished([paths["joints.csv"], paths["tracks.csv"], paths["pose.npz"]], paths["run.toml"], depends_on):
        return 0

    problems: list[str] = [*recording.problems]
    track_journal, pose_journal, masks = args.out / JOURNAL, args.out / POSE_JOURNAL, args.out / MASKS
    tracks = track_recording(
        recording,
        args.track_voxel,
        tracker,
        frontend,
        seed=args.seed,
        journal=track_journal,
        masks=masks,
        key=key,
        on_problem=problems.append,
        progress=lambda steps, total: progress(steps, total, "track", args.quiet),
    )
    passed: dict[str, Any] = {
        "frontend": frontend,
        "journal": pose_journal,
        "masks": masks,
        "key": key,
        "on_problem": problems.append,
        "progress": lambda steps, total: progress(steps, total, "pose", args.quiet),
    }
    if pso:
        swarm = SwarmTask(recording, preset, args.seed, height)
        people, fits = pose_by_swarm(swarm, tracks, args.voxel, **passed)
        write_fits(args.out / "fits.csv", fits)
    elif smd:
        people = pose_by_descent(SmdTask(recording, preset, args.seed, height), tracks, args.voxel, **passed)
    else:
        people = pose_recording(
            recording,
            tracks,
            args.voxel,
            preset,
            args.seed,
            height_m=height,
            settings=following,
            **passed,
        )
    if args.smooth:
        people = smooth_people(people, preset, recording.fps, args.smooth)
    problems += people.notes
    write_tracks(paths["tracks.csv"], tracks)
    write_joints(paths["joints.csv"], people.poses)
    write_pose(paths["pose.npz"], people.states)
    write_run(paths["run.toml"], args.method, parameters, args.seed, **source, problems=list(dict.fromkeys(problems)))
    for temporary in (track_journal, pose_journal, masks):
        for file in args.out.glob(f"{temporary.name}*"):
            file.unlink()
    for person in np.unique(people.poses.persons):
        rows = people.poses.persons == person
        frames, body = people.poses.frames[rows], people.states.bodies.get(int(person))
        tall = "no pose" if body is None else f"stature about {stature({name: float(value) for name, value in body.items()}):.2f} m"
        print(f"person {person}: {rows.sum()} frames, from {frames.min()} to {frames.max()}, {tall}")
    if not len(people.poses.frames):
        print(f"nobody in {recording.n_frames} frames")
    print(f"wrote {paths['joints.csv']}")
    print_problems(problems)
    return 0


def _height(text: str, recording) -> float | None:
    """The stature that is given, metres, or None where it is to be estimated."""
    from hmc.errors import InputError

    if text == "auto":
        return None
    if text == "recording":
        heights = recording.subject_height_m
        return float(heights[0]) if len(heights) == 1 and recording.persons in (None, 1) else None
    try:
        height = float(text)
    except ValueError:
        height = float("nan")
    if not 0.5 <= height <= 2.6:
        raise InputError(f"--height {text}: give a stature in metres (1.75) or 'auto'")
    return height
