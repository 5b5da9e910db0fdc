"""Work in processes of its own: a generator that runs ahead, and tasks that are shared out.

Processes are forked: what a task needs is there without being copied or sent, and only what it gives comes back, large arrays through
memory that both share. Where that cannot be, on systems that do not fork safely and within a worker, the same is done in turn by the
process that asks, so the result never depends on the number of processes.

A fork copies the asking thread alone. Libraries with threads of their own could wait for those for ever: OpenCV's are stopped before the
fork, and linear algebra is kept to one thread, by the command line and, for who calls from Python, by `one_thread`. What forks should have
no other threads at work at that moment.
"""

from __future__ import annotations

import mmap
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from functools import cache, partial
from multiprocessing.connection import Connection
from multiprocessing.reduction import ForkingPickler
from typing import Any, TypeVar

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

__all__ = [
    "ahead",
    "arrays_ahead",
    "available_processors",
    "each_ahead",
    "end_with",
    "may_fork",
    "one_thread",
    "share_out",
    "stepped_apart",
]

T = TypeVar("T")
K = TypeVar("K")
S = TypeVar("S")

#: Items of arrays that wait to be taken, at most.
DEPTH = 3
#: What was made and waits to be sent, in one process, bytes: where its items are asked for in bursts, it goes on meanwhile.
WAITING_BYTES = 64 << 20
#: Arrays begin at multiples of this, bytes.
ALIGNED = 64
#: How often a process looks whether its parent is still there, seconds.
LOOK_S = 1.0
#: Of messages: an item, the end, an exception.
ITEM, END, FAILED = range(3)


def available_processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def one_thread() -> Iterator[None]:
    """Linear algebra in one thread, for a while, or, as a decorator, during each call.

    Matrices are small here: threads of BLAS wait for one another longer than they work. On two idle cores a step of a session took three
    times as long with two of them and a first pose five times, and more where others use the cores. Nor do sums then depend on how many
    cores there are.
    """
    with threadpool_limits(1, "blas"):
        yield


def may_fork() -> bool:
    """Whether work may be given to processes here: on Linux, and not within such a process."""
    return sys.platform == "linux" and not multiprocessing.current_process().daemon


@cache
def end_with(parent: int) -> None:
    """Let this process end when its parent does: a parent that is killed cannot end it, and it would compute on."""
    if os.getpid() == parent:
        return  # no process was started

    def look() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK_S)
        os._exit(1)

    threading.Thread(target=look, daemon=True).start()


def ahead(make: Callable[[], Iterable[T]], workers: int = 2) -> Iterator[T]:
    """Items of an iterable that is made, and runs ahead, in a process of its own, from this call on.

    Parameters
    ----------
    make : callable
        Gives the iterable; it is called there. Its items must be such as can be sent to another process.
    workers : int
        With fewer than two all is done in this process, item by item as they are asked for.

    Returns
    -------
    iterator of T
        A generator; close it where not all of it is taken.

    Raises
    ------
    ChildProcessError
        When the process ended without a word, as by a signal. What is raised there is raised here.
    """
    if workers < 2 or not may_fork():
        return (item for item in make())
    return _begun(_items(lambda there: _send_all(make(), there)))


def _items(run: Callable[[Connection], None]) -> Iterator[Any]:
    """None when the process has been started, then the items that it sends."""
    process, here = _forked(run)
    del run  # what it holds is needed there alone
    try:
        yield None
        while (message := _received(process, here))[0] == ITEM:
            yield message[1]
    finally:
        _ended(process, here)


def _begun(items: Iterator[T]) -> Iterator[T]:
    """A generator that is past its first item: what it waits for is on its way before anybody asks for it."""
    next(items)
    return items


def arrays_ahead(
    make: Callable[[], Iterable[tuple[Sequence[np.ndarray | None], T]]], workers: int, item_bytes: int
) -> Iterator[tuple[list[np.ndarray | None], T]]:
    """As `ahead`, of large arrays that come by way of memory that both processes share.

    Parameters
    ----------
    make : callable
        Gives the iterable: of each item its arrays, or None in their places, and the rest of it.
    workers : int
    item_bytes : int
        How large an item's arrays may be, together; those that do not fit come as they do in `ahead`.

    Returns
    -------
    iterator of (arrays, rest)
        The arrays are lent: when the next item is asked for they change. Copy what is to be kept.
    """
    if workers < 2 or not may_fork():
        return ((list(arrays), rest) for arrays, rest in make())
    return _begun(_lent(make, item_bytes))


def _lent(make: Callable[[], Iterable[tuple[Sequence[np.ndarray | None], T]]], item_bytes: int) -> Iterator[Any]:
    """None when the process has been started, then arrays in shared memory with the rest of each item."""
    arena = mmap.mmap(-1, DEPTH * item_bytes)
    process, here = _forked(lambda there: _send_all(_put(make(), there, arena, item_bytes), there))
    try:
        yield None
        while (message := _received(process, here))[0] == ITEM:
            slot, placed, rest = message[1]
            yield [_taken(arena, one) for one in placed], rest
            with suppress(OSError):  # the other side may have ended already
                here.send(slot)
    finally:
        _ended(process, here)


