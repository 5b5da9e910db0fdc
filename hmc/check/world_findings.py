"""Whether a calibration's world is the room that a recording needs: metres, z up, people in it and of a person's size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hmc.check.cures import sync_command, world_command
from hmc.check.moments import Masks
from hmc.check.silhouettes import covered_shares
from hmc.check.upright import Figure, find_figures, find_ground, level_share
from hmc.io.recording import Recording

__all__ = ["world_findings"]

#: People may stand this far from z, degrees, before the calibration's z is not up: hulls of a few moments tell it to some degrees.
TILTED_DEG = 25.0
#: Who stands is between these, metres: a small child, and more than anybody.
STATURES_M = (0.6, 2.4)
#: Share of a figure that must be within the room, a little widened, metres.
INSIDE, AROUND_M = 0.3, 0.3
#: Cameras of one moment have this much of their silhouettes explained by the others' hull, at least, on the median.
IN_TIME = 0.6


def world_findings(recording: Recording, masks: Sequence[Masks]) -> list[str]:
    """Why the calibration's world cannot be the recording's room; a sentence each, with the command to run.

    Parameters
    ----------
    recording : Recording
    masks : sequence (moments) of sequence (cameras) of ndarray of bool, shape (h, w), or None

    Returns
    -------
    list of str
    """
    rig, room = recording.rig, recording.room
    shown = [frame for frame in masks if sum(mask is not None and bool(mask.any()) for mask in frame) >= max(3, len(rig) / 2)]
    if len(rig) < 3 or not shown:
        return []
    figures = find_figures(rig, shown)
    cure = f"find up, the floor and the scale by: {world_command(recording.path)}"
    if not figures:
        return []  # that silhouettes do not meet is told by how far they agree
    ground = find_ground(rig, figures)
    if ground is not None:
        tilt_deg = float(np.rad2deg(np.arccos(np.clip(ground.up[2], -1, 1))))
        # Who lies on the floor is no sign that the floor stands upright, where cameras are level by the calibration.
        if tilt_deg > TILTED_DEG and (tilt_deg > 180 - TILTED_DEG or level_share(rig, ground.up) > level_share(rig, np.array([0.0, 0, 1]))):
            return [f"people stand {tilt_deg:.0f} degrees from the calibration's z axis, which should point up; {cure}"]
        if not STATURES_M[0] <= ground.stature <= STATURES_M[1]:
            said = f"people come out {ground.stature:.3g} m tall"
            covered = covered_shares(recording, shown)
            if np.isfinite(covered).any() and np.nanmedian(covered) < IN_TIME:
                sync = sync_command(recording.path)
                return [f"{said}, and little of what cameras see fits together: are they out of time ({sync})? Else {cure}"]
            return [f"{said}; the calibration is in other units than metres; {cure}"]
    if not any(_inside(one, room) >= INSIDE for one in figures):
        where = ", ".join(f"{value:.1f}" for value in np.median(np.concatenate([one.points for one in figures]), axis=0))
        limits = " to ".join(f"({', '.join(f'{value:.1f}' for value in end)})" for end in room)
        return [f"people are not in the room: they are about ({where}), and it is {limits} m; correct `room` in recording.toml, or {cure}"]
    return []


def _inside(figure: Figure, room: np.ndarray) -> float:
    """The share of a figure's points that are in the room."""
    return float(((figure.points >= room[0] - AROUND_M) & (figure.points <= room[1] + AROUND_M)).all(axis=1).mean())
