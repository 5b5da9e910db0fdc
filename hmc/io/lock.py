"""One run at a time in a folder."""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hmc.errors import InputError

__all__ = ["only_run"]

#: How long the processes that a killed run started may take to end, seconds.
WAIT_S = 10.0


@contextmanager
def only_run(folder: str | Path, wait_s: float | None = None) -> Iterator[None]:
    """No other run works in this folder while the block runs. The folder is made where it is not there.

    The lock is the system's, on the folder itself: it leaves no file, and ends with the process, however that ends. File systems that
    know no locks, and Windows, go without.

    Parameters
    ----------
    folder : path
    wait_s : float, optional
        How long another run is waited for; by default `WAIT_S`.

    Raises
    ------
    InputError
        When another run is at work there, or the folder cannot be made.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror or error}); choose another folder") from None
    try:
        import fcntl
    except ImportError:
        yield
        return
    held = os.open(folder, os.O_RDONLY)
    try:
        deadline = time.monotonic() + (WAIT_S if wait_s is None else wait_s)
        while True:
            try:
                fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except OSError as error:
                if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
                    break
                if time.monotonic() > deadline:
                    raise InputError(f"{folder}: another run is at work there; wait for its end, or give another --out") from None
                time.sleep(0.2)
        yield
    finally:
        os.close(held)