def _put(items: Iterable[tuple[Sequence[np.ndarray | None], T]], there: Connection, arena: mmap.mmap, item_bytes: int) -> Iterator[Any]:
    """Items with the places of their arrays in shared memory, as far ahead as there is room."""
    free = list(range(DEPTH))
    for arrays, rest in items:
        slot = free.pop() if free else there.recv()
        while there.poll():
            free.append(there.recv())
        at, end = slot * item_bytes, (slot + 1) * item_bytes
        placed: list[_Place | np.ndarray | None] = []
        for array in arrays:
            if array is None or not array.nbytes or at + array.nbytes > end:
                placed.append(array)
                continue
            np.frombuffer(arena, array.dtype, array.size, at).reshape(array.shape)[...] = array
            placed.append(_Place(at, array.shape, array.dtype.str))
            at += -(-array.nbytes // ALIGNED) * ALIGNED
        yield slot, placed, rest


@dataclass(frozen=True)
class _Place:
    """Where in shared memory an array is."""

    start: int
    shape: tuple[int, ...]
    dtype: str


def _taken(arena: mmap.mmap, placed: _Place | np.ndarray | None) -> np.ndarray | None:
    if not isinstance(placed, _Place):
        return placed
    return np.frombuffer(arena, placed.dtype, int(np.prod(placed.shape)), placed.start).reshape(placed.shape)


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
        Their results must be such as can be sent to another process.
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
    helpers = [_forked(lambda there: _send_all(list(done()), there)) for _ in range(n - 1)]
    try:
        results = dict(done())
        for process, here in helpers:
            while (message := _received(process, here))[0] == ITEM:
                k, results[k] = message[1]
    finally:
        for process, here in helpers:
            _ended(process, here)
    return [results[k] for k in range(len(tasks))]


def stepped_apart(step: Callable[[S, K], tuple[S, Sequence[T]]], state: S) -> Generator[list[T], K | None, None]:
    """A state that goes from item to item in a process of its own; ask `may_fork` first.

    Parameters
    ----------
    step : callable
        From a state and an item to the next state and what comes out; items and what comes out must be such as can be sent.
    state
        The first.

    Returns
    -------
    generator
        Items are sent to it, and what has come out by then is given back; None stands for the end, and gives back all the rest. Sending
        waits until the item before is done with. To be closed.
    """
    return _begun(_stepped(step, state))  # type: ignore[return-value]


def _stepped(step: Callable[[S, K], tuple[S, Sequence[T]]], state: S) -> Generator[Any, Any, None]:
    process, here = _forked(lambda there: _step_all(step, state, there))
    found: list[T] = []
    try:
        item = yield None
        while True:
            with suppress(BrokenPipeError, ConnectionResetError):  # why it ended is told below
                here.send(item)
            while item is None or here.poll():
                kind, new = _received(process, here)
                if kind == END:
                    break
                found += new
            item, found = (yield found), []
    finally:
        _ended(process, here)


def _step_all(step: Callable[[S, K], tuple[S, Sequence[T]]], state: S, there: Connection) -> None:
    with _sending(there) as send:
        while (item := there.recv()) is not None:
            state, found = step(state, item)
            if found:
                send((ITEM, found))
        send((END, None))


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
            try:
                run(there)
            except (EOFError, BrokenPipeError, ConnectionResetError):
                raise
            except BaseException as error:  # raised again by the process that asked
                there.send((FAILED, _told(error)))

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


def _send_all(items: Iterable[Any], there: Connection) -> None:
    with _sending(there) as send:
        for item in items:
            send((ITEM, item))
        send((END, None))


@contextmanager
def _sending(there: Connection) -> Iterator[Callable[[Any], None]]:
    """What sends messages in their order while the next ones are made; it waits, or raises, where they are not taken."""
    waiting: deque[memoryview] = deque()
    changed = threading.Condition()
    broken: list[OSError] = []
    over = False

    def run() -> None:
        while True:
            with changed:
                changed.wait_for(lambda: waiting or over)
                if not waiting:
                    return
                message = waiting[0]
            try:
                there.send_bytes(message)
            except OSError as error:
                broken.append(error)
            with changed:
                waiting.popleft()
                changed.notify_all()

    def send(message: Any) -> None:
        pickled = ForkingPickler.dumps(message)
        with changed:
            changed.wait_for(lambda: broken or sum(map(len, waiting)) < WAITING_BYTES)
            if broken:
                raise broken[0]
            waiting.append(pickled)
            changed.notify_all()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield send
    finally:
        with changed:
            over = True
            changed.notify_all()
        thread.join()


def _told(error: BaseException) -> BaseException:
    """An exception that can be sent: itself, if it is of a kind that surely can."""
    return error if type(error).__module__ in ("builtins", "hmc.errors") else RuntimeError(f"{type(error).__name__}: {error}")


def _received(process: Any, here: Connection) -> tuple[int, Any]:
    """The next message of a process; what it raised is raised."""
    try:
        message = here.recv()
    except (EOFError, ConnectionResetError):
        process.join()
        raise ChildProcessError(f"a worker process ended by itself (exit code {process.exitcode}): is the memory exhausted?") from None
    if message[0] == FAILED:
        raise message[1]
    return message


def _ended(process: Any, here: Connection) -> None:
    here.close()
    process.terminate()
    process.join()
