"""Nine actions like the sequences s1 to s9 of Hsiao (2008), chapter 4, as recipes: eight cameras, images of 320 x 240.

The thesis renders built-in actions of a game; these are motions of our own, done over and over where the thesis's sequence is longer, in
as many frames as its table has, at 30 a second as there. The cameras of s1 and s2 stand in a ring of eight (Figure 3-5),
those of the others in a ring of seven with one overhead (Figure 4-1).
"""

from __future__ import annotations

from dataclasses import replace

from hmc.synthetic.recipe import ActorRecipe, ImageRecipe, LightRecipe, Recipe, RoomRecipe
from hmc.synthetic.rigs import RigRecipe

__all__ = ["NINE_ACTIONS", "nine_recipes"]

#: Name of each sequence, what it shows, its motion, its rig, and how many frames the thesis's has.
NINE_ACTIONS: dict[str, tuple[str, str, str, int]] = {
    "s1_wave": ("waves", "wave", "ring8", 38),
    "s2_throw_ball": ("throws a ball", "throw_catch", "ring8", 168),
    "s3_throw_item": ("throws an item", "throw_item", "ring7_overhead", 400),
    "s4_struggle": ("struggles", "struggle", "ring7_overhead", 190),
    "s5_sit": ("sits down and gets up", "sit", "ring7_overhead", 170),
    "s6_close_door": ("looks out and closes a door", "close_door", "ring7_overhead", 780),
    "s7_push_case": ("pushes a case", "push_case", "ring7_overhead", 645),
    "s8_walk": ("walks", "walk", "ring7_overhead", 305),
    "s9_lift_drop": ("lifts something and throws it down", "lift_and_drop", "ring7_overhead", 1110),
}
FPS = 30.0
#: The quick mode's recordings are shorter and have fewer frames a second.
QUICK_SUFFIX, QUICK_SECONDS, QUICK_FPS = "_quick", 3.0, 15.0
_SIZE_PX = (320, 240)
#: Who acts: light skin, and shirt and trousers that head and legs differ from.
_ACTOR = ActorRecipe(
    height_m=1.78,
    build="average",
    shirt=(0.20, 0.36, 0.22),
    trousers=(0.22, 0.22, 0.30),
    skin=(0.84, 0.64, 0.52),
    hair=(0.30, 0.20, 0.12),
)


def nine_recipes() -> list[Recipe]:
    """Every sequence, in full and quick."""
    recipes = []
    for number, (name, (_, motion, rig, frames)) in enumerate(NINE_ACTIONS.items()):
        start = (-0.9, -0.1) if motion == "walk" else (0.0, 0.0)
        actor = replace(
            _ACTOR, motion=motion, start_m=start, heading_deg=10.0 + 37.0 * number, turn_radius_m=0.9 if motion == "walk" else 0.0
        )
        full = Recipe(
            name,
            seed=300 + number,
            fps=FPS,
            seconds=frames / FPS,
            background_frames=20,
            cell_m=0.02,
            rig=RigRecipe(rig, size_px=_SIZE_PX, target_height_m=1.0),
            room=RoomRecipe(size_m=(5.6, 5.2, 3.2)),
            light=LightRecipe(),
            image=ImageRecipe(),
            actors=(actor,),
        )
        quick = replace(full, name=name + QUICK_SUFFIX, seconds=QUICK_SECONDS, fps=QUICK_FPS, background_frames=10, cell_m=0.025)
        recipes += [full, quick]
    return recipes
