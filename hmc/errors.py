"""The one exception for input that a user can mend, the words for what the system refuses, and interrupts that a library of C took for an
error of its own."""

import errno
import operator
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

#: No space, no more of one's share of it, or a file larger than may be.
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class InputError(ValueError):
    """Something in the user's input is wrong; the message says where, what, and what to do.

    The command line prints it as one line and exits with code 2; from Python it is an ordinary ``ValueError``.
    """


def whole_seed(seed: int) -> int:
    """A seed as it was given.

    Raises
    ------
    InputError
        When it is no whole number of 0 or more: NumPy takes None too, and draws other numbers every time.
    """
    try:
        value = operator.index(seed)
    except TypeError:
        value = -1
    if value < 0:
        raise InputError(f"`seed` must be a whole number, 0 or more; got {seed!r}")
    return value


def is_utf8(name: str) -> bool:
    """Whether a name of the file system is text: others are of another system's encoding, neither OpenCV nor TOML takes them."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def system_words(error: OSError) -> str:
    """What the system says of a file that it did not let be read or written; in the middle of writing it names none."""
    place = "" if error.filename is None else f"{error.filename}: "
    return f"{place}{error.strerror or error}" + ("; make room, and start it again" if error.errno in FULL else "")


@contextmanager
def as_interrupts() -> Iterator[None]:
    """What is raised once an interrupt came is raised as one: matplotlib makes "Invalid affine transformation matrix" of it.

    Only where Python's own way of dealing with interrupts is in force; in other threads nothing is done.
    """
    noted: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        noted.append(number)
        signal.default_int_handler(number, frame)

    ours = threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if ours:
        signal.signal(signal.SIGINT, note)
    try:
        yield
    except Exception as error:
        if noted:
            raise KeyboardInterrupt from error
        raise
    finally:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
