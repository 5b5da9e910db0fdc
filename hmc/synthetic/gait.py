"""Walking and jogging: planted feet that roll from heel to toe, a pelvis that the legs carry, arms that swing against them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hmc.synthetic.motions import Feet, Motion, Upper, arms_by_angles, assemble, keyframes, pelvis_height, roll_foot
from hmc.synthetic.skeleton import Skeleton

__all__ = ["jog", "walk", "walk_along"]

#: Place (..., 2), metres, and heading (...), radians, after a distance (...) along the way; it goes on before its start and after its end.
Way = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class _Gait:
    """How a person walks or runs.

    Parameters
    ----------
    speed_m_s : float
        To which swing and bend of the arms fit.
    stride_m : float
        Length of two steps.
    stance : float
        Share of a cycle for which a foot bears weight.
    bounce_m : float
        How far the pelvis of a runner goes up and down about its middle; 0 walks.
    """

    speed_m_s: float
    stride_m: float
    stance: float = 0.62
    bounce_m: float = 0.0

    @property
    def running(self) -> bool:
        """Whether there is a phase of flight."""
        return self.bounce_m > 0


def walk(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator, speed_m_s: float = 1.25, turn_radius_m: float = 0.0) -> Motion:
    """Walk straight ahead, or on a circle.

    Parameters
    ----------
    skeleton : Skeleton
    times : ndarray, shape (n,)
        Seconds.
    rng : Generator
        Varies stride, swing and posture.
    speed_m_s : float
        0.4 to 2.2.
    turn_radius_m : float
        Radius of the circle, to the left if positive, to the right if negative; 0 walks straight.

    Returns
    -------
    Motion
        From the origin, facing X.
    """
    stride = skeleton.height_m * (0.50 + 0.215 * speed_m_s) * rng.normal(1, 0.02)
    way = functools.partial(_path, radius=turn_radius_m)
    return _motion(skeleton, times, rng, speed_m_s * times, way, _Gait(speed_m_s, stride))


def jog(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator, speed_m_s: float = 2.2, turn_radius_m: float = 0.0) -> Motion:
    """Jog, with a phase of flight; arguments as for `walk`."""
    stride = skeleton.height_m * (0.50 + 0.30 * speed_m_s) * rng.normal(1, 0.02)
    way = functools.partial(_path, radius=turn_radius_m)
    return _motion(skeleton, times, rng, speed_m_s * times, way, _Gait(speed_m_s, stride, stance=0.38, bounce_m=0.03))


def walk_along(
    skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator, distance: np.ndarray, way: Way, speed_m_s: float, stride_m: float = 0.0
) -> Motion:
    """Walk on any way at any pace.

    Parameters
    ----------
    skeleton : Skeleton
    times : ndarray, shape (n,)
        Seconds.
    rng : Generator
    distance : ndarray, shape (n,)
        Gone at each time, metres; never falling.
    way : callable
        ``way(distance) -> (place, heading)``, (n, 2) and (n,).
    speed_m_s : float
        To which swing and stride fit.
    stride_m : float
        Length of two steps; 0 takes the walk's own.

    Returns
    -------
    Motion
        In the coordinates of the way.
    """
    stride = stride_m or skeleton.height_m * (0.50 + 0.215 * speed_m_s) * rng.normal(1, 0.02)
    return _motion(skeleton, times, rng, distance, way, _Gait(speed_m_s, stride))


def _path(distance: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Place (..., 2) and heading (...) after a distance along a line or circle that starts at the origin along X."""
    if radius == 0:
        return np.stack([distance, np.zeros_like(distance)], axis=-1), np.zeros_like(distance)
    heading = distance / radius
    return radius * np.stack([np.sin(heading), 1 - np.cos(heading)], axis=-1), heading


