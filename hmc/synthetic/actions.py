"""Motions on planted feet: standing, boxing, gestures, throwing and catching, sitting down, picking up, a hug."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from hmc.synthetic.motions import Feet, Motion, Upper, arms_by_angles, arms_by_hands, assemble, keyframes, pelvis_height, roll_foot
from hmc.synthetic.skeleton import Skeleton

__all__ = ["box", "gesture", "hug", "lunge", "pick_up", "sit", "stand", "throw_catch"]


def stand(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Stand and look about; arguments and result as for `hmc.synthetic.gait.walk`."""
    n = len(times)
    feet = _planted(skeleton, n, [(0.0, 0.10, 8), (0.0, -0.10, -8)])
    look = _wander(times, rng, 0.25, 2.5)
    upper = _upper(
        n, chest=_columns(n, pitch=0.03 + _wander(times, rng, 0.01, 3), yaw=0.3 * look), head=_columns(n, pitch=-0.02, yaw=0.7 * look)
    )
    swing = 0.05 + np.stack([_wander(times, rng, 0.02, 2), _wander(times, rng, 0.02, 2)], axis=-1)
    arms = arms_by_angles(swing, np.full((n, 2), 0.25), np.full((n, 2), 0.14))
    return _on_feet(skeleton, times, feet, upper, arms, 0.012 * _shift(times, rng), np.zeros(n))


