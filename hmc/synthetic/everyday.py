"""Everyday motions, like those of the nine sequences of Hsiao (2008), chapter 4, each a table of key poses over planted feet.

A key pose is a time, both wrists (ahead, to the left, up, in arm's lengths from the shoulder, along the chest's axes), the turn and the
lean of the trunk (radians), and how far the pelvis goes ahead and down (metres of a man of 1.75 m). Tables are repeated, each time a
little differently.
"""

from __future__ import annotations

import numpy as np

from hmc.synthetic.motions import Feet, Motion, Upper, arms_by_hands, assemble, keyframes, pelvis_height
from hmc.synthetic.skeleton import Skeleton

__all__ = ["behind_back", "close_door", "jump", "lift_and_drop", "push_case", "struggle", "throw_item", "wave"]

_REST_LEFT, _REST_RIGHT = (0.12, 0.16, -0.92), (0.12, -0.16, -0.92)
#: Ankles: ahead, to the left (metres), heading (degrees), left then right.
_SQUARE = ((0.02, 0.12, 10), (-0.02, -0.12, -12))
_STRIDE = ((0.22, 0.12, 5), (-0.20, -0.14, -30))

#: Of who is in the air, metres over seconds squared, and how far heels are higher than toes halfway, radians.
_GRAVITY, _POINTED = 9.81, 0.7

Key = tuple[float, tuple[float, float, float], tuple[float, float, float], float, float, float, float]


