"""The drills of Kehl (2006), section 7, by three people each, as recipes: what the experiments of its figures are measured on.

The paper has one recording of each, of one person. Three, of different build, heading and random numbers, let an interval say what holds
of more than one clip. Rooms, cameras and lengths are those of the shipped recipes: five cameras, 15 frames a second, as many frames as
the paper has.
"""

from __future__ import annotations

from dataclasses import replace

from hmc.synthetic.recipe import Recipe, load_recipe

__all__ = ["DRILLS", "clip_names", "drill_recipes", "slow_names", "training_name"]

#: Shipped recipes of the drills; each is the first clip of its drill.
DRILLS = ("kick_turn", "pedal_arms", "dance", "play_cube")
#: Who does them beside the shipped actor: suffix, stature (metres), sex, build, heading (degrees).
_OTHERS = (("tall", 1.88, "man", "sturdy", 75.0), ("small", 1.64, "woman", "slim", -50.0))
#: Of each drill a clip apart, on which numbers that the paper does not print may be chosen.
_TRAINING = ("training", 1.74, "man", "average", 140.0)


def clip_names(drill: str) -> tuple[str, ...]:
    """Recipes of a drill, the shipped one first."""
    return (drill, *(f"{drill}_{suffix}" for suffix, *_ in _OTHERS))


def training_name(drill: str) -> str:
    """The recipe of a drill that is among no experiment's clips."""
    return f"{drill}_{_TRAINING[0]}"


def slow_names(drill: str) -> tuple[str, ...]:
    """Recipes of a drill of which half is done in as many frames, twice as many a second: people move half as far from one to the next."""
    return tuple(f"{name}_slow" for name in clip_names(drill))


def drill_recipes() -> list[Recipe]:
    """Every drill by those who are not in the shipped recipe, the clip to train on last, and the slow ones by all but who trains."""
    recipes = []
    for drill in DRILLS:
        base, others = load_recipe(drill), []
        for number, (suffix, height_m, sex, build, heading) in enumerate((*_OTHERS, _TRAINING), start=1):
            who = replace(base.actors[0], height_m=height_m, sex=sex, build=build, heading_deg=heading)
            others.append(replace(base, name=f"{drill}_{suffix}", seed=base.seed + 100 * number, actors=(who,)))
        recipes += [*others, *map(_slow, (base, *others[:-1]))]
    return recipes


def _slow(recipe: Recipe) -> Recipe:
    return replace(recipe, name=f"{recipe.name}_slow", fps=2 * recipe.fps, seconds=recipe.seconds / 2)