def box(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Box at the air: guard, jabs, crosses and hooks, weaving a little."""
    n = len(times)
    feet = _planted(skeleton, n, [(0.20, 0.12, -12), (-0.20, -0.14, -50)])
    guard = np.array([[0.44, -0.14, 0.14], [0.38, 0.14, 0.12]])
    blows = {
        # Wrist at the end of the blow (ahead, left, up, in arm's lengths from the shoulder), which arm, and the turn of the body.
        "jab": (np.array([0.97, -0.14, 0.12]), 0, -0.30),
        "cross": (np.array([0.97, 0.14, 0.10]), 1, 0.85),
        "hook": (np.array([0.62, -0.42, 0.12]), 0, -0.60),
    }
    stance = 0.55  # the body stands turned to the right, radians
    at, poses, turns = [0.0], [guard], [0.0]
    now = rng.uniform(0.1, 0.4)
    while now < times[-1] + 1:
        blow, side, twist = blows[str(rng.choice(list(blows)))]
        out = np.array(guard)
        out[side] = Rotation.from_euler("z", stance - twist).apply(blow)  # from the direction of the fight to the chest's axes
        for wait, pose, turn in ((0.0, guard, 0.0), (0.18, out, twist), (0.26, guard, 0.0)):
            now += wait
            at.append(now)
            poses.append(pose)
            turns.append(turn)
        now += rng.uniform(0.08, 0.55)
    hands, yaw = keyframes(times, np.array(at), np.array(poses)), keyframes(times, np.array(at), np.array(turns))
    hands = hands + 0.02 * np.stack([[_wander(times, rng, 1, 0.8) for _ in range(3)] for _ in range(2)]).transpose(2, 0, 1)
    weave = _wander(times, rng, 1.0, 1.1)
    upper = _upper(
        n,
        pelvis=_columns(n, roll=0.03 * weave, pitch=0.08, yaw=0.4 * yaw - stance),
        abdomen=_columns(n, pitch=0.10, yaw=0.25 * yaw),
        chest=_columns(n, roll=0.06 * weave, pitch=0.10, yaw=0.35 * yaw),
        head=_columns(n, pitch=-0.12, yaw=0.45 - 0.8 * yaw),
    )
    heel = np.radians(-12 - 22 * np.clip(yaw, 0, 1))
    feet = _raise_heel(skeleton, feet, 1, heel)
    xy = np.stack([0.03 * yaw, 0.03 * weave], axis=-1)
    return _on_feet(
        skeleton, times, feet, upper, arms_by_hands(skeleton, hands, elbow_out=0.35), xy, 0.05 + 0.015 * (1 + _wander(times, rng, 1, 0.9))
    )


def gesture(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Talk with the hands: wave, point, spread the arms, raise them."""
    n = len(times)
    feet = _planted(skeleton, n, [(0.02, 0.11, 10), (-0.02, -0.11, -12)])
    rest = np.array([[0.12, 0.10, -0.93], [0.12, -0.10, -0.93]])
    gestures = {
        "wave": [np.array([rest[0], [0.18, y, 0.72]]) for y in (-0.45, -0.05, -0.45, -0.05, -0.45)],
        "point": [np.array([[0.92, 0.08, 0.12], rest[1]])] * 2,
        "spread": [np.array([[0.25, 0.90, 0.02], [0.25, -0.90, 0.02]])] * 2,
        "raise": [np.array([[0.15, 0.30, 0.90], [0.15, -0.30, 0.90]])] * 2,
        "explain": [np.array([[0.55, 0.10, -0.25], [0.55, -0.10, -0.05]]), np.array([[0.55, 0.25, -0.05], [0.55, -0.25, -0.30]])] * 2,
    }
    at, poses = [0.0], [rest]
    now = rng.uniform(0.1, 0.3)
    names: list[str] = []
    while now < times[-1] + 1:
        names = names or [str(name) for name in rng.permutation(list(gestures))]
        pose = gestures[names.pop()]
        if rng.random() < 0.5:  # with the other hand
            pose = [p[::-1] * [1, -1, 1] for p in pose]
        for k, p in enumerate(pose):
            now += 0.55 if k == 0 else rng.uniform(0.22, 0.32)
            at.append(now)
            poses.append(p)
        now += 0.55
        at.append(now)
        poses.append(rest)
        now += rng.uniform(0.05, 0.3)
    hands = _clear(keyframes(times, np.array(at), np.array(poses)))
    look = _wander(times, rng, 0.3, 2.0)
    lean = hands[:, 1, 2] - hands[:, 0, 2]
    upper = _upper(
        n,
        pelvis=_columns(n, yaw=0.15 * look),
        abdomen=_columns(n, roll=-0.02 * lean, yaw=0.15 * look),
        chest=_columns(n, roll=-0.03 * lean, pitch=0.02),
        head=_columns(n, pitch=-0.03 + _wander(times, rng, 0.05, 1.2), yaw=0.6 * look),
    )
    return _on_feet(
        skeleton, times, feet, upper, arms_by_hands(skeleton, hands, elbow_out=0.7), 0.02 * _shift(times, rng), np.full(n, 0.004)
    )


def throw_catch(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Throw overhand with the right arm and catch with both, again and again."""
    n = len(times)
    feet = _planted(skeleton, n, [(0.18, 0.12, 5), (-0.18, -0.13, -35)])
    # Seconds, left wrist, right wrist, turn of the trunk, lean, shift of the weight forwards.
    keys = [
        (0.00, [0.45, -0.05, -0.35], [0.45, 0.05, -0.35], 0.0, 0.05, 0.00),
        (0.55, [0.70, 0.10, 0.10], [-0.30, -0.45, 0.40], -0.70, -0.10, -0.07),
        (0.78, [0.40, 0.15, -0.10], [0.72, 0.02, 0.62], 0.35, 0.10, 0.06),
        (0.98, [0.15, 0.10, -0.50], [0.62, 0.50, -0.40], 0.60, 0.35, 0.09),
        (1.45, [0.50, -0.05, -0.15], [0.50, 0.05, -0.15], 0.0, 0.05, 0.00),
        (1.75, [0.80, -0.22, 0.20], [0.80, 0.22, 0.20], 0.0, 0.08, 0.03),
        (1.95, [0.50, -0.15, -0.10], [0.50, 0.15, -0.10], 0.0, 0.05, -0.02),
    ]
    at, rows = [], []
    now = 0.0
    while now < times[-1] + 1:
        pace = rng.uniform(0.9, 1.1)
        for second, left, right, *trunk in keys:
            at.append(now + pace * second)
            jitter = rng.normal(0, 0.03, 6)
            rows.append(np.concatenate([np.concatenate([left, right]) + jitter, trunk]))
        now = at[-1] + rng.uniform(0.35, 0.6)
    curve = keyframes(times, np.array(at), np.array(rows))
    hands, turn, lean, shift = _clear(curve[:, :6].reshape(n, 2, 3)), curve[:, 6], curve[:, 7], curve[:, 8]
    upper = _upper(
        n,
        pelvis=_columns(n, pitch=0.25 * lean, yaw=-0.25 + 0.4 * turn),
        abdomen=_columns(n, pitch=0.35 * lean, yaw=0.25 * turn),
        chest=_columns(n, pitch=0.40 * lean, yaw=0.10 + 0.35 * turn),
        head=_columns(n, pitch=-0.7 * lean, yaw=0.15 - 0.8 * turn),
    )
    feet = _raise_heel(skeleton, feet, 1, np.radians(-4 - 35 * np.clip(turn, 0, 1)))
    return _on_feet(
        skeleton, times, feet, upper, arms_by_hands(skeleton, hands), np.stack([shift, 0 * shift], axis=-1), 0.02 + 0.4 * np.abs(shift)
    )


def sit(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator, seat_m: float = 0.45) -> Motion:
    """Sit down on a seat behind, stay, and get up again; the seat's middle is 0.36 m behind the start."""
    n = len(times)
    size = skeleton.height_m / 1.75
    feet = _planted(skeleton, n, [(0.02, 0.12, 8), (0.02, -0.12, -8)])
    span = max(times[-1], 3.0)
    at = np.array([0.04, 0.16, 0.30, 0.36, 0.66, 0.72, 0.86, 0.96]) * span
    down = seat_m + 0.105 * size  # of the hips on the seat
    stretch = skeleton.hip_height
    #       pelvis back, drop, pelvis pitch, spine pitch, head pitch, hands (x, z)
    up = [0.0, 0.01, 0.0, 0.03, 0.0, 0.10, -0.94]
    bent = [0.18, 0.45 * (stretch - down), 0.55, 0.35, -0.45, 0.55, -0.55]
    seated = [0.80 * min(skeleton.length("l_shank"), skeleton.length("r_shank")), stretch - down, 0.12, 0.05, -0.05, 0.50, -0.74]
    settled = [*seated[:2], -0.14, 0.10, -0.02, 0.50, -0.72]
    curve = keyframes(times, at, np.array([up, bent, seated, settled, settled, seated, bent, up]))
    back, drop, tilt, spine, nod, x, z = curve.T
    upper = _upper(
        n,
        pelvis=_columns(n, pitch=tilt),
        abdomen=_columns(n, pitch=0.5 * spine),
        chest=_columns(n, pitch=0.5 * spine),
        neck=_columns(n, pitch=0.4 * nod),
        head=_columns(n, pitch=0.6 * nod, yaw=_wander(times, rng, 0.2, 1.7)),
    )
    y = np.interp(x, [0.1, 0.5], [0.10, -0.06])
    hands = np.stack([np.stack([x, y, z], axis=-1), np.stack([x, -y, z], axis=-1)], axis=1)
    root = np.column_stack([-back, np.zeros(n), stretch - drop])
    return assemble(skeleton, root, upper, feet, arms_by_hands(skeleton, hands, elbow_out=0.5))


def pick_up(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Bend the knees and the back, take something from the floor, lift it, and put it down again."""
    n = len(times)
    size = skeleton.height_m / 1.75
    feet = _planted(skeleton, n, [(0.03, 0.15, 12), (-0.03, -0.15, -12)])
    span = max(times[-1], 3.0)
    at = np.array([0.03, 0.22, 0.28, 0.48, 0.58, 0.78, 0.83, 0.98]) * span
    # pelvis back, drop, pelvis pitch, spine pitch, head pitch, wrists x, y, z in metres of a man of 1.75 m
    up = [0.0, 0.01, 0.0, 0.03, 0.0, 0.08, 0.30, 0.84]
    down = [0.20, 0.36, 0.75, 0.70, -0.55, 0.42, 0.15, 0.20]
    held = [0.03, 0.02, -0.03, 0.04, 0.10, 0.36, 0.14, 1.05]
    curve = keyframes(times, at, np.array([up, down, down, held, held, down, down, up]))
    curve[:, 0:2] *= size
    curve[:, 5:] *= size
    back, drop, tilt, spine, nod, x, y, z = curve.T
    upper = _upper(
        n,
        pelvis=_columns(n, pitch=tilt),
        abdomen=_columns(n, pitch=0.45 * spine),
        chest=_columns(n, pitch=0.55 * spine, yaw=_wander(times, rng, 0.04, 1.5)),
        neck=_columns(n, pitch=0.4 * nod),
        head=_columns(n, pitch=0.6 * nod),
    )
    hands = np.stack([np.stack([x, y, z], axis=-1), np.stack([x, -y, z], axis=-1)], axis=1)
    root = np.column_stack([-back, np.zeros(n), skeleton.hip_height - drop])
    return assemble(skeleton, root, upper, feet, arms_by_hands(skeleton, hands, frame="world", elbow_out=0.6))


def hug(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Hold a person who stands .4 m ahead: arms round them, chest leant forwards."""
    n = len(times)
    feet = _planted(skeleton, n, [(0.05, 0.11, 6), (-0.05, -0.11, -6)])
    shift = 0.02 * np.stack([_wander(times, rng, 1.0, 1.5) for _ in range(2)], axis=-1)
    high = rng.choice([-1.0, 1.0])  # one arm over the other's shoulder, one below
    hands = np.array([[0.72, -0.32, 0.05 + 0.12 * high], [0.72, 0.32, 0.05 - 0.12 * high]])
    upper = _upper(
        n,
        pelvis=_columns(n, pitch=0.06),
        abdomen=_columns(n, pitch=0.06),
        chest=_columns(n, pitch=0.05 + shift[:, 0]),
        head=_columns(n, pitch=-0.1, yaw=0.5 * high),
    )
    arms = arms_by_hands(skeleton, np.tile(hands, (n, 1, 1)), elbow_out=1.2)
    return _on_feet(skeleton, times, feet, upper, arms, shift, np.full(n, 0.004))


def lunge(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """Go down on the front leg and up again, with the hands at the hips; the back foot stands on its ball all the time."""
    n, size = len(times), skeleton.height_m / 1.75
    feet = _planted(skeleton, n, [(0.36, 0.10, 4), (-0.40, -0.10, -6)])
    feet = _raise_heel(skeleton, feet, 1, np.full(n, np.radians(-55)))
    at, down, now = [0.0, 0.7], [0.0, 0.0], 0.7
    while now < times[-1]:
        for wait, depth in ((0.8, 1.0), (0.5, 1.0), (0.8, 0.0), (0.4, 0.0)):
            now += wait * float(rng.uniform(0.95, 1.05))
            at.append(now)
            down.append(depth)
    low = keyframes(times, np.array(at), np.array(down))
    upper = _upper(n, pelvis=_columns(n, pitch=0.05 + 0.05 * low), abdomen=_columns(n, pitch=0.04), chest=_columns(n, pitch=0.02 * low))
    hands = np.array([[0.10, 0.34, -0.68], [0.10, -0.34, -0.68]])
    arms = arms_by_hands(skeleton, np.tile(hands, (n, 1, 1)), elbow_out=1.4)
    shift = np.stack([size * (0.04 + 0.06 * low), np.zeros(n)], axis=-1)
    return _on_feet(skeleton, times, feet, upper, arms, shift, size * (0.03 + 0.26 * low))


def _planted(skeleton: Skeleton, n: int, prints) -> Feet:
    """Both feet flat on the floor for n frames; a print is x, y (metres of a man of 1.75 m) and heading (degrees)."""
    size = skeleton.height_m / 1.75
    places = np.array([[x * size, y * size, skeleton.ankle_height] for x, y, _ in prints])
    yaw = np.radians([heading for _, _, heading in prints])
    return Feet(np.tile(places, (n, 1, 1)), np.tile(yaw, (n, 1)), np.zeros((n, 2)), np.zeros((n, 2)))


def _raise_heel(skeleton: Skeleton, feet: Feet, side: int, pitch: np.ndarray) -> Feet:
    """Lift one heel, turning the foot about its ball; ``pitch`` (n,) is negative, radians."""
    ankles, pitches = feet.ankles.copy(), feet.pitch.copy()
    forward, height = roll_foot(skeleton, pitch)
    heading = feet.yaw[:, side]
    ankles[:, side, 0] += forward * np.cos(heading)
    ankles[:, side, 1] += forward * np.sin(heading)
    ankles[:, side, 2] = height
    pitches[:, side] = pitch
    return Feet(ankles, feet.yaw, pitches, feet.toe_pitch)


def _on_feet(skeleton: Skeleton, times: np.ndarray, feet: Feet, upper: Upper, arms, shift: np.ndarray, drop: np.ndarray) -> Motion:
    """Carry the pelvis between the feet, moved by ``shift`` (n, 2), and ``drop`` (n,) below where the legs are straight; metres."""
    xy = feet.ankles[:, :, :2].mean(axis=1) + shift
    height = pelvis_height(skeleton, xy, upper.pelvis[:, 2], feet) - 0.004 - drop
    return assemble(skeleton, np.column_stack([xy, height]), upper, feet, arms)


def _upper(n: int, **curves: np.ndarray) -> Upper:
    return Upper(*(curves.get(name, np.zeros((n, 3))) for name in ("pelvis", "abdomen", "chest", "neck", "head")))


def _columns(n: int, roll=0.0, pitch=0.0, yaw=0.0) -> np.ndarray:
    return np.stack([np.broadcast_to(np.asarray(value, float), n) for value in (roll, pitch, yaw)], axis=-1)


def _wander(times: np.ndarray, rng: np.random.Generator, size: float, period_s: float) -> np.ndarray:
    """A smooth wandering curve (n,), most of it within ``size`` of zero."""
    total = np.zeros_like(times)
    for k in range(3):
        total += np.sin(2 * np.pi * times / (period_s * rng.uniform(0.7, 1.4) * (k + 1) ** 0.5) + rng.uniform(0, 2 * np.pi))
    return size * total / 2


def _shift(times: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A wandering of the weight over the floor, (n, 2)."""
    return np.stack([_wander(times, rng, 1.0, 3.0), _wander(times, rng, 1.0, 3.5)], axis=-1)


def _clear(hands: np.ndarray) -> np.ndarray:
    """Push wrists that come near their shoulder forwards, so that a hand goes round the shoulder and not through it."""
    lack = np.maximum(0.55**2 - np.sum(hands**2, axis=-1), 0)
    forward = hands[..., 0] + np.sqrt(lack)
    return np.concatenate([forward[..., None], hands[..., 1:]], axis=-1)
