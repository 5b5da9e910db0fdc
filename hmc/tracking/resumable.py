"""All tracks of a whole recording, so that a run that was stopped goes on where it was.

Every `CHECKPOINT_FRAMES` frames the tracker's rows and its whole state go into a journal. A run that is started again with the same
journal and the same key reads them and computes what is left. What is guaranteed: finished frames are kept as they were, and the
tracker goes on from exactly the state it had. The background models are not stored; they are learnt again and then segment the
`WARM_UP_FRAMES` frames before. Where that reaches back to the start of the selection, the result is identical to that of a run
without a stop; later on the background has adapted to the last frames only, which may change single pixels of the silhouettes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import astuple, dataclass, field, replace
from time import perf_counter, thread_time
from typing import Any

from hmc.errors import InputError
from hmc.io.camera_faults import Faults, sentence
from hmc.io.journal import append_journal, open_journal
from hmc.io.masks import MaskStep, keep_masks, kept_masks
from hmc.io.recording import Recording, iterate_frames
from hmc.io.results import TrackTable
from hmc.tracking.account import Account, account_of, remarks
from hmc.tracking.blobs import Observation, observe
from hmc.tracking.following import finish, init
from hmc.tracking.state import TrackerState, TrackRow
from hmc.tracking.stored import from_plain, to_plain
from hmc.tracking.trackers import Tracker, make_tracker
from hmc.tracking.tracks import frame_rng, table_of
from hmc.tracking.views import FrameViews
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import HullStep, stream_hulls
from hmc.voxels.run_options import RunOptions

__all__ = ["WARM_UP_FRAMES", "Timing", "kept_silhouettes", "observe_step", "person_grid", "track_recording"]

CHECKPOINT_FRAMES = 25
WARM_UP_FRAMES = 300
#: Coarser voxels do not show people.
MAX_VOXEL_M = 0.15


def track_recording(
    recording: Recording,
    voxel_size_m: float = 0.05,
    tracker: Tracker | None = None,
    seed: int = 0,
    run: RunOptions | None = None,
    on_timing: Callable[[Timing], None] | None = None,
) -> TrackTable:
    """The tracks of all persons in the selection.

    Parameters
    ----------
    recording : Recording
    voxel_size_m : float
    tracker : Tracker, optional
        By default as `hmc.tracking.trackers.make_tracker`.
    seed : int
        Of the tracker's random numbers.
    run : RunOptions, optional
    on_timing : callable, optional
        Called at the end with the time that was spent.

    What a run says of itself when it is over (`hmc.tracking.account`) goes where its problems go.

    Returns
    -------
    TrackTable
        With heads; persons numbered from 0 in the order in which they were first seen.

    Raises
    ------
    InputError
        When the voxels are too coarse, or too many for the memory.
    """
    tracker, run = tracker or make_tracker(), run or RunOptions()
    grid = person_grid(recording, voxel_size_m)
    done = _resumed(run, recording)
    state, rows, problems = done.state, list(done.rows), list(done.problems)

    def note(line: str) -> None:
        problems.append(line)
        run.on_problem(line)

    for line in problems:
        run.on_problem(line)
    if len(recording.rig) < 2:
        run.on_problem("one camera does not tell how far away people are; two at least are needed to find them, better four")
    end = recording.start + recording.n_frames
    first, kept = done.next_frame, kept_silhouettes(recording, run, done.next_frame, tracker.color)
    stream = stream_hulls(
        recording, grid, run.frontend, first=first, warm_up=WARM_UP_FRAMES, masks=kept, on_problem=note, workers=run.workers
    )
    if run.masks is not None and kept is None:
        stream = keep_masks(run.masks, run.key, first, stream, note)
    hulls: Iterable[HullStep] = stream if done.next_frame < end else ()
    timing, account, faults, before = done.timing, done.account, done.faults, perf_counter()
    for hull in run.progress(hulls, end - done.next_frame) if run.progress else hulls:
        observation = observe_step(recording, grid, hull, images=tracker.color)
        begun = thread_time()
        state, info = tracker.step(frame_rng(seed, hull.index), state, hull.index, observation)
        lifecycle_s = thread_time() - begun - info.color_s - info.filter_s
        now = perf_counter()
        timing = timing.plus(Timing(1, max(0.0, now - before - info.filter_s - lifecycle_s), info.filter_s, lifecycle_s))
        before = now
        rows += info.rows
        account = account.plus(account_of(observation, info))
        faults = faults.plus(hull.index, hull.faults)
        n_frames = hull.index + 1 - recording.start
        if run.journal is not None and (n_frames % CHECKPOINT_FRAMES == 0 or n_frames == recording.n_frames):
            now_done = CompletedFrames(hull.index + 1, state, tuple(rows), tuple(problems), timing, account, faults)
            append_journal(run.journal, _record(now_done, since=done))
            done, before = now_done, perf_counter()
    rows += finish(state, recording.n_frames, tracker.following)
    if on_timing is not None:
        on_timing(timing)
    for fault in faults.all:
        run.on_problem(sentence(fault, end))
        run.on_fault(fault)
    table = table_of(rows, recording.fps, reidentified=state.reidentified)
    for line in remarks(account, table, recording.fps, recording.persons):
        run.on_problem(line)
    return table


def kept_silhouettes(recording: Recording, run: RunOptions, first: int, images: bool = False) -> Iterable[MaskStep] | None:
    """The silhouettes from a frame to the end of the selection that were kept; None where not all of them were.

    Parameters
    ----------
    recording : Recording
    run : RunOptions
    first : int
        Absolute frame number.
    images : bool
        Whether the images are wanted besides; they are read again.
    """
    end = recording.start + recording.n_frames
    kept = None if run.masks is None else kept_masks(run.masks, run.key, first, end)
    if kept is None or not images:
        return kept
    frames = iterate_frames(recording, first, end, run.on_problem)
    return (replace(step, images=frame.images) for step, frame in zip(kept, frames, strict=True))


def person_grid(recording: Recording, voxel_size_m: float) -> VoxelGrid:
    """The recording's room in voxels that show people.

    Raises
    ------
    InputError
        When the voxels are too coarse, or too many for the memory.
    """
    if not 0 < voxel_size_m <= MAX_VOXEL_M:
        raise InputError(f"voxels of {voxel_size_m:g} m do not show people; choose at most {MAX_VOXEL_M:g} m")
    return VoxelGrid.from_room(recording.room, voxel_size_m, len(recording.rig))


def observe_step(recording: Recording, grid: VoxelGrid, hull: HullStep, images: bool = False) -> Observation | None:
    """What the tracker sees of a frame, or None where it tells nothing.

    That is the tolerant hull, the strict one in it, the silhouettes and, where colors are asked for, the images.
    """
    if not hull.usable:
        return None
    return observe(grid, hull.tolerant, hull.strict, FrameViews(recording.rig, hull.masks, hull.images if images else ()))


@dataclass(frozen=True)
class Timing:
    """Where the time went (Canton 2009, Eq. 4.24), seconds over all frames.

    Filter and life cycle are counted in processor time, as in Eq. 4.28; the input is the rest of the time that passed.

    Attributes
    ----------
    frames : int
    input_s : float
        Reading, segmenting, carving, components and colors.
    filter_s : float
        Says where the known people are.
    lifecycle_s : float
        Sharing out voxels, creation and deletion of tracks.
    """

    frames: int = 0
    input_s: float = 0.0
    filter_s: float = 0.0
    lifecycle_s: float = 0.0

    def plus(self, other: Timing) -> Timing:
        """Both together."""
        return Timing(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))


@dataclass(frozen=True)
class CompletedFrames:
    """What is done of a run: the frames before `next_frame`."""

    next_frame: int
    state: TrackerState
    rows: tuple[TrackRow, ...] = ()
    problems: tuple[str, ...] = ()
    timing: Timing = field(default_factory=Timing)
    account: Account = field(default_factory=Account)
    faults: Faults = field(default_factory=Faults)


def _resumed(run: RunOptions, recording: Recording) -> CompletedFrames:
    """What the journal says is done."""
    done = CompletedFrames(recording.start, init(recording.fps, recording.persons))
    for record in open_journal(run.journal, run.key, run.on_problem):
        new = from_plain(CompletedFrames, record)
        done = replace(new, rows=done.rows + new.rows, problems=done.problems + new.problems)
    return done


def _record(done: CompletedFrames, since: CompletedFrames) -> dict[str, Any]:
    """A record of the journal: the state, and what is new since the last record."""
    return to_plain(replace(done, rows=done.rows[len(since.rows) :], problems=done.problems[len(since.problems) :]))
