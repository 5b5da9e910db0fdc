"""Motions like those of the recordings of Kehl (2006), section 7: each begins in the pose of da Vinci's man, arms and legs spread.

Feet may leave the floor; what stands turns on the spot. Places are metres of a man of 1.75 m, hands in arm's lengths from the shoulder.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from hmc.synthetic.motions import Feet, Motion, Upper, arms_by_hands, assemble, keyframes, pelvis_height
from hmc.synthetic.skeleton import Skeleton

__all__ = ["dance", "kick_turn", "pedal_arms", "play_cube"]

Hands = dict[str, tuple[float, float, float]]
#: Second, hands, turn to the left, lean forwards (radians), and where feet are that are off the floor.
Key = tuple[float, Hands, float, float, dict[str, dict[str, float]]]
#: Seconds for which the pose at the start is held.
_HOLD_S = 0.6
_SPREAD: Hands = {"left": (0.02, 0.98, 0.06), "right": (0.02, -0.98, 0.06)}
_HIPS: Hands = {"left": (0.16, 0.26, -0.66), "right": (0.16, -0.26, -0.66)}
_GUARD: Hands = {"left": (0.42, -0.12, 0.02), "right": (0.42, 0.12, 0.02)}
_DOWN: Hands = {"left": (0.06, 0.18, -0.95), "right": (0.06, -0.18, -0.95)}
_WIDE, _STAND = 0.30, 0.13


def kick_turn(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Hands on the hips, kicks with both legs behind a guard, leaning back, and a turn to the left (section 7.3)."""
    kick = {"ahead": 0.62, "up": 0.62}
    keys: list[Key] = [
        (0.9, _HIPS, 0.0, 0.0, {}),
        (1.6, _HIPS, 0.15, 0.0, {}),
        (2.0, _GUARD, 0.1, 0.05, {}),
        (2.4, _GUARD, 0.0, -0.22, {"right": kick}),
        (2.8, _GUARD, 0.1, 0.0, {}),
        (3.2, _GUARD, 0.25, -0.22, {"left": kick}),
        (3.6, _GUARD, 0.45, 0.0, {}),
        (4.1, {"left": (0.25, 0.8, 0.1), "right": (0.3, -0.75, 0.2)}, 1.0, 0.05, {}),
        (4.5, _GUARD, 1.3, -0.25, {"right": kick}),
        (4.9, _GUARD, 1.6, 0.0, {}),
        (5.4, {"left": (0.75, 0.2, 0.45), "right": (0.75, -0.2, 0.45)}, 1.9, -0.30, {}),
        (5.8, _GUARD, 2.1, 0.0, {}),
        (6.2, _GUARD, 2.2, -0.22, {"left": kick}),
        (6.6, _HIPS, 2.3, 0.0, {}),
        (7.4, _HIPS, 2.4, 0.0, {}),
    ]
    return _drill(skeleton, times, keys)