def _motion(skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator, distance: np.ndarray, way: Way, gait: _Gait) -> Motion:
    running, stride = gait.running, gait.stride_m
    phase = rng.uniform(0, 1)
    cycles = distance / stride + phase  # of the left foot; the right is half a cycle later
    origin = phase * stride
    feet = _feet(skeleton, cycles, way, origin, gait)
    rocking = np.sin(2 * np.pi * cycles)
    twist = np.cos(2 * np.pi * cycles)
    middle, heading = way(cycles * stride - origin)
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    middle = middle + 0.016 * rocking[:, None] * left
    zero = np.zeros_like(times)
    lean = (0.12 if running else 0.03) + rng.normal(0, 0.015)
    yaw_size = np.radians(rng.uniform(4, 6))
    pelvis_yaw = heading - yaw_size * twist
    fps = 1 / np.median(np.diff(times)) if len(times) > 1 else 25.0
    if running:
        # Lowest in the middle of each stance, highest in flight.
        base = skeleton.hip_height - 0.035 * skeleton.height_m / 1.75
        height = base - gait.bounce_m * np.cos(4 * np.pi * (cycles - gait.stance / 2))
    else:
        height = pelvis_height(skeleton, middle, pelvis_yaw, feet, slack=0.995, smooth=0.025 * fps) - 0.002
        # Knees give way a little in the middle of stance, so that the pelvis rises less than straight legs would lift it.
        height = height.min() + 0.8 * (height - height.min())
    upper = Upper(
        pelvis=np.stack([0.045 * rocking, lean * 0.5 + zero, pelvis_yaw], axis=-1),
        abdomen=np.stack([-0.03 * rocking, lean * 0.5 + zero, yaw_size * twist], axis=-1),
        chest=np.stack([-0.02 * rocking, zero + 0.02, 1.1 * yaw_size * twist], axis=-1),
        neck=np.stack([zero, zero + 0.05, -0.5 * yaw_size * twist], axis=-1),
        head=np.stack([zero, zero - 0.05 - lean * 0.7, -0.5 * yaw_size * twist], axis=-1),
    )
    size = np.radians(rng.uniform(19, 26) * (1.5 if running else 0.6 + 0.35 * gait.speed_m_s))
    swing_left, swing_right = -size * np.cos(2 * np.pi * (cycles - 0.05)), size * np.cos(2 * np.pi * (cycles - 0.05))
    swing = np.stack([swing_left, swing_right], axis=-1) + (-0.08 if running else 0.03)
    bend = np.radians(85 if running else 14 + 6 * gait.speed_m_s)
    flex = bend + 0.35 * np.clip(swing, -0.5, 1.0)
    out = np.full_like(swing, np.radians(rng.uniform(8, 12)))
    root = np.column_stack([middle, height])
    return assemble(skeleton, root, upper, feet, arms_by_angles(swing, flex, out))


# Pitch of the foot over its cycle, degrees, toes up positive: heel strike, flat, heel off, toe off, swing.
_WALK_PITCH = ((0.0, 18), (0.08, 3), (0.13, 0), (0.36, 0), (0.50, -18), (0.62, -58), (0.70, -48), (0.82, -5), (0.93, 18), (1.0, 18))
_RUN_PITCH = ((0.0, 6), (0.05, 0), (0.16, 0), (0.28, -20), (0.38, -60), (0.52, -80), (0.75, -20), (0.92, 6), (1.0, 6))


def _feet(skeleton: Skeleton, cycles: np.ndarray, way: Way, origin: float, gait: _Gait) -> Feet:
    """Feet that stay where they are put while they bear weight, and swing on to the next footprint.

    The way begins `origin` metres after the first cycle did.
    """
    running, stance = gait.running, gait.stance
    width = skeleton.height_m * (0.025 if running else 0.045)
    curve = np.array(_RUN_PITCH if running else _WALK_PITCH, float)
    n = len(cycles)
    ankles, yaw, pitch, toe = np.zeros((n, 2, 3)), np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 2))
    for s, offset in enumerate((0.0, 0.5)):
        phase = cycles - offset
        step = np.floor(phase)
        phase = phase - step
        angle = np.radians(keyframes(phase, curve[:, 0], curve[:, 1]))

        def print_of(k: np.ndarray, s: int = s, offset: float = offset) -> tuple[np.ndarray, np.ndarray]:
            # The body passes over the foot a little before the middle of stance.
            centre, heading = way((k + offset + 0.40 * stance) * gait.stride_m - origin)
            side = (1 - 2 * s) * width
            return centre + side * np.stack([-np.sin(heading), np.cos(heading)], axis=-1), heading + (1 - 2 * s) * np.radians(5)

        here, yaw_here = print_of(step)
        there, yaw_there = print_of(step + 1)

        def ankle(flat: np.ndarray, heading: np.ndarray, tilt: np.ndarray) -> np.ndarray:
            forward, height = roll_foot(skeleton, tilt)
            place = flat + forward[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
            return np.column_stack([place, height])

        off = np.radians(np.interp(stance, curve[:, 0], curve[:, 1])) * np.ones(n)
        strike = np.radians(curve[0, 1]) * np.ones(n)
        bearing = phase < stance
        u = np.clip((phase - stance) / (1 - stance), 0, 1)
        ease = u * u * u * (u * (6 * u - 15) + 10) * 0.5 + u * u * (3 - 2 * u) * 0.5
        swing = (1 - ease)[:, None] * ankle(here, yaw_here, off) + ease[:, None] * ankle(there, yaw_there, strike)
        lift = (0.16 if running else 0.025) * skeleton.height_m / 1.75
        swing[:, 2] += lift * np.sin(np.pi * u) ** 2 + (0.06 if running else 0.035) * np.sin(np.pi * np.clip(u * 1.6, 0, 1)) ** 2
        ankles[:, s] = np.where(bearing[:, None], ankle(here, yaw_here, angle), swing)
        yaw[:, s] = np.where(bearing, yaw_here, (1 - ease) * yaw_here + ease * yaw_there)
        pitch[:, s] = angle
        # On the floor the toes lie flat while the heel rises; in the air they follow the foot.
        toe[:, s] = np.where(angle < 0, np.where(bearing, 0.0, angle * np.clip(1.5 * u, 0, 1)), angle)
    return Feet(ankles, yaw, pitch, toe)
