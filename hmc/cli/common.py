"""Options that several commands share, the progress bar and the list of problems at the end."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from hmc.io.files import real_path
from hmc.io.result_files import UNFINISHED

if TYPE_CHECKING:
    from hmc.io.camera_faults import CameraFault

__all__ = [
    "add_image_option",
    "add_plugin_option",
    "add_selection_options",
    "add_session_option",
    "add_workers_option",
    "camera_names",
    "cameras_table",
    "file_digest",
    "float_from_zero",
    "gather_problems",
    "given_places",
    "image_parameters",
    "load_given_plugins",
    "made_from",
    "note_changes",
    "open_given_keypoints",
    "open_meanwhile",
    "open_selected",
    "output_path",
    "places_source",
    "positive_float",
    "print_problems",
    "progress",
    "recording_source",
    "refuse_no_folder",
    "selected_workers",
    "unlike_its_run",
    "was_finished",
    "whole_number",
    "written_digests",
]

T = TypeVar("T")


def add_selection_options(parser: argparse.ArgumentParser, of_run: bool = False) -> None:
    """Add the recording itself, ``--session``, ``--start``, ``--frames``, ``--cameras`` and ``--quiet``.

    Parameters
    ----------
    parser : ArgumentParser
    of_run : bool
        The command is about a result: what is not asked for is as its run had it (`hmc.io.results.run_selection`), and None until then.
    """
    first, many = ("as the result was made",) * 2 if of_run else ("0", "all")
    parser.add_argument("recording", type=Path, help="folder of the recording")
    add_session_option(parser)
    parser.add_argument("--start", type=whole_number, default=None if of_run else 0, metavar="N", help=f"first frame (default: {first})")
    parser.add_argument("--frames", type=whole_number, default=None, metavar="N", help=f"how many frames (default: {many})")
    parser.add_argument("--cameras", type=camera_names, default=None, metavar="A,B,...", help="use these cameras only (default: all)")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")


def add_session_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--session``."""
    parser.add_argument(
        "--session",
        type=Path,
        metavar="FILE",
        help="the session.toml that gives what the recording's folder lacks, of a trial of a session",
    )


def given_places(args: argparse.Namespace):
    """Where the parts of the recording lie, which may be a trial of ``--session``."""
    from hmc.io.places import RecordingPlaces

    if args.session is None:
        return RecordingPlaces(args.recording)
    from hmc.trials.session_file import places_in_session, read_session

    return places_in_session(read_session(args.session), args.recording)


def add_workers_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--workers``."""
    parser.add_argument(
        "--workers",
        type=whole_number,
        default=0,
        metavar="N",
        help="processes, which share the work (default: as many as there are processors); the result does not depend on it",
    )


def selected_workers(args: argparse.Namespace) -> int:
    """How many processes ``--workers`` asks for."""
    from hmc.processes import available_processors

    return args.workers or available_processors()


def add_image_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--full-images``."""
    parser.add_argument(
        "--full-images",
        action="store_true",
        help="use images as large as they are (default: large ones are made smaller, by whole factors, where voxels show no more of them)",
    )


def image_parameters(recording) -> dict[str, Any]:
    """What the parameters of a result say of smaller images: nothing where all are as large as they were recorded."""
    return {"image_factors": list(recording.factors)} if max(recording.factors) > 1 else {}


