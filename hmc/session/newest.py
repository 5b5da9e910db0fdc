"""Frames as they come from cameras that do not wait: the newest is taken, and those that came meanwhile are dropped and counted."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from threading import Condition, Thread

from hmc.session.front import Session
from hmc.session.images import Images
from hmc.session.step import LiveFrame

__all__ = ["Played", "live"]

logger = logging.getLogger("hmc")


@dataclass(frozen=True)
class Played:
    """How a session kept up: frames that it was given, and frames that came while it was busy."""

    steps: int
    dropped: int


def live(session: Session, source: Iterable[Images], on_frame: Callable[[LiveFrame, Images], object]) -> Played:
    """Step a session through frames that come at their own speed, always with the newest.

    Parameters
    ----------
    session : Session
        Its `fps` should be the rate at which it keeps up: what people do between two steps is judged by it.
    source : iterable of sequences of images
        Each the images of one moment, as `Session.step` takes them; waits for the next as long as cameras do. It is read in a thread of its
        own, and no more than one frame of it is held.
    on_frame : callable
        ``on_frame(found, images)`` after each step; where it returns False, that was the last.

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
    >>> played.steps + played.dropped
    4
    """
    slot = _Slot()
    reader = Thread(target=slot.fill, args=(source,), daemon=True)  # a camera that hangs does not keep the program from ending
    reader.start()
    steps = 0
    try:
        while (images := slot.take()) is not None:
            found = session.step(images)
            steps += 1
            if on_frame(found, images) is False:
                break
    finally:
        slot.close()
    if slot.dropped:
        logger.warning(f"{slot.dropped} of {steps + slot.dropped} frames came while others were worked on, and were dropped")
    return Played(steps, slot.dropped)


class _Slot:
    """A place for one frame between two threads."""

    def __init__(self) -> None:
        self.dropped = 0
        self._newest: Images | None = None
        self._over, self._error = False, None  # type: tuple[bool, BaseException | None]
        self._changed = Condition()

    def fill(self, source: Iterable[Images]) -> None:
        """Put frame after frame, each in place of one that was not taken, until the source or the taker has enough."""
        try:
            for images in source:
                with self._changed:
                    if self._over:
                        return
                    self.dropped += self._newest is not None
                    self._newest = images
                    self._changed.notify()
        except BaseException as error:  # raised where frames are taken
            self._error = error
        finally:
            self.close()

    def take(self) -> Images | None:
        """The newest frame; None when no more will come."""
        with self._changed:
            self._changed.wait_for(lambda: self._newest is not None or self._over)
            images, self._newest = self._newest, None
        if images is None and self._error is not None:
            raise self._error
        return images

    def close(self) -> None:
        """No more frames are put."""
        with self._changed:
            self._over = True
            self._changed.notify()
