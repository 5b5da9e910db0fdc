"""Somebody who stands in the middle of the small clip's rig, as skin."""

from methods import tiny_clip

from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.pose.part_colors import patch_sides, skin_of

RIG = tiny_clip(1).rig
BODY = default_body(1.75)
SKIN = skin_of(BODY)
STATE = neutral_state("down")
STATE[:3] = 0.0, 0.0, 0.95
SIDES = patch_sides(RIG, STATE[:3])