def wave(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Wave with the raised right hand, then with both."""
    aside = [(0.16, -0.62, 0.62), (0.16, -0.15, 0.85)]
    keys: list[Key] = [(0.0, _REST_LEFT, _REST_RIGHT, 0.0, 0.02, 0.0, 0.004)]
    keys += [(0.5 + 0.3 * k, _REST_LEFT, aside[k % 2], 0.08, 0.0, 0.0, 0.004) for k in range(5)]
    for k in range(5):
        x, y, z = aside[k % 2]
        keys.append((2.3 + 0.3 * k, (x, -y, z), (x, y, z), 0.0, -0.02, 0.0, 0.004))
    return _keyed(skeleton, times, rng, keys, 4.2, _SQUARE)


def throw_item(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Throw something with the right arm, underarm, swinging it back before."""
    keys: list[Key] = [
        (0.0, _REST_LEFT, (0.35, 0.0, -0.6), 0.0, 0.05, 0.0, 0.01),
        (0.6, (0.30, 0.30, -0.70), (-0.55, -0.30, -0.65), -0.35, 0.20, -0.05, 0.06),
        (1.0, (0.10, 0.45, -0.70), (0.88, -0.05, 0.15), 0.30, 0.10, 0.07, 0.03),
        (1.3, (0.05, 0.50, -0.65), (0.55, 0.05, 0.70), 0.40, 0.00, 0.08, 0.02),
        (1.9, _REST_LEFT, (0.25, -0.2, -0.80), 0.0, 0.05, 0.0, 0.01),
    ]
    return _keyed(skeleton, times, rng, keys, 2.4, _STRIDE)


def struggle(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Strike about with both arms and twist, as a person who is attacked."""
    keys: list[Key] = [
        (0.0, (0.45, 0.35, -0.40), (0.45, -0.35, -0.40), 0.0, 0.10, 0.0, 0.05),
        (0.4, (0.75, 0.25, 0.25), (0.20, -0.70, -0.30), -0.40, 0.15, 0.03, 0.08),
        (0.8, (0.15, 0.80, -0.20), (0.80, -0.10, 0.30), 0.45, 0.10, 0.02, 0.08),
        (1.2, (0.60, 0.60, 0.10), (0.60, -0.60, 0.10), 0.0, -0.05, -0.04, 0.04),
        (1.6, (0.70, 0.20, -0.55), (0.35, -0.45, 0.65), -0.30, 0.25, 0.04, 0.12),
    ]
    return _keyed(skeleton, times, rng, keys, 2.0, _STRIDE)


def close_door(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Reach out to the left ahead for a door, look out, and pull it shut."""
    keys: list[Key] = [
        (0.0, _REST_LEFT, _REST_RIGHT, 0.0, 0.02, 0.0, 0.004),
        (0.8, (0.75, 0.55, -0.10), (0.15, -0.25, -0.85), 0.40, 0.12, 0.06, 0.03),
        (1.5, (0.70, 0.60, -0.10), (0.15, -0.25, -0.85), 0.45, 0.22, 0.08, 0.05),
        (2.2, (0.45, 0.35, -0.35), (0.35, -0.20, -0.65), 0.10, 0.08, 0.00, 0.02),
        (2.8, (0.60, 0.10, -0.20), (0.60, -0.10, -0.20), -0.10, 0.05, 0.03, 0.01),
    ]
    return _keyed(skeleton, times, rng, keys, 3.6, _SQUARE)


def push_case(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Push something heavy ahead with both hands, leaning into it, and draw it back."""
    keys: list[Key] = [
        (0.0, (0.45, 0.15, -0.60), (0.45, -0.15, -0.60), 0.0, 0.15, -0.05, 0.03),
        (0.7, (0.80, 0.10, -0.35), (0.80, -0.10, -0.35), 0.0, 0.45, 0.12, 0.12),
        (1.2, (0.90, 0.10, -0.25), (0.90, -0.10, -0.25), 0.0, 0.50, 0.16, 0.14),
        (1.9, (0.55, 0.15, -0.50), (0.55, -0.15, -0.50), 0.0, 0.25, 0.00, 0.06),
    ]
    return _keyed(skeleton, times, rng, keys, 2.6, _STRIDE)


def lift_and_drop(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Lift something from knee height over the head and throw it down ahead."""
    keys: list[Key] = [
        (0.0, _REST_LEFT, _REST_RIGHT, 0.0, 0.03, 0.0, 0.01),
        (0.8, (0.62, 0.10, -0.62), (0.62, -0.10, -0.62), 0.0, 0.95, -0.06, 0.25),
        (1.5, (0.60, 0.12, -0.15), (0.60, -0.12, -0.15), 0.0, 0.10, 0.0, 0.03),
        (2.1, (0.20, 0.22, 0.90), (0.20, -0.22, 0.90), 0.0, -0.08, 0.0, 0.01),
        (2.6, (0.80, 0.20, 0.05), (0.80, -0.20, 0.05), 0.0, 0.35, 0.04, 0.06),
    ]
    return _keyed(skeleton, times, rng, keys, 3.4, _SQUARE)


def jump(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Jump as high as comes easily, swinging both arms, and stand for a moment."""
    keys: list[Key] = [
        (0.0, _REST_LEFT, _REST_RIGHT, 0.0, 0.03, 0.0, 0.01),
        (0.5, (-0.40, 0.22, -0.80), (-0.40, -0.22, -0.80), 0.0, 0.60, -0.05, 0.28),
        (0.8, (0.45, 0.20, 0.70), (0.45, -0.20, 0.70), 0.0, 0.05, 0.0, 0.0),
        (1.1, (0.55, 0.25, 0.45), (0.55, -0.25, 0.45), 0.0, 0.05, 0.0, 0.0),
        (1.6, (0.35, 0.25, -0.75), (0.35, -0.25, -0.75), 0.0, 0.45, -0.03, 0.22),
    ]
    return _keyed(skeleton, times, rng, keys, 2.4, _SQUARE, aloft=(0.85, 0.55))


def behind_back(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Put both hands on the hips, lay them together behind the back, and let them hang."""
    keys: list[Key] = [
        (0.0, _REST_LEFT, _REST_RIGHT, 0.0, 0.02, 0.0, 0.004),
        (0.7, (0.02, 0.08, -0.66), (0.02, -0.08, -0.66), 0.15, 0.0, 0.0, 0.004),
        (1.4, (-0.30, -0.24, -0.72), (-0.30, 0.24, -0.72), 0.0, -0.03, 0.0, 0.004),
        (2.4, (-0.32, -0.22, -0.70), (-0.32, 0.22, -0.70), -0.25, -0.03, 0.02, 0.004),
        (3.0, (-0.28, 0.20, -0.80), (-0.28, -0.20, -0.80), 0.0, 0.05, 0.0, 0.01),
    ]
    return _keyed(skeleton, times, rng, keys, 3.6, _SQUARE)


def _keyed(
    skeleton: Skeleton,
    times: np.ndarray,
    rng: np.random.Generator,
    keys: list[Key],
    period: float,
    prints,
    aloft: tuple[float, float] | None = None,
) -> Motion:
    """The motion through key poses that are repeated every `period` seconds, at a pace and with hands that vary; `aloft` is when both feet
    leave the floor, and for how long."""
    n, size = len(times), skeleton.height_m / 1.75
    at, rows, now, lift, pointed = [], [], 0.0, np.zeros(len(times)), np.zeros(len(times))
    while now < times[-1] + period:
        pace = rng.uniform(0.92, 1.08)
        if aloft is not None:
            gone = np.clip(times - now - pace * aloft[0], 0, aloft[1])
            lift += _GRAVITY / 2 * gone * (aloft[1] - gone)
            pointed += _POINTED * np.sin(np.pi * gone / aloft[1])
        for second, left, right, *trunk in keys:
            at.append(now + pace * second)
            rows.append(np.concatenate([np.array([*left, *right]) + rng.normal(0, 0.02, 6), trunk]))
        now += pace * period
    curve = keyframes(times, np.array(at), np.array(rows))
    hands, (turn, lean, ahead, drop) = curve[:, :6].reshape(n, 2, 3), curve[:, 6:].T
    nothing = np.zeros(n)

    def columns(pitch: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        return np.stack([nothing, pitch, yaw], axis=-1)

    upper = Upper(
        pelvis=columns(0.35 * lean, 0.3 * turn),
        abdomen=columns(0.30 * lean, 0.3 * turn),
        chest=columns(0.35 * lean, 0.4 * turn),
        neck=np.zeros((n, 3)),
        head=columns(-0.5 * lean, -0.6 * turn),
    )
    places = np.array([[x * size, y * size, skeleton.ankle_height] for x, y, _ in prints])
    yaw = np.radians([heading for _, _, heading in prints])
    ankles = np.tile(places, (n, 1, 1))
    ankles[..., 2] += lift[:, None]
    down = np.repeat(-pointed[:, None], 2, axis=1)
    feet = Feet(ankles, np.tile(yaw, (n, 1)), down, down)
    pelvis = feet.ankles[:, :, :2].mean(axis=1) + size * np.stack([ahead, nothing], axis=-1)
    height = pelvis_height(skeleton, pelvis, upper.pelvis[:, 2], feet) - 0.004 - size * np.maximum(drop, 0)
    return assemble(skeleton, np.column_stack([pelvis, height]), upper, feet, arms_by_hands(skeleton, hands, elbow_out=0.7))
