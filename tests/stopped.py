"""Runs that are stopped on their way."""


class Stopped(Exception):
    """Somebody pressed the keys that stop a program."""


def stopping(after: int):
    """A `progress` that raises once so many frames have been passed on."""

    def progress(steps, total):
        for k, step in enumerate(steps):
            if k == after:
                raise Stopped
            yield step

    return progress


def noting(seen: list[int]):
    """A `progress` that adds the number of every frame to a list."""

    def progress(steps, total):
        for step in steps:
            seen.append(step.index)
            yield step

    return progress
