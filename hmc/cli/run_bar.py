"""The bar of a run of several stages: which one it is in, and how long all of them will still take."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

__all__ = ["FIRST_POSE", "FITTING", "FOLLOWING", "LEARNING", "SECOND_PASS", "TRACKING", "VIEWS", "RunBar"]

T = TypeVar("T")

LEARNING, TRACKING, FIRST_POSE, FOLLOWING = "learning the empty scene", "tracking", "first pose", "following"
FITTING, SECOND_PASS, VIEWS = "fitting bodies", "second pass", "counting views"

#: What a frame of a stage costs beside a tracked frame of `USUAL_MEGAPIXELS`, and a halt for each person: in the midst of eight runs of 1
#: to 3 people and 4 to 7 cameras. As soon as something is measured, these say only how the rest compares with it.
FRAME_COSTS = {TRACKING: 1.0, FOLLOWING: 0.5, SECOND_PASS: 0.75, VIEWS: 0.05}
HALT_COSTS = {FIRST_POSE: 42.0, FITTING: 30.0}
#: Five images of 640 x 480, and the share of a tracked frame's cost that does not grow with the images; fitting bodies knows no images.
USUAL_MEGAPIXELS, SAME_SHARE = 1.5, 0.6
USUAL_COLUMNS = 100
#: Those that cost more with more people.
OF_PEOPLE = (FOLLOWING, SECOND_PASS, VIEWS)
#: Frames of a stage from which on its own speed is believed, and the share of a halt that is left at least while it lasts.
ENOUGH_FRAMES, LEAST_SHARE = 8, 0.1


class RunBar:
    """A bar on stderr for one stage after the other, and the time that is left of all of them.

    Parameters
    ----------
    stages : sequence of str
        Those that come, in order; halts too.
    frames : int
    people : int
        How many are expected; set it anew when it is known.
    quiet : bool
        Nothing is shown.
    clock : callable
        Gives seconds.
    megapixels : float
        Of the images of all cameras in one frame, millions of pixels.
    """

    def __init__(
        self,
        stages: Iterable[str],
        frames: int,
        people: int = 1,
        quiet: bool = False,
        clock: Callable[[], float] = time.monotonic,
        megapixels: float = USUAL_MEGAPIXELS,
    ) -> None:
        self.people = max(1, people)
        self._tracked = SAME_SHARE + (1 - SAME_SHARE) * megapixels / USUAL_MEGAPIXELS
        self._stages, self._frames, self._quiet, self._clock = list(stages), frames, quiet, clock
        self._begun = self._since = clock()
        self._name: str | None = None
        self._done: dict[str, int] = {}
        self._totals: dict[str, int] = {}
        self._seconds: dict[str, float] = {}
        self._before: tuple[int, float] = (0, 0.0)
        self._bar: Any = None

    def stage(self, name: str, first: str | None = None) -> Callable[[Iterable[T], int], Iterator[T]]:
        """What passes a stage's frames on, ``progress(steps, total)``, and shows them; `first`: what is done before the first comes."""

        def progress(steps: Iterable[T], total: int) -> Iterator[T]:
            self._totals[name] = total
            self._open(first or name, total)
            try:
                for step in steps:
                    if self._name == first:
                        self.phase(name)
                    yield step
                    self._account()
                    self._done[name] = self._done.get(name, 0) + 1
                    self._show(1)
            finally:
                self._account()
                self._close()
                if name in self._stages:
                    del self._stages[: self._stages.index(name) + 1]

        return progress

    def phase(self, name: str) -> None:
        """What is done from now on, within a stage or between two."""
        self._account()
        if self._name is None:
            self._open(name, None)
            return
        self._leave()
        self._name = name
        if self._bar is not None:
            self._bar.set_description_str(name, refresh=False)
        self._show(0)

    def left_s(self) -> float | None:
        """How long the rest will take, seconds; None before anything is measured."""
        unit = self._unit()
        if unit is None:
            return None
        return sum(self._left_of(stage, unit) for stage in dict.fromkeys([*filter(None, [self._name]), *self._stages]))

    def _left_of(self, stage: str, unit: float) -> float:
        if stage in HALT_COSTS:
            left = max(0, self.people - self._done.get(stage, 0))
            one = HALT_COSTS[stage] * unit
            spent = self._seconds.get(stage, 0.0) - one * self._done.get(stage, 0) if stage == self._name else 0.0
            return max(left * one - max(0.0, spent), LEAST_SHARE * one * (stage == self._name))
        if stage not in FRAME_COSTS:
            return 0.0
        rate = self._rate(stage)
        followed = self._rate(FOLLOWING)
        # The same work again: people who are near each other are slow in both.
        if rate is None and stage == SECOND_PASS and followed is not None:
            rate = followed * FRAME_COSTS[SECOND_PASS] / FRAME_COSTS[FOLLOWING]
        if rate is None:
            rate = self._cost(stage) * unit
        return rate * max(0, self._totals.get(stage, self._frames) - self._done.get(stage, 0))

    def _rate(self, stage: str) -> float | None:
        """Seconds a frame, as measured in the stage itself; None before there is enough of it."""
        # Frames of which nobody has a pose yet tell nothing of the speed at which people are followed.
        before, seconds = self._before if stage == FOLLOWING else (0, 0.0)
        done = self._done.get(stage, 0) - before
        return (self._seconds.get(stage, 0.0) - seconds) / done if done >= ENOUGH_FRAMES else None

    def _cost(self, stage: str) -> float:
        if stage == TRACKING:
            return FRAME_COSTS[stage] * self._tracked
        return FRAME_COSTS[stage] * (self.people if stage in OF_PEOPLE else 1)

    def _unit(self) -> float | None:
        """Seconds of a tracked frame, by all that is measured."""
        seconds = cost = 0.0
        for stage, n in self._done.items():
            if n >= ENOUGH_FRAMES or stage in HALT_COSTS:
                seconds += self._seconds.get(stage, 0.0)
                cost += n * (HALT_COSTS[stage] if stage in HALT_COSTS else self._cost(stage))
        return seconds / cost if cost else None

    def _account(self) -> None:
        """Give the time since the last look to what was done in it."""
        now = self._clock()
        if self._name is not None:
            self._seconds[self._name] = self._seconds.get(self._name, 0.0) + now - self._since
        self._since = now

    def _leave(self) -> None:
        """The halt that there was is over."""
        if self._name in HALT_COSTS:
            self._done[self._name] = self._done.get(self._name, 0) + (1 if self._name == FIRST_POSE else self.people)
            if self._name == FIRST_POSE and self._done[FIRST_POSE] == 1:
                self._before = self._done.get(FOLLOWING, 0), self._seconds.get(FOLLOWING, 0.0)
        self._name = None

    def _open(self, name: str, total: int | None) -> None:
        self._account()
        self._close()
        self._name = name
        if self._quiet:
            return
        from tqdm import tqdm

        counted = ": {percentage:3.0f}%|{bar}| {n_fmt}/{total_fmt} frames" if total else ""
        # A terminal that says it has no columns (some pseudo-terminals do) would be shown nothing at all.
        width: dict[str, Any] = {"dynamic_ncols": True} if _columns() != 0 else {"ncols": USUAL_COLUMNS}
        self._bar = tqdm(total=total, desc=name, file=sys.stderr, bar_format="{desc}" + counted + "{postfix}", **width)
        self._show(0)

    def _close(self) -> None:
        self._leave()
        if self._bar is not None:
            self._bar.close()
        self._bar = None

    def _show(self, frames: int) -> None:
        if self._bar is None:
            return
        left, gone = self.left_s(), self._clock() - self._begun
        words = f"{_clock_words(gone)} gone" + ("" if left is None else f", about {_clock_words(left)} left of all")
        self._bar.set_postfix_str(words, refresh=not frames)
        if frames:
            self._bar.update(frames)


def _columns() -> int | None:
    """Columns of the terminal at stderr; None where it is none."""
    try:
        return os.get_terminal_size(sys.stderr.fileno()).columns
    except (OSError, ValueError):
        return None


def _clock_words(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes}:{seconds:02d}"