def add_plugin_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--plugin``."""
    parser.add_argument(
        "--plugin", type=Path, action="append", default=[], metavar="FILE.py", help="a file that registers methods or trackers of your own"
    )


def load_given_plugins(args: argparse.Namespace) -> dict[str, str]:
    """Run the files of ``--plugin``; what the parameters of a result say of them: nothing where there are none."""
    from hmc.plugins import add_plugins, plugins_version

    add_plugins(args.plugin)
    version = plugins_version()
    return {"plugins": version} if version else {}


def open_selected(args: argparse.Namespace):
    """Open the recording that `add_selection_options` describes."""
    from hmc.io.recording import open_recording

    return open_recording(given_places(args), cameras=args.cameras, start=args.start, frames=args.frames)


def open_meanwhile(args: argparse.Namespace, held: ExitStack) -> Callable[[], Any]:
    """Begin to open the recording that `add_selection_options` describes, in a thread: it is decoding, most of all.

    Parameters
    ----------
    args : Namespace
    held : ExitStack
        When it ends, the thread has ended.

    Returns
    -------
    callable
        Waits for the recording and gives it, or raises what `open_selected` does.
    """
    from concurrent.futures import ThreadPoolExecutor

    import hmc.io.recording  # noqa: F401  here, so that no two threads import it

    pool = held.enter_context(ThreadPoolExecutor(1))
    opened = pool.submit(open_selected, args)

    def wait() -> Any:
        with pool:  # no thread is left when processes are forked
            return opened.result()

    return wait


def open_given_keypoints(recording, asked: str):
    """The keypoints of a recording, for an option that does not do without.

    Parameters
    ----------
    recording : Recording
    asked : str
        The option, as it was given.

    Raises
    ------
    InputError
        When there are none.
    """
    from hmc.errors import InputError
    from hmc.io.keypoints import open_keypoints

    found = open_keypoints(recording)
    if found is None:
        raise InputError(f"{asked}: {recording.path} has no keypoints; put a detector's into keypoints/CAMERA/ (docs/conventions.md)")
    return found


def progress(iterable: Iterable[T], total: int | None = None, desc: str = "", quiet: bool = False) -> Iterator[T]:
    """Pass an iterable on, with a bar on stderr that shows frames a second and the time left."""
    if quiet:
        return iter(iterable)
    from tqdm import tqdm

    return iter(tqdm(iterable, total=total, desc=desc, unit="frame", dynamic_ncols=True, file=sys.stderr))


def gather_problems(problems: Iterable[str]) -> list[str]:
    """Each once; those that say the same of several cameras or files, before the colon, as one line that names them all."""
    said: dict[tuple[str, str], list[str]] = {}
    for problem in dict.fromkeys(problems):
        name, colon, words = problem.partition(": ")
        said.setdefault((colon, words if colon else problem), []).append(name)
    return [", ".join(names) + colon + words if colon else words for (colon, words), names in said.items()]


def cameras_table(faults: Sequence[CameraFault]) -> dict[str, Any]:
    """The table ``cameras`` of ``run.toml``: when which camera did not fit; nothing where all did."""
    from hmc.io.camera_faults import as_table

    return {"cameras": as_table(dict.fromkeys(faults))} if faults else {}


def print_problems(problems: Iterable[str]) -> None:
    """Print what was survived, one line each on stderr; nothing when there is nothing."""
    for problem in gather_problems(problems):
        print(f"note: {problem}", file=sys.stderr)


def output_path(text: str) -> Path:
    """argparse type: where something is to be written, whose name can be typed again: no sign before, no blank around it."""
    path = Path(text)
    odd = [part for part in path.parts if part != part.strip() or part.startswith("-") or not part.isprintable()]
    if odd or not text:
        raise argparse.ArgumentTypeError(f"{text!r}: names of files and folders may not begin with - or have blanks around them")
    return path


def refuse_no_folder(out: Path, recording) -> None:
    """Refuse an ``--out`` in which no result can lie: a file, or where a recording's own parts are looked for.

    Raises
    ------
    InputError
        When it is one.
    """
    from hmc.errors import InputError
    from hmc.io.own_files import refuse_own_folder
    from hmc.io.places import places_of

    if out.is_file():
        raise InputError(f"--out {out}: is a file; give a folder")
    refuse_own_folder(out, places_of(recording))


def whole_number(text: str) -> int:
    """argparse type: an integer of zero or more."""
    value = int(text) if text.strip().isdigit() else -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"must be a whole number, 0 or more; got {text!r}")
    return value


def positive_float(text: str) -> float:
    """argparse type: a finite number above zero."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"must be a number above 0; got {text!r}")
    return value


def float_from_zero(text: str) -> float:
    """argparse type: zero, or as `positive_float`."""
    try:
        return 0.0 if float(text) == 0 else positive_float(text)
    except (ValueError, argparse.ArgumentTypeError):
        raise argparse.ArgumentTypeError(f"must be a number, 0 or above; got {text!r}") from None


