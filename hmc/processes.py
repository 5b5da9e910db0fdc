"""Work in processes of its own: a generator that runs ahead, and tasks that are shared out.

Processes are forked: what a task needs is there without being copied or pickled, and only what it gives comes back, large arrays through
memory that both share. Where that cannot be, on systems that do not fork safely and within a worker, the same is done in turn by the
process that asks, so the result never depends on the number of processes.

A fork copies the asking thread alone. Libraries with threads of their own could wait for those for ever: OpenCV's are stopped before the
fork, and the command line keeps linear algebra to one thread. What forks should have no other threads at work at that moment.
"""

from __future__ import annotations

import mmap
import multiprocessing
import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import Any, TypeVar

import cv2

__all__ = ["ahead", "available_processors", "each_ahead", "may_fork", "share_out"]

T = TypeVar("T")
K = TypeVar("K")

#: Items that wait to be taken, at most.
DEPTH = 3
#: Room for one item's arrays where nothing else is said, bytes. Memory is taken by what is written only.
ITEM_BYTES = 64 << 20
#: Arrays begin at multiples of this, bytes.
ALIGNED = 64
#: Of messages: an item, the end, an exception.
ITEM, END, FAILED = range(3)


def available_processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def may_fork() -> bool:
    """Whether work may be given to processes here: on Linux, and not within such a process."""
    return sys.platform == "linux" and not multiprocessing.current_process().daemon


def ahead(make: Callable[[], Iterable[T]], workers: int = 2, item_bytes: int = ITEM_BYTES, lend: bool = False) -> Iterator[T]:
    """Items of an iterable that is made, and runs ahead, in a process of its own.

    Parameters
    ----------
    make : callable
        Gives the iterable; it is called there. Its items must be such as `pickle` takes.
    workers : int
        With fewer than two all is done in this process.
    item_bytes : int
        How large an item's arrays may be, together, to come by way of shared memory; larger ones come too, more slowly.
    lend : bool
        If True, arrays are not copied out of the shared memory: they change when the next item is asked for.

    Yields
    ------
    T

    Raises
    ------
    ChildProcessError
        When the process ended without a word, as by a signal. What is raised there is raised here.
    """
    if workers < 2 or not may_fork():
        yield from make()
        return
    arena = mmap.mmap(-1, DEPTH * item_bytes)
    process, here = _forked(lambda there: _run_ahead(make, there, arena, item_bytes))
    try:
        while True:
            kind, slot, places, head = _received(process, here)
            if kind != ITEM:
                break
            shared = memoryview(arena)
            arrays = [shared[start:end] if end else bytearray(here.recv_bytes()) for start, end in places]
            if lend:
                yield pickle.loads(head, buffers=arrays)
                _give_back(here, slot)
            else:
                arrays = [bytearray(array) for array in arrays]
                _give_back(here, slot)
                yield pickle.loads(head, buffers=arrays)
    finally:
        _ended(process, here)


def each_ahead(make: Callable[[Sequence[K]], Iterable[T]], keys: Sequence[K], workers: int = 2) -> Iterator[T]:
    """An item of every key, in their order, made by processes that run ahead of who takes them.

    Parameters
    ----------
    make : callable
        Gives an item of each key that it is given, in order; an item depends on its own key alone.
    keys : sequence
    workers : int
        Processes that make items, at most; this one, which takes them, mostly waits for them.
    """
    n = max(1, min(workers, len(keys)))
    with ExitStack() as stack:
        parts = [stack.enter_context(closing(ahead(partial(make, keys[k::n]), workers))) for k in range(n)]  # type: ignore[type-var]
        for k in range(len(keys)):
            yield next(parts[k % n])


