"""How a run over a whole recording is kept and told of: what trackers and pose methods share."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from hmc.io.camera_faults import CameraFault
from hmc.voxels.hulls import FrontendSettings

__all__ = ["RunOptions"]


def _unheard(fault: CameraFault) -> None:
    """Nobody asked for the cameras' faults as values; `on_problem` says them."""


@dataclass(frozen=True)
class RunOptions:
    """How a run is kept and told of.

    Parameters
    ----------
    frontend : FrontendSettings or None
    journal : path, optional
        File in which the run is kept, and from which it goes on.
    masks : path, optional
        File of silhouettes (`hmc.io.masks`): those that were kept there under the same key are used, where they are all that are wanted;
        else they are made, and kept.
    key : str
        Says what the run depends on. A journal with another key is begun anew.
    on_problem : callable, optional
        Called with one line for everything that was survived.
    progress : callable, optional
        ``progress(steps, total)`` passes the frames on and may show how far they are.
    workers : int
        Processes over which the work is spread, where they may be forked (`hmc.processes`). The result does not depend on it.
    on_phase : callable, optional
        Called with what is done from now on, where that takes longer than a frame: "first pose", "following", "fitting bodies",
        "asking colors".
    on_fault : callable
        Called at the end with each time in which a camera did not fit the others.
    """

    frontend: FrontendSettings | None = None
    journal: str | Path | None = None
    masks: str | Path | None = None
    key: str = ""
    on_problem: Callable[[str], None] = field(default=logging.getLogger("hmc").warning)
    progress: Callable[[Iterable, int], Iterable] | None = None
    workers: int = 1
    on_phase: Callable[[str], None] | None = None
    on_fault: Callable[[CameraFault], None] = field(default=_unheard)

    def say(self, phase: str) -> None:
        """Tell what is done from now on."""
        if self.on_phase is not None:
            self.on_phase(phase)
