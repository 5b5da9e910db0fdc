"""Commands on a disk that is full at some moment: one line, the right exit code, nothing half-written; the same bytes once there is room.

``python tests/full_disk.py --rounds 10`` takes the miniature of `tests/miniature.py` and each command in turn: the files that it leaves
where there is room, then, a round each, a file system in memory (tmpfs, which needs the right to mount) that holds a share of them, drawn
anew each time. The command is run there, room is made, and it is run again. Counted are runs that met the end of the disk, and trials that
ended

- same: the first run ended with code 2 (1, of `run` and `experiments`) and words, or did its work with a word on what was left out; no file
  that it left under its own name was other than whole; and after the second all are as where there was room
- other: some file differs, is missing or is left over
- bad: a traceback, another exit code, a line too few, or the second run did not end with exit code 0
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from kills import COMMANDS as KILLED
from kills import files_in, started
from miniature import QUICK, build
from mutations import warm

PAGE = os.sysconf("SC_PAGE_SIZE")
DISK = "disk"
#: Commands whose files are to lie on the disk.
COMMANDS = {
    **{key: tuple(f"{DISK}/{word}" if word.startswith("new") else word for word in words) for key, (words, _) in KILLED.items()},
    "synth": ("synth", "recipe.toml", "--out", f"{DISK}/new", *QUICK),
    "check": ("check", "rec", "--out", f"{DISK}/new.png"),
    "world": ("world", "rec", "--out", f"{DISK}/new.png", "--dry-run"),
    "sync": ("sync", "rec", "--out", f"{DISK}/new.png", "--dry-run"),
    "view, picture": ("view", "result", "rec", "--out", f"{DISK}/new.png", "--no-voxels"),
    **{f"export, {to}": ("export", "result", "--to", to, "--out", f"{DISK}/new.{to}") for to in ("trc", "bvh", "mot", "glb", "csv")},
}  # fmt: skip


@contextmanager
def disk(place: Path, size: int) -> Iterator[Path]:
    """A file system of so many bytes."""
    place.mkdir(exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "none", place], check=True)
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", place], check=True)


def grown(place: Path, size: int) -> None:
    """Make room on it."""
    subprocess.run(["mount", "-o", f"remount,size={size}", place], check=True)


def can_mount(place: Path) -> bool:
    """Whether this process may make a file system."""
    place.mkdir(exist_ok=True)
    if subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={PAGE}", "none", place], check=False, capture_output=True).returncode:
        return False
    subprocess.run(["umount", place], check=True)
    return True


def run(folder: Path, words: tuple[str, ...]) -> tuple[int, str]:
    """Exit code and words of a command."""
    log = folder.parent / "log"
    log.write_text("")
    status = os.waitpid(started(folder, words), 0)[1]
    return os.waitstatus_to_exitcode(status), log.read_text(errors="replace")


def whole(folder: Path, words: tuple[str, ...]) -> tuple[dict[str, bytes], frozenset[str], int]:
    """What a command leaves where there is room, which names differ from run to run, and bytes that it needs at most, in whole pages."""
    found, needed = [], 0
    for _ in range(2):
        with disk(folder / DISK, 2**28) as place:
            code, text = run(folder, words)
            if code:
                raise SystemExit(f"{' '.join(words)}:\n{text}")
            found.append(files_in(place))
            needed = sum(-(-one.lstat().st_size // PAGE) * PAGE for one in place.rglob("*") if one.is_file())
    one, other = found
    return one, frozenset(name for name in one.keys() | other.keys() if one.get(name) != other.get(name)), needed


def trial(folder: Path, words: tuple[str, ...], left: dict[str, bytes], unsteady: frozenset[str], size: int) -> tuple[str, bool, str]:
    """Fill, make room, compare: how it ended, whether it met the end of the disk, and what is wrong."""
    with disk(folder / DISK, size) as place:
        code, text = run(folder, words)
        full = code != 0 or "No space left" in text
        if "Traceback" in text or code not in (0, 2, *((1,) if words[0] in ("run", "experiments") else ())) or (code and not text.strip()):
            return "bad", full, f"exit code {code}:\n{text[-2000:]}"
        first = {name: data for name, data in files_in(place).items() if not any(part.startswith(".") for part in Path(name).parts)}
        grown(place, 2**28)
        again, more = run(folder, words)
        if again or "Traceback" in more:
            return "bad", full, f"then exit code {again}:\n{text[-600:]}\n--\n{more[-2000:]}"
        second = files_in(place)
    others = [name for name in sorted(second.keys() | left.keys()) if name not in unsteady and second.get(name) != left.get(name)]
    if code == 0 and not full:
        others += [f"{name} (without a word)" for name in sorted(left.keys()) if name not in unsteady and first.get(name) != left[name]]
    half = [f"{name} (at first)" for name, data in first.items() if name in left and name not in unsteady and data != left[name]]
    half = [name for name in half if words[0] not in ("run", "experiments") or ("report" not in name and "index" not in name)]
    others += half
    return ("other" if others else "same"), full, f"exit code {code}: {text.strip()[-300:]}\n{', '.join(others)}"


def main() -> None:
    """Count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--base", type=Path, help="where the miniature is made, and found again")
    parser.add_argument("--commands", nargs="+", choices=list(COMMANDS), default=list(COMMANDS))
    args = parser.parse_args()
    rng, begun, counts = np.random.default_rng(args.seed), time.monotonic(), Counter[str]()
    with tempfile.TemporaryDirectory(prefix="full-") as name:
        folder = Path(name) / "work" / "in"
        if not can_mount(Path(name) / "disk"):
            raise SystemExit("needs the right to mount a file system")
        shutil.copytree(build((args.base or Path(name) / "miniature").resolve()), folder)
        warm()
        for key in args.commands:
            left, unsteady, needed = whole(folder, COMMANDS[key])
            own = Counter[str]()
            for _ in range(args.rounds):
                size = int(rng.integers(1, max(2, needed // PAGE))) * PAGE
                kind, full, text = trial(folder, COMMANDS[key], left, unsteady, size)
                own.update({kind: 1, "full": full})
                if kind != "same":
                    print(f"--- {kind}: {key}, {size // PAGE} of {needed // PAGE} pages\n{text}", flush=True)
            print(f"{key}: {dict(own)}, {needed // PAGE} pages, differ from run to run: {sorted(unsteady)}", flush=True)
            counts += own
    print(f"{sum(counts.values()) - counts['full']} trials in {time.monotonic() - begun:.0f} s: {dict(counts)}")


if __name__ == "__main__":
    main()
