"""The one exception for input that a user can mend."""


class InputError(ValueError):
    """Something in the user's input is wrong; the message says where, what, and what to do.

    The command line prints it as one line and exits with code 2; from Python it is an ordinary ``ValueError``.
    """