def pedal_arms(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """The forearms turn round each other close to the chest, as the pedals of a bicycle, then hang and cross (sections 7.1, 7.2)."""
    keys: list[Key] = []
    for k in range(16):
        angle = k * np.pi / 2
        out, up = 0.16 * np.cos(angle), 0.16 * np.sin(angle)
        keys.append((1.2 + 0.22 * k, {"left": (0.42 + out, -0.22, -0.34 + up), "right": (0.42 - out, 0.22, -0.34 - up)}, 0.1, 0.03, {}))
    crossed = {"left": (0.34, -0.36, -0.30), "right": (0.40, 0.36, -0.22)}
    keys += [(5.2, _DOWN, 0.0, 0.0, {}), (6.0, crossed, -0.1, 0.0, {}), (6.6, crossed, 0.1, 0.0, {}), (7.4, _DOWN, 0.0, 0.0, {})]
    return _drill(skeleton, times, keys)


def dance(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Arms flung about, then fast steps on the spot, then poses far apart with quick changes (section 7.4), for a quarter, a fifth and
    the rest of the time, as the paper's 375 frames are shared out."""
    poses = [
        {"left": (0.25, 0.35, 0.88), "right": (0.15, -0.55, -0.75)},
        {"left": (0.15, 0.55, -0.75), "right": (0.25, -0.35, 0.88)},
        {"left": (0.90, 0.20, 0.10), "right": (0.90, -0.20, 0.10)},
        _SPREAD,
        {"left": (0.40, 0.40, 0.80), "right": (0.40, -0.40, 0.80)},
        {"left": (-0.25, 0.50, -0.75), "right": (0.85, -0.30, 0.20)},
    ]
    keys: list[Key] = []
    now, end = 0.9, float(times[-1]) if len(times) else 0.0
    while now < 95 / 375 * end:
        k = len(keys)
        keys.append((now, poses[k % 4 if k < 4 else int(rng.integers(len(poses)))], 0.3 * (-1) ** k, 0.05, {}))
        now += 0.33
    step = {"ahead": 0.12, "up": 0.26}
    while now < 175 / 375 * end:
        k = len(keys)
        side, other = ("left", "right") if k % 2 else ("right", "left")
        keys.append((now, {other: (0.45, 0.15 if other == "left" else -0.15, -0.55), side: _DOWN[side]}, 0.0, 0.05, {side: step}))
        now += 0.28
    while now < end:
        for k in rng.permutation(len(poses)):
            keys += [(now, poses[k], 0.25 * (-1) ** k, 0.0, {}), (now + 0.25, poses[k], 0.25 * (-1) ** k, 0.0, {})]
            now += 0.58
    return _drill(skeleton, times, keys)


def play_cube(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Brings something to the other hand, lifts it and reaches out with it, over and over (section 7.5; the paper's cube is thrown and
    kicked too)."""
    meet = {"left": (0.66, -0.24, -0.12), "right": (0.66, 0.24, -0.12)}
    right_out = {"left": _DOWN["left"], "right": (0.35, -0.88, 0.08)}
    right_up = {"left": _DOWN["left"], "right": (0.35, -0.30, 0.84)}
    right_ahead = {"left": (0.2, 0.5, -0.7), "right": (0.95, -0.10, 0.05)}
    stages = [right_out, right_up, right_ahead, meet, right_out, right_ahead, right_up, meet]
    count = 1 + int(max(float(times[-1]) - 1.2, 0.0) / 0.75) if len(times) else 1
    return _drill(skeleton, times, [(1.2 + 0.75 * k, stages[k % len(stages)], 0.15 * (-1) ** k, 0.04, {}) for k in range(count)])


def _drill(skeleton: Skeleton, times: np.ndarray, keys: list[Key]) -> Motion:
    """Through keys of (second, hands, turn to the left, lean forwards, feet off the floor), radians, from the pose at the start."""
    keys = [(0.0, _SPREAD, 0.0, 0.0, {}), (_HOLD_S, _SPREAD, 0.0, 0.0, {}), *keys]
    rows = []
    for k, (_, hands, turn, lean, lifted) in enumerate(keys):
        out = _WIDE if k < 2 else _STAND
        places = []
        for side, sign in (("left", 1.0), ("right", -1.0)):
            raised = lifted.get(side)
            places.append((raised["ahead"], sign * 0.10, raised["up"]) if raised else (0.0, sign * out, 0.0))
        one_leg = 0.06 * (("right" in lifted) - ("left" in lifted))
        rows.append(np.concatenate([hands["left"], hands["right"], *places, [turn, lean, one_leg]]))
    curve = keyframes(times, np.array([key[0] for key in keys]), np.array(rows))
    n, size = len(times), skeleton.height_m / 1.75
    wrists, steps, (turn, lean, shift) = curve[:, :6].reshape(n, 2, 3), size * curve[:, 6:12].reshape(n, 2, 3), curve[:, 12:].T
    turned = Rotation.from_rotvec(turn[:, None] * [0, 0, 1]).as_matrix()
    ankles = np.einsum("nij,nsj->nsi", turned, steps) + [0, 0, skeleton.ankle_height]
    pitch = np.clip(steps[..., 2], 0, 0.6)
    feet = Feet(ankles, np.stack([turn + 0.12, turn - 0.12], axis=-1), pitch, pitch)
    offset = np.column_stack([-0.10 * np.minimum(lean, 0), size * shift])
    xy = np.einsum("nij,nj->ni", turned[:, :2, :2], offset)
    height = pelvis_height(skeleton, xy, turn, _standing(feet, steps, skeleton)) - 0.01
    none = np.zeros(n)
    upper = Upper(
        np.column_stack([none, 0.3 * lean, turn]),
        np.column_stack([none, 0.35 * lean, none]),
        np.column_stack([none, 0.35 * lean, none]),
        np.zeros((n, 3)),
        np.column_stack([none, -0.8 * lean, none]),
    )
    return assemble(skeleton, np.column_stack([xy, height]), upper, feet, arms_by_hands(skeleton, wrists, elbow_out=1.1))


def _standing(feet: Feet, steps: np.ndarray, skeleton: Skeleton) -> Feet:
    """The same feet, those in the air as if they stood beside: they do not hold the pelvis down."""
    ankles = feet.ankles.copy()
    free = np.clip(steps[..., 2:] / 0.1, 0, 1)
    ankles = (1 - free) * ankles + free * (ankles[:, ::-1])
    ankles[..., 2] = skeleton.ankle_height
    return Feet(ankles, feet.yaw, feet.pitch, feet.toe_pitch)
