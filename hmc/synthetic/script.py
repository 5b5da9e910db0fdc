"""Scripts: what a person does one action after another, walking from place to place, sitting on chairs, waiting for others."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from hmc.errors import InputError
from hmc.synthetic.actions import box, gesture, hug, pick_up, sit, stand, throw_catch
from hmc.synthetic.gait import walk_along
from hmc.synthetic.motions import Motion, place
from hmc.synthetic.recipe import ActorRecipe, FurnitureRecipe, StepRecipe
from hmc.synthetic.skeleton import Skeleton

__all__ = ["furniture_place", "script_motion", "smooth_way"]

ACTIONS = {
    "stand": stand, "gesture": gesture, "box": box, "throw_catch": throw_catch, "pick_up": pick_up, "hug": hug, "sit": sit,
}  # fmt: skip
#: How far before a chair's middle a person stands who is about to sit down on it, metres.
BEFORE_CHAIR_M = 0.36
#: Time over which one action flows into the next, seconds.
BLEND_S = 0.4
#: How long it takes to sit down and to get up again, and the length of `sit` to which these belong, seconds.
DOWN_S, UP_S, SIT_S = 1.8, 1.7, 5.0
WALK_M_S = 1.2
TURN_DEG_S = 130.0
#: People turn on the spot before they walk off in a direction that differs by more, degrees.
LEAST_TURN_DEG = 25.0

Player = Callable[[np.ndarray], Motion]


@dataclass(frozen=True)
class _Piece:
    """Something done from `start` to `end` (seconds); `play` takes seconds since the start."""

    start: float
    end: float
    play: Player


def script_motion(
    actor: ActorRecipe, skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator, furniture: tuple[FurnitureRecipe, ...] = ()
) -> Motion:
    """The motion of an actor's script, in the world; an actor whose script is over stands still.

    Parameters
    ----------
    actor : ActorRecipe
    skeleton : Skeleton
    times : ndarray, shape (n,)
        Seconds.
    rng : Generator
    furniture : tuple of FurnitureRecipe
        What may be sat on.

    Returns
    -------
    Motion

    Raises
    ------
    InputError
        When a step waits for a time that is over.
    """
    here, heading, now = np.array(actor.start_m, float), float(actor.heading_deg), 0.0
    pieces: list[_Piece] = []

    def add(seconds: float, play: Player) -> None:
        nonlocal now
        if seconds > 0:
            pieces.append(_Piece(now, now + seconds, play))
            now += seconds

    def turn(to_deg: float) -> None:
        nonlocal heading
        angle = (to_deg - heading + 180) % 360 - 180
        if abs(angle) > LEAST_TURN_DEG / 5:
            add(max(abs(angle) / TURN_DEG_S, 0.4), _turning(skeleton, rng, here, heading, angle))
        heading = to_deg

    def walk(points: tuple[tuple[float, float], ...], speed: float) -> None:
        nonlocal here, heading
        way, length = smooth_way(np.array([here, *points], float))
        if length < 0.1:
            return
        toward = float(np.degrees(way(np.zeros(1))[1][0]))
        if abs((toward - heading + 180) % 360 - 180) > LEAST_TURN_DEG:
            turn(toward)
        add(length / speed + _RAMP_S, _walking(skeleton, rng, way, length, speed))
        here, heading = np.array(points[-1], float), float(np.degrees(way(np.array([length]))[1][0]))

    for number, one in enumerate(actor.script, start=1):
        speed = one.speed_m_s or WALK_M_S
        if one.do == "walk":
            walk(one.to_m, speed)
            continue
        if one.do == "turn":
            turn(one.to_deg)
            continue
        if one.chair:
            chair = furniture[one.chair - 1]
            middle = furniture_place(chair, now)
            angle = np.radians(chair.heading_deg)
            walk((*one.to_m, tuple(middle + BEFORE_CHAIR_M * np.array([np.cos(angle), np.sin(angle)]))), speed)
            turn(chair.heading_deg)
        seconds = one.until_s - now if one.until_s else one.seconds
        if seconds < 0:
            raise InputError(f"script of the actor who starts at {list(actor.start_m)}: step {number} waits until {one.until_s} s, but "
                             f"{now:.1f} s are over by then")  # fmt: skip
        add(seconds, _acting(one, skeleton, rng, here, heading, seconds))
    last = StepRecipe("stand")
    pieces.append(_Piece(now, np.inf, _acting(last, skeleton, rng, here, heading, np.inf)))
    return _join(pieces, times)


def furniture_place(item: FurnitureRecipe, time: float) -> np.ndarray:
    """Where the middle of a piece of furniture is at a time: x and y, metres."""
    here = np.array(item.at_m, float)
    for start, end, x, y in item.moves:
        share = np.clip((time - start) / max(end - start, 1e-9), 0, 1)
        here = here + share * share * (3 - 2 * share) * (np.array([x, y]) - here)
    return here


def smooth_way(points: np.ndarray, step: float = 0.02, rounding: float = 0.22) -> tuple[Callable, float]:
    """A way through points with rounded corners, straight at both ends and beyond.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Metres.
    step, rounding : float
        Spacing of its samples, and the standard deviation of the smoothing, metres.

    Returns
    -------
    way : callable
        ``way(distance) -> (place, heading)``, as `hmc.synthetic.gait.walk_along` takes it.
    length : float
        Metres.
    """
    legs = np.linalg.norm(np.diff(points, axis=0), axis=1)
    points, legs = points[np.append(True, legs > 1e-6)], legs[legs > 1e-6]
    if not len(legs):
        return functools.partial(_stay, points[0], 0.0, 0.0), 0.0
    along = np.append(0, np.cumsum(legs))
    # Straight stretches at both ends are longer than the smoothing reaches, so the ends stay where they are.
    beyond = 6 * rounding
    first, last = (points[1] - points[0]) / legs[0], (points[-1] - points[-2]) / legs[-1]
    knots = np.concatenate([[-beyond], along, [along[-1] + beyond]])
    corners = np.concatenate([[points[0] - beyond * first], points, [points[-1] + beyond * last]])
    at = np.arange(-beyond, along[-1] + beyond, step)
    places = np.stack([gaussian_filter1d(np.interp(at, knots, corners[:, k]), rounding / step, mode="nearest") for k in (0, 1)], axis=1)
    inner = (at > -3 * rounding) & (at < along[-1] + 3 * rounding)
    at, places = at[inner], places[inner]
    gone = np.append(0, np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1)))
    gone -= np.interp(0, at, gone)
    length = float(np.interp(along[-1], at, gone))
    headings = np.unwrap(np.arctan2(*np.gradient(places, axis=0).T[::-1]))

    def way(distance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        inside = np.clip(distance, gone[0], gone[-1])
        heading = np.interp(inside, gone, headings)
        place_ = np.stack([np.interp(inside, gone, places[:, k]) for k in (0, 1)], axis=-1)
        rest = np.asarray(distance - inside)[..., None]
        return place_ + rest * np.stack([np.cos(heading), np.sin(heading)], axis=-1), heading

    return way, length


#: Time to reach the full pace and to come to rest, seconds.
_RAMP_S = 0.45


def _walking(skeleton: Skeleton, rng: np.random.Generator, way: Callable, length: float, speed: float) -> Player:
    seconds = length / speed + _RAMP_S
    ramp = min(_RAMP_S, seconds / 2)

    def play(times: np.ndarray) -> Motion:
        t = np.clip(times, 0, seconds)
        # The integral of a pace that rises and falls linearly at the ends.
        gone = t - ramp / 2 + np.maximum(ramp - t, 0) ** 2 / (2 * ramp) - np.maximum(t - (seconds - ramp), 0) ** 2 / (2 * ramp)
        gone *= length / (seconds - ramp)
        return walk_along(skeleton, times, rng, gone, way, speed)

    return play


def _turning(skeleton: Skeleton, rng: np.random.Generator, here: np.ndarray, heading: float, angle: float) -> Player:
    # Small steps on the spot: a cycle of both feet for every 100 degrees.
    seconds = max(abs(angle) / TURN_DEG_S, 0.4)
    radius = 0.15
    way = functools.partial(_stay, here, np.radians(heading), np.sign(angle) / radius)
    length = radius * np.radians(abs(angle))

    def play(times: np.ndarray) -> Motion:
        share = np.clip(times / seconds, 0, 1)
        return walk_along(skeleton, times, rng, length * share * share * (3 - 2 * share), way, 0.4, radius * np.radians(100))

    return play


def _stay(here: np.ndarray, heading: float, turn: float, distance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A way that stays in a place and turns by `turn` radians a metre."""
    distance = np.asarray(distance, float)
    return np.broadcast_to(here, (*distance.shape, 2)).copy(), heading + turn * distance


