"""Whether a calibration's world is the room that a recording needs: metres, z up, people in it and of a person's size."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from hmc.camera.model import Rig
from hmc.check.cures import sync_command, world_command
from hmc.check.hidden import find_legs
from hmc.check.moments import Masks
from hmc.check.silhouettes import at_odds, covered_shares, filled_images
from hmc.check.upright import Figure, Ground, find_figures, find_ground, level_share
from hmc.io.places import places_of
from hmc.io.recording import Recording

__all__ = ["floor_lines", "world_findings"]

#: People may stand this far from z, degrees, before the calibration's z is not up: hulls of a few moments tell it to some degrees.
TILTED_DEG = 25.0
#: Who stands is between these, metres: a small child, and more than anybody.
STATURES_M = (0.6, 2.4)
#: Hulls of people at least so tall reach down to their feet, metres; standing so far from the floor they are not on a step or a treadmill.
WHOLE_M, OFF_FLOOR_M = 1.4, 0.25
#: Share of a figure that must be within the room, a little widened, metres.
INSIDE, AROUND_M = 0.3, 0.3
#: How tall people mostly are, metres, and how many of these metres a floor that they tell is drawn to each side.
USUAL_STATURE_M, DRAWN_M = 1.72, 2
#: Cameras that agree with each other and tell a run of others that they do not fit (docs/reliability.md).
LEFT_TO_JUDGE = 4
#: Cameras of one moment have this much of their silhouettes explained by the others' hull, at least, on the median.
IN_TIME = 0.6


def world_findings(recording: Recording, masks: Sequence[Masks]) -> tuple[list[str], list[str], Ground | None]:
    """Why the calibration's world cannot be the recording's room, or has its floor elsewhere; a sentence each, with the command to run.

    Parameters
    ----------
    recording : Recording
    masks : sequence (moments) of sequence (cameras) of ndarray of bool, shape (h, w), or None

    Returns
    -------
    wrong : list of str
        Why nobody would be found.
    off_floor : list of str
        Why people would be found, but not well: poses are held to the floor.
    ground : Ground or None
        The floor on which people stand, where there is a sentence and it can be told.
    """
    rig = recording.rig
    shown = [frame for frame in masks if sum(mask is not None and bool(mask.any()) for mask in frame) >= max(3, len(rig) / 2)]
    if len(rig) < 3 or not shown:
        return [], [], None
    figures = find_figures(rig, shown)
    ground = find_ground(rig, figures) if figures else None
    wrong = _wrong_world(recording, shown, figures, ground)
    _, ground, hidden = find_legs(rig, figures, shown, ground)
    off_floor = [] if wrong or hidden or ground is None else _off_floor(recording, ground)
    return wrong, off_floor, ground if wrong or off_floor else None


def _off_floor(recording: Recording, ground: Ground) -> list[str]:
    """A sentence where people of a usual stature stand off the floor, which is the room's lower limit."""
    floor_z, feet_z = float(recording.room[0, 2]), float(ground.middle[2])
    if abs(feet_z - floor_z) < OFF_FLOOR_M or ground.stature < WHOLE_M:
        return []
    where, unless = ("above", "unless they stand on something, ") if feet_z > floor_z else ("below", "")
    return [
        f"people stand {abs(feet_z - floor_z):.2f} m {where} z = {floor_z:g}, where the floor is by the room's lower limit; {unless}find "
        f"up, the floor and the scale by: {world_command(places_of(recording))}"
    ]


def _wrong_world(recording: Recording, shown: Sequence[Masks], figures: Sequence[Figure], ground: Ground | None) -> list[str]:
    """The sentences of `world_findings`, of figures in the moments that are `shown`."""
    rig, room = recording.rig, recording.room
    cure = f"find up, the floor and the scale by: {world_command(places_of(recording))}"
    if not figures:
        # Without one or two cameras that are to blame poses may well be found; `hmc.check.silhouettes.hull_findings` tells of them.
        apart = None if filled_images(recording, shown)[0] else at_odds(recording, shown)
        return [apart[1]] if apart is not None and not apart[0] and not _meet_without_two(rig, shown[len(shown) // 2]) else []
    if ground is not None:
        tilt_deg = float(np.rad2deg(np.arccos(np.clip(ground.up[2], -1, 1))))
        # Who lies on the floor is no sign that the floor stands upright, where cameras are level by the calibration.
        if tilt_deg > TILTED_DEG and (tilt_deg > 180 - TILTED_DEG or level_share(rig, ground.up) > level_share(rig, np.array([0.0, 0, 1]))):
            return [f"people stand {tilt_deg:.0f} degrees from the calibration's z axis, which should point up; {cure}"]
        if not STATURES_M[0] <= ground.stature <= STATURES_M[1]:
            said = f"people come out {ground.stature:.3g} m tall"
            covered = covered_shares(recording, shown)
            if np.isfinite(covered).any() and np.nanmedian(covered) < IN_TIME:
                sync = sync_command(places_of(recording))
                return [f"{said}, and little of what cameras see fits together: are they out of time ({sync})? Else {cure}"]
            return [f"{said}; the calibration is in other units than metres; {cure}"]
    if not any(_inside(one, room) >= INSIDE for one in figures):
        where = ", ".join(f"{value:.1f}" for value in np.median(np.concatenate([one.points for one in figures]), axis=0))
        limits = " to ".join(f"({', '.join(f'{value:.1f}' for value in end)})" for end in room)
        return [f"people are not in the room: they are about ({where}), and it is {limits} m; correct `room` in recording.toml, or {cure}"]
    return []


def _meet_without_two(rig: Rig, masks: Masks) -> bool:
    """Whether silhouettes of one moment meet without some two cameras, and there are as many others as a run needs to leave them out."""
    pairs = itertools.combinations(range(len(rig)), 2) if len(rig) >= LEFT_TO_JUDGE + 2 else ()
    return any(find_figures(rig, [[None if c in pair else mask for c, mask in enumerate(masks)]]) for pair in pairs)


def floor_lines(ground: Ground) -> np.ndarray:
    """The floor on which people stand as lines that lie about a metre apart, in the calibration's coordinates.

    Parameters
    ----------
    ground : Ground

    Returns
    -------
    ndarray, shape (n, 2, 3)
        Both ends of each.
    """
    metre = ground.stature / USUAL_STATURE_M
    across = np.linalg.svd(ground.up[None])[2][1:] * metre * DRAWN_M
    places = np.linspace(-1, 1, 2 * DRAWN_M + 1)[:, None]
    lines = [[place * one - other, place * one + other] for one, other in (across, across[::-1]) for place in places]
    return ground.middle + np.array(lines)


def _inside(figure: Figure, room: np.ndarray) -> float:
    """The share of a figure's points that are in the room."""
    return float(((figure.points >= room[0] - AROUND_M) & (figure.points <= room[1] + AROUND_M)).all(axis=1).mean())
