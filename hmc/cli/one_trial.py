"""One trial of a session: checked, posed, drawn. What was done before is found, by the commands' own journals."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from hmc.cli.option_tables import arguments_of
from hmc.errors import InputError

__all__ = ["TrialOptions", "pose_arguments", "run_trial"]


@dataclass(frozen=True)
class TrialOptions:
    """How trials are run.

    Parameters
    ----------
    out : Path
        Folder of all trials' results.
    workers : int
        Processes of one trial; 0: as many as there are processors.
    video : bool
        Write a video of the overlays too.
    quiet : bool
        No progress bars.
    """

    out: Path
    workers: int = 0
    video: bool = False
    quiet: bool = False


def pose_arguments(session, trial, options: TrialOptions):
    """The arguments of `hmc pose` for a trial.

    Raises
    ------
    InputError
        When the session's options are none of that command.
    """
    from hmc.cli import command_parser, make_parser, repeated

    parser = make_parser("pose")
    command = command_parser(parser, "pose")
    words = arguments_of(command, trial.pose, f"{session.path}: [pose] of trial {trial.name}", session.path.parent)
    given = ["--session", str(session.path), "--out", str(options.out / trial.name), "--workers", str(options.workers)]
    call = ["pose", str(trial.places.path), *given, *["--quiet"] * options.quiet, *words]
    args = parser.parse_args(call)
    if args.like is not None:
        args = repeated(parser, args, call)
    return args


def run_trial(session, trial, options: TrialOptions) -> None:
    """Run a trial to its end, or find that it was; the state in its folder says how it ended.

    Parameters
    ----------
    session : Session
    trial : Trial
    options : TrialOptions

    Raises
    ------
    InputError
        What is wrong with the trial.
    """
    from hmc.trials.state import BEGUN, DONE, FAILED, only_one, read_state, write_state

    folder = options.out / trial.name
    with only_one(folder):
        try:
            state = replace(read_state(folder), status=BEGUN, fault="")
        except InputError:
            (folder / "trial.toml").unlink(missing_ok=True)
            state = read_state(folder)
        try:
            for stage in (_check, _pose, _view):
                state = stage(session, trial, options, state)
                write_state(folder, state)
            write_state(folder, replace(state, status=DONE))
        except Exception as error:
            words = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
            write_state(folder, replace(read_state(folder), status=FAILED, fault=words))
            raise


def _timed(state, stage: str, work: Callable[[], object]):
    begun = time.perf_counter()
    work()
    return replace(state, seconds={**state.seconds, stage: round(time.perf_counter() - begun, 1)})


def _check(session, trial, options: TrialOptions, state):
    """Look the recording over, unless it was in this form before."""
    from hmc.camera.rig_picture import rig_figure
    from hmc.check import inspect_recording
    from hmc.cli.common import places_source
    from hmc.io.files import to_toml, write_figure
    from hmc.trials.page import CHECK_PICTURE
    from hmc.trials.state import digest, write_state

    args, picture = pose_arguments(session, trial, options), options.out / trial.name / CHECK_PICTURE
    source = digest(to_toml({**places_source(trial.places), "cameras": args.cameras}).encode())
    if state.checked == source and picture.exists():
        return state
    found: list = []

    def check() -> None:
        inspection = inspect_recording(trial.places, args.cameras)
        found.extend(inspection.findings)
        picture.unlink(missing_ok=True)
        if inspection.rig is not None and inspection.room is not None:
            write_figure(picture, rig_figure(inspection.rig, inspection.room, inspection.images, trial.name, inspection.floor), dpi=90)

    state = replace(_timed(state, "check", check), findings=tuple(map(str, found)), checked=source)
    for finding in found:
        print(finding)
    errors = [finding.sentence for finding in found if finding.severity == "error"]
    if errors:
        write_state(options.out / trial.name, replace(state, checked=""))
        raise InputError("; ".join(errors))
    return state


def _pose(session, trial, options: TrialOptions, state):
    """Track and pose, or find that it was done."""
    from hmc.cli.pose import run

    args, result = pose_arguments(session, trial, options), options.out / trial.name / "run.toml"
    before = result.stat().st_mtime_ns if result.exists() else None
    timed = _timed(state, "pose", lambda: run(args))
    return state if result.stat().st_mtime_ns == before else timed


def _view(session, trial, options: TrialOptions, state):
    """Pictures of some moments, and the video where it is asked for, unless they are of this result."""
    from hmc.cli.common import progress
    from hmc.io.recording import open_recording
    from hmc.trials.moments import write_moments
    from hmc.trials.page import MOMENTS_FOLDER, VIDEO
    from hmc.trials.state import digest
    from hmc.view.mosaic import read_result
    from hmc.view.write import write_view

    folder = options.out / trial.name
    made, video = digest((folder / "joints.csv").read_bytes(), (folder / "pose.npz").read_bytes()), folder / VIDEO
    drawn, filmed = state.drawn == made, state.drawn == made and video.exists()
    if drawn and (filmed or not options.video):
        return state
    args = pose_arguments(session, trial, options)
    recording = open_recording(trial.places, cameras=args.cameras, start=args.start, frames=args.frames)

    def view() -> None:
        result = read_result(folder)
        if not drawn:
            video.unlink(missing_ok=True)
            write_moments(folder / MOMENTS_FOLDER, recording, result)
        if options.video:
            write_view(video, recording, result, (), None, True, (None, lambda steps, total: progress(steps, total, "view", options.quiet)))

    return replace(_timed(state, "view", view), drawn=made)
