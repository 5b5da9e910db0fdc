"""Frames as they come from cameras that do not wait: the newest is taken, and those that came meanwhile are dropped and counted."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from threading import Condition, Thread
from time import monotonic

from hmc.session.front import Session
from hmc.session.images import Images
from hmc.session.step import LiveFrame

__all__ = ["Played", "live"]

logger = logging.getLogger("hmc")


@dataclass(frozen=True)
class Played:
    """How a session kept up.

    Attributes
    ----------
    steps : int
        Frames that it was given.
    dropped : int
        Frames that were due and lost, since it was busy.
    between : int
        Frames left out, since they came sooner than its `fps` asks for.
    """

    steps: int
    dropped: int
    between: int


def live(session: Session, source: Iterable[Images], on_frame: Callable[[LiveFrame, Images], object], wait_s: float = 0.0) -> Played:
    """Step a session through frames that come at their own speed.

    Of frames that come quicker than the session's `fps`, some are left out, so that steps are as far apart as it believes. Give it fewer
    frames a second than it can work on: what it has not kept up with is dropped, and people who were lost from sight for a second or more
    may have to be found anew.

    Parameters
    ----------
    session : Session
    source : iterable of sequences of images
        Each the images of one moment, as `Session.step` takes them; waits for the next as long as cameras do. It is read in a thread of its
        own.
    on_frame : callable
        ``on_frame(found, images)`` after each step; where it returns False, that was the last.
    wait_s : float
        How long frames may wait, seconds; memory holds so many. 0: only the newest does. A person's first pose takes seconds, in which
        whoever walks goes far: with some seconds of waiting nothing is lost then, and the session catches up later, as far as it can.

    Returns
    -------
    Played
        Where frames were dropped, a warning of the logger "hmc" says so too.

    Examples
    --------
    >>> import hmc
    >>> from hmc.io.recording import background_frames, iterate_frames
    >>> recording = hmc.open_recording("data/synthetic/tiny", frames=4)
    >>> background = [background_frames(recording, camera) for camera in range(len(recording.rig))]
    >>> session = hmc.Session(recording.rig, background, recording.fps, recording.room, method=None)
    >>> played = hmc.live(session, (frame.images for frame in iterate_frames(recording)), lambda found, images: None)
    >>> played.steps + played.dropped + played.between
    4
    """
    waiting = _Waiting(session.fps, max(1, round(wait_s * session.fps)))
    # A camera that hangs does not keep the program from ending.
    Thread(target=waiting.fill, args=(source,), daemon=True).start()
    steps = 0
    try:
        while (images := waiting.take()) is not None:
            found = session.step(images)
            steps += 1
            if on_frame(found, images) is False:
                break
    finally:
        waiting.close()
    if waiting.dropped:
        logger.warning(
            f"{waiting.dropped} of {steps + waiting.dropped} frames were dropped: they came while others were worked on; give the session "
            "fewer frames a second (`fps`), larger voxels or fewer cameras, or let more frames wait (`wait_s`)"
        )
    return Played(steps, waiting.dropped, waiting.between)


class _Waiting:
    """Frames that wait between two threads: the newest ones, and no more than may."""

    def __init__(self, fps: float, most: int) -> None:
        self.dropped = self.between = 0
        self._period_s, self._due = 1 / fps, -float("inf")
        self._frames: deque[Images] = deque(maxlen=most)
        self._over, self._error = False, None  # type: tuple[bool, BaseException | None]
        self._changed = Condition()

    def fill(self, source: Iterable[Images]) -> None:
        """Put frame after frame, the oldest of too many away, until the source or the taker has enough."""
        try:
            for images in source:
                with self._changed:
                    if self._over:
                        return
                    self._put(images, monotonic())
        except BaseException as error:  # raised where frames are taken
            self._error = error
        finally:
            self.close()

    def _put(self, images: Images, now: float) -> None:
        # Half a period of grace: cameras as quick as the session are not punctual.
        grace_s = self._period_s / 2
        if now < self._due - grace_s:
            self.between += 1
            return
        self._due = (self._due if now < self._due + grace_s else now) + self._period_s
        self.dropped += len(self._frames) == self._frames.maxlen
        self._frames.append(images)
        self._changed.notify()

    def take(self) -> Images | None:
        """The next frame; None when no more will come."""
        with self._changed:
            self._changed.wait_for(lambda: self._frames or self._over)
            if self._frames:
                return self._frames.popleft()
        if self._error is not None:
            raise self._error
        return None

    def close(self) -> None:
        """No more frames are put."""
        with self._changed:
            self._over = True
            self._changed.notify()
