"""The five actions of HumanEva-I, each by two actors of different build, as recipes: what chapter 6 of Canton (2009) is measured on.

HumanEva-I is not public. The rooms, lamps and motions are those of the shipped recipes; the cameras are seven in a ring, as there.
"""

from __future__ import annotations

import re
from dataclasses import replace

from hmc.synthetic.recipe import ActorRecipe, Recipe, load_recipe
from hmc.synthetic.rigs import RigRecipe

__all__ = ["ACTIONS", "ACTORS", "LONG_SUFFIX", "action_name", "action_of", "action_recipe", "action_recipes", "action_title"]

#: Actions, what the thesis calls them, and the shipped recipes that they come from.
ACTIONS = {
    "walk": ("Walking", "demo"),
    "jog": ("Jog", "jog"),
    "throw_catch": ("Throw/Catch", "throw_catch"),
    "gesture": ("Gesture", "gesture"),
    "box": ("Box", "box"),
}
#: The actions as files of HumanEva-I bear them; a recording of it is called S1_Walking_1.
HUMANEVA = {"Walking": "walk", "Jog": "jog", "ThrowCatch": "throw_catch", "Gestures": "gesture", "Box": "box"}
#: The actors.
ACTORS = {
    "man": ActorRecipe(
        height_m=1.86, build="sturdy", sex="man", shirt=(0.55, 0.20, 0.16), trousers=(0.16, 0.18, 0.26), pattern="stripes",
        pattern_color=(0.30, 0.10, 0.10),
    ),
    "woman": ActorRecipe(
        height_m=1.60, build="slim", sex="woman", shirt=(0.16, 0.40, 0.46), trousers=(0.20, 0.20, 0.22), hair=(0.30, 0.20, 0.10),
        long_hair=True, sleeves="long",
    ),
}  # fmt: skip
#: Length and rate in full: the thesis says 30 frames a second of its cameras (section 6.6.1); HumanEva-I was released with 60.
SECONDS, FPS = 10.0, 30.0
#: The quick mode's recordings: smaller images and fewer of them.
QUICK_SUFFIX, QUICK_SECONDS, QUICK_FPS, QUICK_SIZE_PX = "_quick", 1.6, 20.0, (320, 240)
#: The same, long enough to be lost in it and found again.
LONG_SUFFIX, LONG_SECONDS = "_quick_long", 4.5


def action_name(action: str, actor: str, quick: bool) -> str:
    """The name of a recipe."""
    return f"{action}_{actor}{QUICK_SUFFIX if quick else ''}"


def action_of(source: str) -> str:
    """The key in `ACTIONS` of a rendered recording's action; empty where the recording is no such."""
    name = source.rpartition("@")[0].removesuffix(LONG_SUFFIX).removesuffix(QUICK_SUFFIX)
    action, _, actor = name.rpartition("_")
    return action if actor in ACTORS and action in ACTIONS else ""


def action_title(source: str) -> str:
    """What the thesis calls the action of a rendered recording or of one of HumanEva-I; else the recording's own name."""
    name = source.rpartition("@")[0]
    dataset = re.fullmatch(r"S\d+_([A-Za-z]+)_\d+", name)
    action = HUMANEVA.get(dataset[1], "") if dataset else action_of(source)
    return ACTIONS[action][0] if action else name


def action_recipe(action: str) -> Recipe:
    """The shipped recipe of an action, by its own actor, with the cameras of all."""
    return replace(load_recipe(ACTIONS[action][1]), rig=RigRecipe("ring7"), seconds=SECONDS, fps=FPS)


def action_recipes() -> list[Recipe]:
    """Every action by every actor, in full, quick, and quick but longer."""
    recipes = []
    for action in ACTIONS:
        base = action_recipe(action)
        moving = base.actors[0]
        for number, (actor, look) in enumerate(ACTORS.items()):
            who = replace(
                look, motion=moving.motion, start_m=moving.start_m, heading_deg=moving.heading_deg, speed_m_s=moving.speed_m_s,
                turn_radius_m=moving.turn_radius_m,
            )  # fmt: skip
            recipe = replace(base, name=action_name(action, actor, False), seed=base.seed + 100 * number, actors=(who,))
            quick = replace(
                recipe, name=action_name(action, actor, True), seconds=QUICK_SECONDS, fps=QUICK_FPS, background_frames=10, cell_m=0.025,
                rig=RigRecipe("ring7", size_px=QUICK_SIZE_PX),
            )  # fmt: skip
            recipes += [recipe, quick, replace(quick, name=action_name(action, actor, False) + LONG_SUFFIX, seconds=LONG_SECONDS)]
    return recipes
