"""Timing for the benchmarks: several things in turn in one run, by the processor time of one thread: other work disturbs ratios less."""

from __future__ import annotations

import ctypes
import sys
import time
from collections.abc import Callable, Mapping

#: Numbers of glibc's settings (mallopt(3)), and the largest threshold that it takes.
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _LARGEST = -1, -3, 32 << 20


def _steady_allocator() -> None:
    """Keep freed memory up to 32 MiB an array.

    The C library learns from what is freed from what size on it maps and unmaps; until it has learnt, a likelihood of many arrays takes
    twice as long. A ratio would depend on what ran before it.
    """
    if sys.platform == "linux":
        mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
        if mallopt is not None:
            mallopt(_MMAP_THRESHOLD, _LARGEST)
            mallopt(_TRIM_THRESHOLD, 16 * _LARGEST)


_steady_allocator()


def interleaved(functions: Mapping[str, Callable[[], object]], rounds: int = 15) -> dict[str, float]:
    """Median processor seconds of each function, called in turn `rounds` times after one call to warm up.

    What a library does in threads of its own is not counted, which favours the others.
    """
    times: dict[str, list[float]] = {name: [] for name in functions}
    for function in functions.values():
        function()
    for _ in range(rounds):
        for name, function in functions.items():
            start = time.thread_time()
            function()
            times[name].append(time.thread_time() - start)
    return {name: sorted(values)[rounds // 2] for name, values in times.items()}


def report(row: str, what: str, value: float, target: float, at_least: bool = False, note: str = "") -> bool:
    """Print one target with what was measured; tell whether it is met."""
    met = value >= target if at_least else value <= target
    bound = "at least" if at_least else "at most"
    print(f"{row:4} {what:58} {value:8.3f}   {bound} {target:<6g} {'pass' if met else 'FAIL'}   {note}".rstrip(), flush=True)
    return met
