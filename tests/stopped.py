"""Runs that are stopped on their way, politely or not."""

import multiprocessing
import os
import signal


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
    """A `progress` that adds the number of every frame to a list; frames that need no hull are numbers themselves, others' views stand
    beside their number."""

    def progress(steps, total):
        for step in steps:
            seen.append(step[0] if isinstance(step, tuple) else getattr(step, "index", step))
            yield step

    return progress


def killed(work, *given) -> None:
    """Do ``work(dies, *given)`` in a process of its own, which is gone at once where it calls ``dies()``; it must call it."""
    process = multiprocessing.get_context("spawn").Process(target=work, args=(_dies, *given))
    process.start()
    process.join()
    assert process.exitcode == -signal.SIGKILL


def _dies() -> None:
    os.kill(os.getpid(), signal.SIGKILL)
