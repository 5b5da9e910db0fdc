"""What is wrong with a camera, since when, by how much, and what to do."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

__all__ = ["CameraFault", "Faults", "as_table", "sentence"]

#: Of each fault: what is seen, with the amount in its place, and what to do.
WORDS = {
    "lost": ("no images", ""),
    "dark": ("dark", "is the lens covered?"),
    "frozen": ("the same image again and again while the others change", "look at its video"),
    "moved": (
        "what stands still has moved by {amount:.0f} px: the camera was turned or pushed",
        "calibrate it anew, or leave it out: --cameras",
    ),
    "late": ("late by {amount:.0f} frames", "by how much exactly finds hmc sync RECORDING"),
    "early": ("early by {amount:.0f} frames", "by how much exactly finds hmc sync RECORDING"),
    "misfit": (
        "it does not show {amount:.0%} of the people whom the others see, and others elsewhere",
        "has it moved, is it out of time, is this its video? hmc check RECORDING",
    ),
}


@dataclass(frozen=True)
class CameraFault:
    """A time in which a camera does not fit.

    Attributes
    ----------
    camera : str
    fault : str
        "lost", "dark", "frozen", "moved", "late", "early" or "misfit".
    since : int
        The first bad frame, absolute.
    last : int
        The last bad frame so far.
    amount : float
        Pixels of the recording's images for "moved", frames for "late" and "early", for "misfit" the share of the others' hull that the
        camera does not show; 0 for the others.
    left_out : bool
        Whether it does without the camera; else it is told only.
    """

    camera: str
    fault: str
    since: int
    last: int
    amount: float = 0.0
    left_out: bool = True


@dataclass(frozen=True)
class Faults:
    """What was wrong with the cameras of a run so far: `closed` is over, `now` has one entry a camera, or None."""

    now: tuple[CameraFault | None, ...] = ()
    closed: tuple[CameraFault, ...] = ()

    def plus(self, index: int, coming: Sequence[CameraFault | None]) -> Faults:
        """The same after frame `index`; `coming` has an entry a camera."""
        if not coming and not self.now:
            return self
        coming = coming or (None,) * len(self.now)
        closed, now = list(self.closed), []
        for before, new in zip(self.now or (None,) * len(coming), coming, strict=True):
            begun = before is not None and new is not None and (new.camera, new.fault) == (before.camera, before.fault)
            if before is not None and not begun:
                closed.append(before)
            if new is not None:
                new = replace(new, since=min(new.since, before.since) if begun and before is not None else new.since, last=index)
            now.append(new)
        return Faults(tuple(now), tuple(closed))

    @property
    def all(self) -> tuple[CameraFault, ...]:
        """In order of time."""
        found = [*self.closed, *(one for one in self.now if one is not None)]
        return tuple(sorted(found, key=lambda one: (one.since, one.camera)))


def sentence(one: CameraFault, end: int) -> str:
    """One line: which camera, since when, what, by how much, what to do.

    Parameters
    ----------
    one : CameraFault
    end : int
        The frame after the last of the run.
    """
    what, cure = WORDS[one.fault]
    when = f"from frame {one.since} on" if one.last >= end - 1 else f"frames {one.since} to {one.last}"
    done = "left out there" if one.left_out else "kept"
    return f"{one.camera}: {when}: {what.format(amount=one.amount)}; {done}" + (f"; {cure}" if cure else "")


def as_table(faults: Iterable[CameraFault]) -> dict[str, Any]:
    """As ``run.toml`` has them, under each camera's name."""
    table: dict[str, Any] = {}
    for one in faults:
        entry = {"fault": one.fault, "since": one.since, "last": one.last, "amount": round(one.amount, 3), "left_out": one.left_out}
        table.setdefault(one.camera, []).append(entry)
    return table
