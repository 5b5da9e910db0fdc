"""Motions by the names that recipes use."""

from __future__ import annotations

import numpy as np

from hmc.synthetic.gait import jog, walk
from hmc.synthetic.motions import Motion, place
from hmc.synthetic.recipe import ActorRecipe
from hmc.synthetic.skeleton import Skeleton

__all__ = ["make_motion"]


def make_motion(actor: ActorRecipe, skeleton: Skeleton, times: np.ndarray, rng: np.random.Generator) -> Motion:
    """The motion that a recipe asks for, in the world."""
    if actor.motion in ("walk", "jog"):
        gait, speed = {"walk": (walk, 1.25), "jog": (jog, 2.2)}[actor.motion]
        motion = gait(skeleton, times, rng, actor.speed_m_s or speed, actor.turn_radius_m)
    return place(motion, actor.start_m, actor.heading_deg)
