"""Motions on the floor: push-ups, sit-ups, lying on the back; tables of key poses for trunk, feet and hands.

Key poses are alike on both sides. Places are metres of a man of 1.75 m, ahead of where the motion starts, angles are degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.synthetic.motions import Feet, Motion, Upper, arms_by_hands, assemble, keyframes
from hmc.synthetic.skeleton import Skeleton

__all__ = ["lie", "push_ups", "sit_ups"]


@dataclass(frozen=True)
class _Key:
    """A pose.

    Parameters
    ----------
    pelvis : tuple of float
        Ahead and up.
    tilt, bend, nod : float
        Forwards: of the pelvis in the world, of the spine from pelvis to chest, of the head against it.
    ankles : tuple of float
        Ahead, to the side, up.
    foot, toes : float
        In the world, toes up.
    wrists : tuple of float
        Ahead, to the side, up.
    """

    pelvis: tuple[float, float]
    tilt: float
    bend: float
    nod: float
    ankles: tuple[float, float, float]
    foot: float
    toes: float
    wrists: tuple[float, float, float]

    def row(self) -> np.ndarray:
        return np.array([*self.pelvis, *self.ankles, *self.wrists, self.tilt, self.bend, self.nod, self.foot, self.toes])


_STAND = _Key((0.0, 0.925), 0, 2, 0, (0.0, 0.10, 0.082), 0, 0, (0.08, 0.26, 0.86))
_SQUAT = _Key((-0.16, 0.40), 45, 60, -45, (0.02, 0.11, 0.11), -22, 0, (0.42, 0.22, 0.09))
_THROWN = _Key((-0.10, 0.52), 60, 25, -30, (-0.42, 0.10, 0.24), -75, -30, (0.42, 0.23, 0.085))
_PLANK = _Key((-0.01, 0.44), 69, 2, -25, (-0.80, 0.09, 0.15), -75, 0, (0.42, 0.24, 0.08))
_LOW = _Key((0.03, 0.21), 84, 2, -30, (-0.80, 0.09, 0.15), -75, 0, (0.36, 0.30, 0.08))
_CROUCH = _Key((-0.26, 0.30), 15, 45, -10, (0.02, 0.14, 0.09), -5, 0, (0.20, 0.30, 0.30))
_SEATED = _Key((-0.40, 0.13), -12, 20, 0, (0.18, 0.14, 0.085), 0, 0, (-0.52, 0.28, 0.09))
_KNEES_UP = _Key((-0.40, 0.12), -88, 0, 18, (0.02, 0.13, 0.085), 0, 0, (-0.34, 0.36, 0.09))
_CURLED = _Key((-0.40, 0.13), -30, 35, 10, (0.02, 0.13, 0.085), 0, 0, (-0.02, 0.22, 0.46))
_SUPINE = _Key((-0.40, 0.115), -90, 0, 8, (0.44, 0.12, 0.075), 70, 70, (-0.30, 0.36, 0.075))
_OVERHEAD = _Key((-0.40, 0.115), -90, 0, 5, (0.44, 0.12, 0.075), 70, 70, (-1.34, 0.34, 0.11))
_REACHING = _Key((-0.40, 0.115), -90, 0, 18, (0.44, 0.12, 0.075), 70, 70, (-0.78, 0.20, 0.62))


def push_ups(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Stand, go down on the hands, throw the legs back, and do push-ups to the end."""
    keys = [(0.0, _STAND), (0.5, _STAND), (1.2, _SQUAT), (1.35, _SQUAT), (1.6, _THROWN), (1.8, _PLANK)]
    return _keyed(skeleton, times, rng, keys, [(0.7, _LOW), (1.3, _PLANK)])


def sit_ups(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Stand, sit down on the floor, lie back with the knees up, and do sit-ups to the end."""
    keys = [(0.0, _STAND), (0.4, _STAND), (1.2, _CROUCH), (1.7, _SEATED), (2.6, _KNEES_UP)]
    return _keyed(skeleton, times, rng, keys, [(0.9, _CURLED), (1.8, _KNEES_UP)])


def lie(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Lie on the back from the beginning; stretch the arms over the head and up, draw the knees up."""
    keys = [(0.0, _SUPINE), (1.0, _SUPINE)]
    cycle = [(0.8, _REACHING), (1.6, _OVERHEAD), (2.4, _REACHING), (3.2, _SUPINE), (4.2, _KNEES_UP), (5.2, _SUPINE)]
    return _keyed(skeleton, times, rng, keys, cycle)


def _keyed(
    skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator, first: list[tuple[float, _Key]], cycle: list[tuple[float, _Key]]
) -> Motion:
    """The motion through the first key poses and then a cycle of others, at a pace that varies, until the time is over."""
    keys, now = list(first), first[-1][0]
    while now < times[-1]:
        pace = rng.uniform(0.92, 1.08)
        keys += [(now + pace * second, key) for second, key in cycle]
        now += pace * cycle[-1][0]
    curve = keyframes(times, np.array([at for at, _ in keys]), np.stack([key.row() for _, key in keys]))
    n, size = len(times), skeleton.height_m / 1.75
    places = curve[:, :8] * size
    tilt, bend, nod, foot, toes = np.radians(curve[:, 8:]).T

    def both(place: np.ndarray) -> np.ndarray:
        return np.stack([place, place * [1, -1, 1]], axis=1)

    def twice(angle: np.ndarray) -> np.ndarray:
        return np.repeat(angle[:, None], 2, axis=1)

    def pitched(angle: np.ndarray) -> np.ndarray:
        return np.column_stack([np.zeros(n), angle, np.zeros(n)])

    upper = Upper(pitched(tilt), pitched(0.45 * bend), pitched(0.55 * bend), pitched(0.4 * nod), pitched(0.6 * nod))
    feet = Feet(both(places[:, 2:5]), np.tile(np.radians([6.0, -6.0]), (n, 1)), twice(foot), twice(toes))
    root = np.column_stack([places[:, 0], np.zeros(n), places[:, 1]])
    return assemble(skeleton, root, upper, feet, arms_by_hands(skeleton, both(places[:, 5:]), frame="world", elbow_out=0.8))
