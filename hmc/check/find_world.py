"""A room of metres with z up and the floor at 0, from a calibration of any world: by people's hulls, and by what is known beside.

What people and cameras say holds to a degree or two, some centimetres and a few per cent (`hmc.check.upright`). So where a calibration's
own axis, floor or usual unit is as near as that, it is taken as it is: whoever calibrated meant it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.camera.model import Rig
from hmc.camera.world import World
from hmc.check.given_points import GroundPoints
from hmc.check.upright import Ground
from hmc.errors import InputError

__all__ = ["FoundWorld", "Known", "find_world"]

#: Metres a unit that calibrations usually have, and their names.
USUAL_UNITS = {1.0: "metres", 0.01: "centimetres", 0.001: "millimetres", 0.1: "decimetres", 0.3048: "feet", 0.0254: "inches"}
#: Statures of who may be in a recording when none is given, metres: a unit is believed where people come out as tall as this.
STATURES_M = (1.4, 2.05)
#: A stature measured on hulls is right to this share: people bend, hair and voxels add.
STATURE_SHARE = 0.06
#: The calibration's axis is meant where up is within twice what it may be off, and so many degrees more, of it, and not more than that ...
AXIS_DEG, MOST_DEG = 0.5, 4.0
#: ... and the floor lies this near to the origin, metres.
FLOOR_M = 0.08
#: Of directions that are off by a deviation a way, 19 in 20 are off by less than so many in all.
SURE = float(np.sqrt(-2 * np.log(0.05)))
#: Points of the floor tell up to so much, degrees.
POINTS_DEG = 0.3


@dataclass(frozen=True)
class Known:
    """What a user knows beforehand; None: nothing.

    Parameters
    ----------
    unit_m : float or None
        Metres a unit of the calibration: the side of the board's squares, say.
    distance : (str, str, float) or None
        Two cameras, and how far they are apart, metres.
    height_m : float or None
        Stature of who is in the recording, metres.
    """

    unit_m: float | None = None
    distance: tuple[str, str, float] | None = None
    height_m: float | None = None


@dataclass(frozen=True, eq=False)
class FoundWorld:
    """A world in metres, z up, and the floor at 0.

    Parameters
    ----------
    world : World
        From the calibration's coordinates to these.
    lines : tuple of str
        What was found, and by what.
    as_it_was : bool
        The calibration is of such a world already.
    """

    world: World
    lines: tuple[str, ...]
    as_it_was: bool


def find_world(rig: Rig, ground: Ground | None, points: GroundPoints | None, known: Known, hidden: Sequence[str] = ()) -> FoundWorld:
    """Up, floor and scale.

    Parameters
    ----------
    rig : Rig
        As the calibration has it.
    ground : Ground or None
        What people say.
    points : GroundPoints or None
        What points on the floor say; before people.
    known : Known
    hidden : sequence of str
        Cameras that show people further down than hulls reach (`hmc.check.hidden`): hulls tell neither the floor nor a stature then.

    Returns
    -------
    FoundWorld

    Raises
    ------
    InputError
        When there is nothing to go by, or nothing tells the scale.
    """
    if points is not None and points.world is not None:
        return FoundWorld(points.world, points.lines, False)
    shown: Ground | GroundPoints | None = points or ground
    if shown is None:
        raise InputError(
            "nobody is seen to stand, so nothing tells where up and the floor are; give points of the floor (--points) or a board that "
            "lies on it (--board)"
        )
    scale, scale_line = _scale(rig, ground, points, known, hidden)
    up, floor = shown.up, shown.floor
    if isinstance(shown, Ground):
        doubt_deg, how = shown.up_deg, f"up and the floor by {shown.standing} hulls of people who stand, and the cameras' mounting"
        lines: tuple[str, ...] = (f"{how}, to within {SURE * doubt_deg:.1f} deg (19 times in 20)",)
        if shown.by:
            lines += (f"something hides legs from other cameras: the floor and statures are by {', '.join(shown.by)} alone",)
    else:
        doubt_deg, lines = POINTS_DEG, shown.lines
    axis = np.eye(3)[np.abs(up).argmax()] * np.sign(up[np.abs(up).argmax()])
    off_deg = float(np.rad2deg(np.arccos(np.clip(axis @ up, -1, 1))))
    meant = off_deg <= min(MOST_DEG, 2 * doubt_deg + AXIS_DEG) and abs(floor) * scale <= FLOOR_M
    name = ("" if axis.max() > 0 else "-") + "xyz"[int(np.abs(axis).argmax())]
    if meant:
        found = f"up is {off_deg:.1f} deg from the calibration's {name} axis, the floor {abs(floor) * scale * 100:.0f} cm from its origin"
        found += ": taken as it is"
        world = World(_turned(axis), np.zeros(3), scale)
    else:
        found = (
            f"up is {off_deg:.1f} deg from the calibration's nearest axis ({name}), the floor {abs(floor) * scale:.2f} m from its origin"
        )
        middle = floor * up if ground is None else ground.middle + (floor - ground.middle @ up) * up
        world = World(_turned(up), middle, scale)
    if hidden and ground is not None and points is None:
        found = f"{found}; but {_cut_off(hidden)}, so the floor is lower: give points of it (--points)"
    lines = (*lines, found, scale_line)
    return FoundWorld(world, lines, bool(meant and scale == 1 and name == "z"))


def _turned(up: np.ndarray) -> np.ndarray:
    """The rotation that makes `up` z and keeps the first other axis as well as it goes."""
    x = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
    x = x - (x @ up) * up
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(up, x), up])


def _cut_off(hidden: Sequence[str]) -> str:
    return f"{', '.join(hidden)} show people further down than hulls reach (something hides their legs from other cameras)"


def _scale(rig: Rig, ground: Ground | None, points: GroundPoints | None, known: Known, hidden: Sequence[str]) -> tuple[float, str]:
    """Metres a unit, and how it is known."""
    people = "" if ground is None else f"; people come out {{:.2f}} m tall ({ground.standing} hulls)"

    def told(scale: float, how: str) -> tuple[float, str]:
        return scale, f"scale: {how}" + (people.format(ground.stature * scale) if ground is not None else "")

    if known.unit_m is not None:
        return told(known.unit_m, f"{known.unit_m:g} m a unit, as given")
    if known.distance is not None:
        one, other, metres = known.distance
        apart = float(np.linalg.norm(np.subtract(*rig.select([one, other]).centres)))
        if apart <= 0:
            raise InputError(f"--distance {one},{other},{metres:g}: these cameras stand in one place in the calibration")
        return told(metres / apart, f"{one} and {other} are {metres:g} m apart, as given: {metres / apart:.6g} m a unit")
    if points is not None and points.unit_m is not None:
        return told(points.unit_m, f"by the board's squares: {points.unit_m:.6g} m a unit")
    if ground is None:
        raise InputError("nothing tells the scale; give --unit METRES (a unit of the calibration), or --distance CAMERA,CAMERA,METRES")
    if hidden and (known.height_m is not None or not STATURES_M[0] <= ground.stature <= STATURES_M[1]):
        raise InputError(
            f"people's hulls are {ground.stature:.3g} units tall, but {_cut_off(hidden)}, so a stature tells no scale; give --unit METRES "
            "(1 where the calibration is in metres) or --distance CAMERA,CAMERA,METRES, and --points for the floor"
        )
    if known.height_m is not None:
        exact = known.height_m / ground.stature
        for unit, name in USUAL_UNITS.items():
            if abs(np.log(exact / unit)) <= STATURE_SHARE:
                return told(unit, f"the calibration is in {name}, as the stature of {known.height_m:g} m says")
        return told(exact, f"by the stature of {known.height_m:g} m, to some per cent: {exact:.6g} m a unit")
    for unit, name in USUAL_UNITS.items():
        if STATURES_M[0] <= ground.stature * unit <= STATURES_M[1]:
            return told(unit, f"the calibration is in {name}")
    raise InputError(
        f"people come out {ground.stature:.3g} units tall, which is no usual unit; give --unit METRES (a unit of the calibration: the side "
        f"of its board's squares, mostly; {1.75 / ground.stature:.3g} if they are 1.75 m tall), "
        "--distance CAMERA,CAMERA,METRES or --height METRES (their stature)"
    )
