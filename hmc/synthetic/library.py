"""Motions by the names that recipes use."""

from __future__ import annotations

import numpy as np

from hmc.synthetic.actions import box, gesture, lunge, pick_up, sit, stand, throw_catch
from hmc.synthetic.bvh import bvh_motion, read_bvh
from hmc.synthetic.drills import dance, kick_turn, pedal_arms, play_cube
from hmc.synthetic.everyday import behind_back, close_door, jump, lift_and_drop, push_case, struggle, throw_item, wave
from hmc.synthetic.gait import jog, walk
from hmc.synthetic.ground import lie, push_ups, sit_ups
from hmc.synthetic.motions import Motion, place
from hmc.synthetic.recipe import ActorRecipe, FurnitureRecipe
from hmc.synthetic.script import script_motion
from hmc.synthetic.skeleton import Skeleton

__all__ = ["make_motion"]

_ACTIONS = {
    "stand": stand, "box": box, "gesture": gesture, "throw_catch": throw_catch, "sit": sit, "pick_up": pick_up, "kick_turn": kick_turn,
    "pedal_arms": pedal_arms, "dance": dance, "play_cube": play_cube,
    "wave": wave, "throw_item": throw_item, "struggle": struggle, "close_door": close_door, "push_case": push_case,
    "lift_and_drop": lift_and_drop, "jump": jump, "behind_back": behind_back,
    "push_ups": push_ups, "sit_ups": sit_ups, "lie": lie, "lunge": lunge,
}  # fmt: skip


def make_motion(
    actor: ActorRecipe, skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator, furniture: tuple[FurnitureRecipe, ...] = ()
) -> Motion:
    """The motion that a recipe asks for, in the world.

    Parameters
    ----------
    actor : ActorRecipe
    skeleton : Skeleton
    times : ndarray, shape (n,)
        Seconds.
    rng : Generator
    furniture : tuple of FurnitureRecipe
        On which the actor of a script may sit.

    Returns
    -------
    Motion

    Raises
    ------
    InputError
        When a motion file is missing or cannot be read, or a script does not fit its times.
    """
    if actor.motion == "script":
        return script_motion(actor, skeleton, times, rng, furniture)
    if actor.motion == "bvh":
        motion = bvh_motion(read_bvh(actor.bvh), skeleton, times, actor.bvh_start_s)
    elif actor.motion in _ACTIONS:
        motion = _ACTIONS[actor.motion](skeleton, times, rng)
    else:
        gait, speed = {"walk": (walk, 1.25), "jog": (jog, 2.2)}[actor.motion]
        motion = gait(skeleton, times, rng, actor.speed_m_s or speed, actor.turn_radius_m)
    return place(motion, actor.start_m, actor.heading_deg)
