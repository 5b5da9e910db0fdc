"""What is kept of a trial beside its result: how it ended, what the check said, and how long each stage took."""

from __future__ import annotations

import hashlib
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hmc.errors import InputError
from hmc.io.files import write_toml
from hmc.io.results import read_run

__all__ = ["DONE", "FAILED", "TrialState", "digest", "only_one", "read_state", "write_state"]

DONE, FAILED, BEGUN = "done", "failed", "not finished"
STATE, LOCK = "trial.toml", ".lock"
#: How long a run may take to end that was killed, with the processes that it started; seconds.
WAIT_S = 30.0


@dataclass(frozen=True)
class TrialState:
    """How far a trial is.

    Parameters
    ----------
    status : str
        `DONE`, `FAILED` or `BEGUN`.
    fault : str
        Why it failed; empty otherwise.
    findings : tuple of str
        What `hmc check` says.
    checked : str
        Digest of what says which recording was checked.
    drawn : str
        Digest of the result of which there are pictures.
    seconds : mapping
        How long each stage took, the last time that it was not found done.
    """

    status: str = BEGUN
    fault: str = ""
    findings: tuple[str, ...] = ()
    checked: str = ""
    drawn: str = ""
    seconds: Mapping[str, float] = field(default_factory=dict)


def read_state(folder: Path) -> TrialState:
    """The state that was kept; that of a trial that nobody began where there is none.

    Raises
    ------
    InputError
        When the file is damaged.
    """
    path = folder / STATE
    if not path.exists():
        return TrialState()
    try:
        values: dict[str, Any] = read_run(path)
        return TrialState(**{**values, "findings": tuple(values["findings"])})
    except (TypeError, KeyError) as error:
        raise InputError(f"{path}: not of this program ({error}); delete it") from None


def write_state(folder: Path, state: TrialState) -> None:
    """Keep a state."""
    write_toml(folder / STATE, vars(state))


def digest(*parts: bytes) -> str:
    """A digest, 16 hexadecimal digits."""
    return hashlib.sha256(b"".join(parts)).hexdigest()[:16]


@contextmanager
def only_one(folder: Path) -> Iterator[None]:
    """Nobody else works in this folder while the block runs; the system ends that with the process.

    Raises
    ------
    InputError
        When another run is at work there and does not end.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if sys.platform == "win32":
        yield
        return
    import fcntl

    with open(folder / LOCK, "w") as file:
        deadline = time.monotonic() + WAIT_S
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except OSError:
                if time.monotonic() > deadline:
                    raise InputError(f"{folder}: another run is at work there; wait for it, or give another --out") from None
                time.sleep(0.2)
        yield
