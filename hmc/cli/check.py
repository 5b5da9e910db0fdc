"""``hmc check``: what is wrong with a recording, and a picture of its rig."""

from __future__ import annotations

import argparse
from pathlib import Path

from hmc.cli.common import add_session_option, camera_names, given_places, output_path
from hmc.io.files import real_path
from hmc.io.own_files import refuse_own_file

__all__ = ["add_parser", "run"]


def add_parser(subparsers) -> None:
    """Add the command to the argument parser."""
    parser = subparsers.add_parser(
        "check",
        help="tell what is wrong with a recording, and draw its rig",
        description="Look a recording over, tell everything that is wrong with it, and draw its rig from above with a frame of every view. "
        "Where a 2-D keypoint detector left its results, tell how far the cameras agree. "
        "The exit code is 2 if the recording cannot be used.",
    )
    parser.add_argument("recording", type=Path, help="folder of the recording")
    add_session_option(parser)
    parser.add_argument("--out", type=output_path, default=None, metavar="FILE.png", help="the picture (default: NAME_check.png here)")
    parser.add_argument("--cameras", type=camera_names, default=None, metavar="A,B,...", help="look at these cameras only (default: all)")
    parser.add_argument("--all", action="store_true", help="read every frame (default: the first 90)")


def run(args: argparse.Namespace) -> int:
    """Print one line a finding, a table of keypoints where there are some, and a last line that sums up; write the picture."""
    from hmc.check import inspect_recording
    from hmc.check.cures import pose_command, sync_command

    places = given_places(args)
    if args.out is not None:
        refuse_own_file(args.out, places)
    inspection = inspect_recording(places, args.cameras, args.all)
    for finding in inspection.findings:
        print(finding)
    if inspection.keypoints is not None:
        from hmc.check.keypoints import agreement_lines

        print(*agreement_lines(inspection.keypoints), sep="\n")
    name = real_path(args.recording).name
    verdict = f"{name}: {_summary(inspection)}"
    if inspection.rig is not None and inspection.room is not None:
        from hmc.camera.rig_picture import rig_figure
        from hmc.io.files import write_figure

        out = args.out or Path(f"{name}_check.png")
        title = "\n".join([verdict, *(str(finding) for finding in inspection.findings if finding.severity != "note")])
        write_figure(out, rig_figure(inspection.rig, inspection.room, inspection.images, title, inspection.floor), dpi=90)
        print(f"picture: {out}")
    if inspection.usable:
        pose = pose_command(places, f"{name}-result", *(["--cameras", ",".join(args.cameras)] if args.cameras else []))
        print(*([f"next: {sync_command(places)}", f"then: {pose}"] if inspection.out_of_time else [f"next: {pose}"]), sep="\n")
    print(verdict)
    return 0 if inspection.usable else 2


def _summary(inspection) -> str:
    counts = [sum(finding.severity == severity for finding in inspection.findings) for severity in ("error", "warning")]
    words = " and ".join(f"{n} {word}{'s' * (n > 1)}" for n, word in zip(counts, ("error", "warning"), strict=True) if n)
    recording = inspection.recording
    if recording is None:
        return f"cannot be used ({words})"
    what = f"{len(recording.rig)} cameras, {recording.n_frames} frames, {recording.fps:g} a second"
    return f"{'can' if inspection.usable else 'cannot'} be used{f' ({words})' if words else ''}: {what}"
