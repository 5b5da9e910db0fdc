"""The one exception for input that a user can mend, and the words for what the system refuses."""

import errno

#: No space, no more of one's share of it, or a file larger than may be.
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class InputError(ValueError):
    """Something in the user's input is wrong; the message says where, what, and what to do.

    The command line prints it as one line and exits with code 2; from Python it is an ordinary ``ValueError``.
    """


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