def camera_names(text: str) -> list[str]:
    """argparse type: names separated by commas."""
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise argparse.ArgumentTypeError("give camera names separated by commas")
    return names


def recording_source(recording) -> dict[str, Any]:
    """What a result says of the recording it was made from: where it lies, and a digest of which files it has and when each changed."""
    from hmc.io.places import places_of

    return places_source(places_of(recording))


def places_source(places) -> dict[str, Any]:
    """As `recording_source`, of a recording that need not be opened."""
    source = {"recording": real_path(places.path), "recording_files": places.files_digest()}
    lacks = {"calibration": places.calibration, "background": places.background, "videos": places.videos, **places.settings}
    given = {name: real_path(value) if isinstance(value, Path) else value for name, value in lacks.items() if value is not None}
    return source | ({"given": given} if given else {})


def file_digest(path: Path) -> str:
    """Digest of a file, 16 hexadecimal digits."""
    from hashlib import sha256

    from hmc.io.door import read_bytes

    return sha256(read_bytes(path)).hexdigest()[:16]


def written_digests(written: Sequence[Path]) -> dict[str, str]:
    """What `run.toml` says of the results beside it, by which `was_finished` tells a damaged one."""
    return {path.name: file_digest(path) for path in written}


def _written(run: Path) -> dict[str, str] | None:
    """`written_digests` as a `run.toml` has them: none where there is no such file, None where it does not tell."""
    from hmc.io.results import read_run

    said = read_run(run).get("written") if run.is_file() else {}
    return said if isinstance(said, dict) else None


def unlike_its_run(folder: Path, names: Collection[str] = ()) -> list[str]:
    """A sentence for each file of a result, or for those of some names, that is not as its run wrote it; none where no run tells."""
    said = _written(folder / "run.toml") or {}
    digests = {folder / name: said[name] for name in names or said if name in said}
    changed = [path for path, digest in digests.items() if path.is_file() and digest != file_digest(path)]
    return [f"{path}: is not as its run wrote it (changed, or damaged)" for path in changed]


def made_from(directory: Path, recording: Path | None) -> list[str]:
    """A sentence where the result says that it was made from a recording of another name."""
    from hmc.io.results import read_run

    run = directory / "run.toml"
    made = read_run(run).get("recording") if run.is_file() else None
    if recording is None or not isinstance(made, str) or Path(made).name == real_path(recording).name:
        return []
    return [f"{run}: the result was made from {made}, not from {recording}; are they the same recording?"]


def note_changes(recording, source: Mapping[str, Any], problems: list[str]) -> None:
    """Add to the problems that files of a recording are not those that a run began with."""
    if recording_source(recording)["recording_files"] != source["recording_files"]:
        problems.append(f"{recording.path}: its files changed during the run, of which the result may have both; delete it and run again")


def was_finished(written: Sequence[Path], run_path: Path, depends_on: Mapping[str, Any]) -> bool:
    """Whether a run wrote all of its files before, with the same parameters; says so, or that they were others.

    Parameters
    ----------
    written : sequence of Path
        Its results, the one that is told first.
    run_path : Path
        Its `run.toml`.
    depends_on : mapping
        Method, seed, recording and parameters.

    Raises
    ------
    InputError
        When a result is not as the run wrote it, or none of a run's: nobody else's file is written over.
    """
    from hmc.errors import InputError
    from hmc.io.files import to_toml
    from hmc.io.results import read_run

    there, told = [path for path in written if path.exists()], _written(run_path)
    others = [] if told is None else [path for path in there if path.name not in told]
    if others and not any(any(run_path.parent.glob(pattern)) for pattern in UNFINISHED):
        raise InputError(f"{others[0]}: no run wrote it, as no {run_path.name} tells; move it away, or give another --out")
    if len(there) < len(written) or not run_path.exists():
        return False
    for sentence in unlike_its_run(run_path.parent, [path.name for path in written]):
        raise InputError(f"{sentence}; delete it to compute it again")
    before = read_run(run_path)
    if to_toml({name: before.get(name) for name in depends_on}) != to_toml(depends_on):
        print(f"{run_path.parent}: its result has other parameters or another recording; starting anew")
        return False
    print(f"{written[0]} was finished before, with the same parameters; delete it to compute it again")
    return True