def share_out(tasks: Sequence[Callable[[], T]], workers: int = 2) -> list[T]:
    """The results of some tasks, in their order; processes, this one among them, take one after the other.

    Parameters
    ----------
    tasks : sequence of callable
        Their results must be such as `pickle` takes.
    workers : int
        Processes, at most.

    Raises
    ------
    ChildProcessError
        As `ahead`.
    """
    n = min(workers, len(tasks))
    if n < 2 or not may_fork():
        return [task() for task in tasks]
    taken = multiprocessing.get_context("fork").Value("q", 0)

    def done() -> Iterator[tuple[int, T]]:
        while True:
            with taken.get_lock():
                k = taken.value
                taken.value += 1
            if k >= len(tasks):
                return
            yield k, tasks[k]()

    # Sent when all is done: a helper whose results wait to be taken would take no more tasks.
    helpers = [_forked(lambda there: _run_ahead(lambda: list(done()), there, None, 0)) for _ in range(n - 1)]
    try:
        results = dict(done())
        for process, here in helpers:
            while (message := _received(process, here))[0] == ITEM:
                _, _, places, head = message
                k, result = pickle.loads(head, buffers=[bytearray(here.recv_bytes()) for _ in places])
                results[k] = result
    finally:
        for process, here in helpers:
            _ended(process, here)
    return [results[k] for k in range(len(tasks))]


def _give_back(here: Connection, slot: int) -> None:
    """Say that a slot may be written again."""
    with suppress(OSError):  # the other side may have ended already
        here.send(slot)


def _forked(run: Callable[[Connection], None]) -> tuple[Any, Connection]:
    """A process that runs something, and the near end of a pipe to it."""
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe()

    def begin() -> None:
        here.close()  # the other side's end is noticed by its end of the pipe alone
        # An interrupt is the asking process's to answer: it ends this one.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        # The asking process is gone when its pipe is broken, and nobody is left to be told.
        with suppress(EOFError, BrokenPipeError, ConnectionResetError):
            run(there)

    process = context.Process(target=begin, daemon=True)
    with _one_thread():
        process.start()
    there.close()
    return process, here


@contextmanager
def _one_thread() -> Iterator[None]:
    """OpenCV without threads of its own: it ends those that it has, and a process forked meanwhile begins none."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)


def _run_ahead(make: Callable[[], Iterable[Any]], there: Connection, arena: mmap.mmap | None, item_bytes: int) -> None:
    """Make items and send them, as far ahead as there is room; without an arena as far as the pipe takes them."""
    free = list(range(DEPTH))
    try:
        for item in make():
            slot = 0
            if arena is not None:
                slot = free.pop() if free else there.recv()
                while there.poll():
                    free.append(there.recv())
            arrays: list[pickle.PickleBuffer] = []
            head = pickle.dumps(item, protocol=5, buffer_callback=arrays.append)
            _send(there, slot, head, arrays, arena, item_bytes)
        there.send((END, 0, (), b""))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        raise
    except BaseException as error:  # raised again by the process that asked
        there.send((FAILED, 0, (), _told(error)))


def _send(there: Connection, slot: int, head: bytes, arrays: list[pickle.PickleBuffer], arena: mmap.mmap | None, item_bytes: int) -> None:
    """An item: its head and what fits into its slot, then the arrays that do not."""
    at, end = slot * item_bytes, (slot + 1) * item_bytes
    places, left = [], []
    for array in arrays:
        flat = array.raw()
        if arena is not None and at + len(flat) <= end and len(flat):
            arena[at : at + len(flat)] = flat
            places.append((at, at + len(flat)))
            at += -(-len(flat) // ALIGNED) * ALIGNED
        else:
            places.append((0, 0))
            left.append(flat)
    there.send((ITEM, slot, places, head))
    for flat in left:
        there.send_bytes(flat)


def _told(error: BaseException) -> bytes:
    """An exception as it can be sent."""
    try:
        data = pickle.dumps(error)
        pickle.loads(data)
    except Exception:  # one of a kind that pickle cannot make again
        return pickle.dumps(RuntimeError(f"{type(error).__name__}: {error}"))
    return data


def _received(process: Any, here: Connection) -> tuple[int, int, Sequence[tuple[int, int]], bytes]:
    """The next message of a process; what it raised is raised."""
    try:
        message = here.recv()
    except (EOFError, ConnectionResetError):
        process.join()
        raise ChildProcessError(f"a worker process ended by itself (exit code {process.exitcode}): is the memory exhausted?") from None
    if message[0] == FAILED:
        raise pickle.loads(message[3])
    return message


def _ended(process: Any, here: Connection) -> None:
    here.close()
    process.terminate()
    process.join()