def _acting(one: StepRecipe, skeleton: Skeleton, rng: np.random.Generator, here: np.ndarray, heading: float, seconds: float) -> Player:
    def play(times: np.ndarray) -> Motion:
        if one.do == "sit":
            # Going down and getting up take their time; the rest of it is spent sitting. The whole motion is always made, because it
            # fits itself to the time it is given.
            stay = max(seconds, DOWN_S + UP_S + 0.1)
            own = np.interp(times, [0, DOWN_S, stay - UP_S, stay], [0, DOWN_S, SIT_S - UP_S, SIT_S])
            motion = sit(skeleton, np.append(own, SIT_S), rng, one.seat_m)
            motion = Motion(motion.root[:-1], motion.orientations[:-1])
        else:
            motion = ACTIONS[one.do](skeleton, np.maximum(times, 0), rng)
        return place(motion, here, heading)

    return play


def _join(pieces: list[_Piece], times: np.ndarray) -> Motion:
    """All pieces in a row, each flowing into the next."""
    joined: Motion | None = None
    for piece in pieces:
        frames = np.flatnonzero((times >= piece.start - BLEND_S / 2) & (times < piece.end + BLEND_S / 2))
        if not frames.size:
            continue
        part = piece.play(times[frames] - piece.start)
        if joined is None:
            joined = Motion(np.zeros((len(times), 3)), np.zeros((len(times), *part.orientations.shape[1:])))
            share = np.ones(len(frames))
        else:
            share = np.clip((times[frames] - piece.start) / BLEND_S + 0.5, 0, 1)
            share = share * share * (3 - 2 * share)
        both = share < 1
        joined.root[frames] += share[:, None] * (part.root - joined.root[frames])
        mixed = part.orientations.copy()
        mixed[both] = _between(joined.orientations[frames[both]], part.orientations[both], share[both])
        joined.orientations[frames] = mixed
    if joined is None:
        raise InputError("a script needs a clip of one frame at least")
    return joined


def _between(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Rotations (n, bones, 3, 3) on the shortest way from the first to the second, `share` (n,) of it."""
    if not len(first):
        return second
    shape = first.shape
    away = Rotation.from_matrix((first.swapaxes(-1, -2) @ second).reshape(-1, 3, 3)).as_rotvec()
    part = Rotation.from_rotvec(np.repeat(share, shape[1])[:, None] * away).as_matrix().reshape(shape)
    return first @ part
