"""A rendered world: actors, motions, rooms and cameras, written as recordings with exact truth."""

from hmc.synthetic.actor import PARTS, Actor, make_actor, pose_mesh
from hmc.synthetic.clothes import Clothes
from hmc.synthetic.recipe import Recipe, load_recipe
from hmc.synthetic.render import render_recording

__all__ = ["PARTS", "Actor", "Clothes", "Recipe", "load_recipe", "make_actor", "pose_mesh", "render_recording"]
