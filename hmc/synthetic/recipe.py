"""Recipes: what to render, as TOML with a unit in every key."""

from __future__ import annotations

import difflib
import re
from dataclasses import MISSING, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

from hmc.errors import InputError
from hmc.io.door import read_toml_file
from hmc.io.shipped import shipped_folder
from hmc.synthetic.clothes import PATTERNS
from hmc.synthetic.physique import girth_of
from hmc.synthetic.rigs import RIGS, RigRecipe
from hmc.synthetic.room import FURNITURE
from hmc.synthetic.textures import TEXTURES
from hmc.synthetic.varied import varied_recipe

__all__ = [
    "ActorRecipe",
    "FurnitureRecipe",
    "ImageRecipe",
    "LightRecipe",
    "Recipe",
    "RoomRecipe",
    "StepRecipe",
    "check_recipe",
    "load_recipe",
    "shipped_recipes",
]

Color = tuple[float, float, float]

MOTIONS = (
    "walk", "jog", "stand", "box", "gesture", "throw_catch", "sit", "pick_up", "kick_turn", "pedal_arms", "dance", "play_cube", "wave",
    "throw_item", "struggle", "close_door", "push_case", "lift_and_drop", "jump", "behind_back", "push_ups", "sit_ups", "lie", "lunge",
    "bvh", "script",
)  # fmt: skip
#: What a step of a script may be.
STEPS = ("walk", "turn", "stand", "gesture", "box", "throw_catch", "pick_up", "hug", "sit")
#: Names of recipes that are drawn at random, with their seed.
VARIED = re.compile(r"varied-(\d{1,9})")
#: So many people can be told apart in silhouettes, by 85 or 51 x (person + 1).
MOST_ACTORS = 5
#: No room, and nothing in it, is longer (metres), and no more posters hang on its walls: the floor and the walls are drawn in small cells.
MOST_SIDE_M, MOST_POSTERS = 60.0, 60
#: Longest side of a rendered image.
MOST_PX = 8192


@dataclass(frozen=True)
class RoomRecipe:
    """Walls and floor; colors are sRGB in [0, 1]. One texture or color serves all four walls, or there are four.

    A door is a wall (0 x low, 1 x high, 2 y low, 3 y high) and the place of its middle along it, metres: a dark opening through which the
    actors of scripts come and go. `gloss` is the share of what a pixel of the floor shows that is the mirror image of a person.
    """

    size_m: tuple[float, float, float] = (6.4, 5.6, 3.2)
    walls: tuple[str, ...] = ("plaster",)
    wall_colors: tuple[Color, ...] = ((0.72, 0.74, 0.70),)
    floor: str = "tiles"
    floor_color: Color = (0.60, 0.58, 0.56)
    posters: int = 5
    gloss: float = 0.0
    doors: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True)
class LightRecipe:
    """Lamps on the ceiling; `dimmed` is the first one's light in the action as a share of that in the empty scene."""

    lamps: int = 3
    brightness: float = 1.0
    ambient: float = 0.26
    dimmed: float = 1.0


@dataclass(frozen=True)
class ImageRecipe:
    """The sensor: noise in grey levels (of 255) at black, what the light adds at white, and the flicker of the gain (a fraction).

    `exposure` is the light in the action as a share of that in the empty scene. With `auto_exposure` 1 a camera keeps the mean brightness
    of its images as it was in the empty scene, whoever comes in; with 0 it does not care.
    """

    read_noise: float = 1.8
    shot_noise: float = 2.2
    flicker: float = 0.004
    exposure: float = 1.0
    auto_exposure: float = 0.0


@dataclass(frozen=True)
class FurnitureRecipe:
    """One piece of furniture; see `hmc.synthetic.room.furnish`.

    Each of its `moves` is (from second, to second, x, y): it slides to a new place, metres.
    """

    kind: str
    at_m: tuple[float, float]
    heading_deg: float = 0.0
    size_m: tuple[float, float, float] | None = None
    color: Color = (0.55, 0.42, 0.30)
    texture: str = "wood"
    moves: tuple[tuple[float, float, float, float], ...] = ()


@dataclass(frozen=True)
class StepRecipe:
    """One step of a script.

    Parameters
    ----------
    do : str
        One of `STEPS`.
    to_m : tuple of (x, y)
        Of a walk: where to, past which points. A person about to sit down on a chair may be led to it.
    speed_m_s : float
        Of walking; 0 takes 1.2.
    to_deg : float
        Of a turn: where to face.
    seconds : float
        How long it takes; walks and turns take what they need.
    until_s : float
        In place of `seconds`: the time in the clip at which it ends.
    chair : int
        To sit on: the number of the piece of furniture, counted from 1; 0 sits down on the spot.
    seat_m : float
        Height of the seat, metres; without a chair and near the floor, the person crouches.
    """

    do: str
    to_m: tuple[tuple[float, float], ...] = ()
    speed_m_s: float = 0.0
    to_deg: float = 0.0
    seconds: float = 0.0
    until_s: float = 0.0
    chair: int = 0
    seat_m: float = 0.45


@dataclass(frozen=True)
class ActorRecipe:
    """One person: body, clothes and motion.

    Parameters
    ----------
    height_m : float
        Stature.
    build : str or float
        thin, slim, average, sturdy, heavy, or a number from -1 to 1.
    sex : {"man", "woman"}
    shirt, trousers, skin, hair, shoes, pattern_color : tuple of float
        sRGB in [0, 1].
    pattern : {"plain", "stripes", "checks", "dots"}
        Of the shirt.
    sleeves, legs : {"long", "short"}
    long_hair : bool
    hands : {"open", "fists"}
    longer_left : (arm, leg)
        By how much of its length the left arm, and the left leg, is longer than the right one.
    loose_m : float
        How far clothes stand off the body, metres.
    cube_m : float
        Side of a cube in the right hand, metres; 0: none.
    cube_color : tuple of float
        sRGB in [0, 1].
    motion : str
        One of `MOTIONS`.
    start_m : (x, y)
        Place at the first frame, metres.
    heading_deg : float
        Where the person faces at the first frame, degrees from x towards y.
    speed_m_s : float
        Of walking and jogging; 0 takes 1.25 and 2.2.
    turn_radius_m : float
        Of the circle walked, to the left if positive, to the right if negative; 0 goes straight.
    bvh : str
        Motion file for ``motion = "bvh"``, relative to the recipe.
    bvh_start_s : float
        Where in the file the clip begins.
    script : tuple of StepRecipe
        For ``motion = "script"``: what the person does, one action after another.
    """

    height_m: float = 1.75
    build: str | float = "average"
    sex: str = "man"
    shirt: Color = (0.16, 0.32, 0.55)
    trousers: Color = (0.25, 0.24, 0.22)
    skin: Color = (0.82, 0.62, 0.50)
    hair: Color = (0.22, 0.15, 0.10)
    shoes: Color = (0.10, 0.10, 0.11)
    pattern: str = "plain"
    pattern_color: Color = (0.85, 0.85, 0.80)
    sleeves: str = "short"
    legs: str = "long"
    long_hair: bool = False
    hands: str = "open"
    longer_left: tuple[float, float] = (0.0, 0.0)
    loose_m: float = 0.007
    cube_m: float = 0.0
    cube_color: Color = (0.15, 0.55, 0.20)
    motion: str = "walk"
    start_m: tuple[float, float] = (0.0, 0.0)
    heading_deg: float = 0.0
    speed_m_s: float = 0.0
    turn_radius_m: float = 0.0
    bvh: str = ""
    bvh_start_s: float = 0.0
    script: tuple[StepRecipe, ...] = ()


@dataclass(frozen=True)
class Recipe:
    """All that a rendered recording depends on.

    Parameters
    ----------
    name : str
    seed : int
    fps, seconds : float
    background_frames : int
        Frames of the empty room before the action, a camera.
    silhouette_every : int
        True silhouettes are written for every frame number that this divides.
    cell_m : float
        Edge length of the actors' meshes.
    rig, room, light, image : tables of their own
    furniture, actors : tuples of tables
    """

    name: str
    seed: int = 0
    fps: float = 30.0
    seconds: float = 4.0
    background_frames: int = 30
    silhouette_every: int = 30
    cell_m: float = 0.016
    rig: RigRecipe = field(default_factory=RigRecipe)
    room: RoomRecipe = RoomRecipe()
    light: LightRecipe = LightRecipe()
    image: ImageRecipe = ImageRecipe()
    furniture: tuple[FurnitureRecipe, ...] = ()
    actors: tuple[ActorRecipe, ...] = (ActorRecipe(),)

    @property
    def n_frames(self) -> int:
        """Frames a camera."""
        return max(1, round(self.fps * self.seconds))


def shipped_recipes() -> list[str]:
    """Names of the recipes that come with the package."""
    return sorted(path.stem for path in shipped_folder().glob("*.toml"))


def load_recipe(source: str | Path) -> Recipe:
    """Read a recipe from a file, by the name of a shipped one, or drawn at random: ``varied-`` and a seed (`hmc.synthetic.varied`).

    Raises
    ------
    InputError
        When there is no such recipe, when it is no TOML, or when a key or value is not one; the nearest key is named.
    """
    path = Path(source)
    if not path.is_file():
        drawn = VARIED.fullmatch(str(source))
        if drawn:
            return recipe_from(varied_recipe(int(drawn[1])), str(source))
        path = shipped_folder() / f"{source}.toml"
    if not path.is_file():
        near = difflib.get_close_matches(str(source), shipped_recipes(), 1)
        hint = (
            f"did you mean {near[0]!r}?"
            if near
            else f"shipped recipes are {', '.join(shipped_recipes()) or 'missing from this installation'}"
        )
        raise InputError(f"recipe {str(source)!r} is neither a file nor a shipped recipe; {hint}")
    recipe = recipe_from(read_toml_file(path), str(path))
    # Motion files are named relative to the recipe.
    actors = tuple(replace(a, bvh=str(path.parent / a.bvh)) if a.bvh and not Path(a.bvh).is_absolute() else a for a in recipe.actors)
    return replace(recipe, actors=actors)


def recipe_from(content: dict[str, Any], where: str = "recipe") -> Recipe:
    """A checked recipe from the dictionary of its TOML.

    Raises
    ------
    InputError
        As `load_recipe`.
    """
    content = dict(content)
    if "actor" in content:
        content["actors"] = content.pop("actor")
    nested = {"rig": RigRecipe, "room": RoomRecipe, "light": LightRecipe, "image": ImageRecipe}
    for key, kind in nested.items():
        if key in content:
            content[key] = _fill(kind, content[key], f"{where}: [{key}]")
    for key, kind in (("furniture", FurnitureRecipe), ("actors", ActorRecipe)):
        if key in content:
            label = key.removesuffix("s")
            if not isinstance(content[key], list):
                raise InputError(f"{where}: '{label}' must be tables, each under its own line [[{label}]]")
            content[key] = tuple(_fill(kind, item, f"{where}: [[{label}]] number {k + 1}") for k, item in enumerate(content[key]))
    recipe = _fill(Recipe, content, where)
    check_recipe(recipe, where)
    return recipe


def _fill(kind: type, table: Any, where: str) -> Any:
    """A dataclass from a TOML table, with every key and value checked."""
    if not isinstance(table, dict):
        raise InputError(f"{where}: must be a table")
    hints = get_type_hints(kind)
    for key in table:
        if key not in hints:
            near = difflib.get_close_matches("actor" if key == "actors" else key, [*hints, "actor"], 1, cutoff=0.4)
            raise InputError(
                f"{where}: unknown key '{key}'" + (f"; did you mean '{near[0]}'?" if near else f"; keys are {', '.join(hints)}")
            )
    for one in fields(kind):
        if one.default is MISSING and one.default_factory is MISSING and one.name not in table:
            raise InputError(f"{where}: '{one.name}' is missing")
    values = {}
    for key, value in table.items():
        if key == "script" and isinstance(value, list):
            value = tuple(_fill(StepRecipe, item, f"{where}: step {k + 1} of the script") for k, item in enumerate(value))
        value = _tuples(value)
        if not _fits(value, hints[key]):
            raise InputError(f"{where}: '{key}' has a value of the wrong kind: {value!r}")
        values[key] = value
    return kind(**values)


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value is of a kind: bool, int, float, str, a table, None, a union of kinds, or a tuple of them."""
    kinds = get_args(hint)
    if get_origin(hint) is tuple:
        if not isinstance(value, tuple):
            return False
        kinds = kinds[:1] * len(value) if kinds[-1] is Ellipsis else kinds
        return len(value) == len(kinds) and all(_fits(item, kind) for item, kind in zip(value, kinds, strict=True))
    if kinds:
        return any(_fits(value, kind) for kind in kinds)
    if isinstance(value, bool):
        return hint is bool
    return isinstance(value, (int, float) if hint is float else hint)


def check_recipe(recipe: Recipe, where: str) -> None:
    """Refuse values that make no sense together or alone.

    Raises
    ------
    InputError
        With `where`, what is wrong, and what may be.
    """

    def among(value: str, names, what: str) -> None:
        if value not in names:
            near = difflib.get_close_matches(value, list(names), 1)
            raise InputError(
                f"{where}: {what} '{value}' is unknown; " + (f"did you mean '{near[0]}'?" if near else f"use one of {', '.join(names)}")
            )

    def within(value: float, low: float, high: float, what: str) -> None:
        if not low <= value <= high:
            raise InputError(f"{where}: {what} must lie between {low} and {high}; got {value}")

    within(recipe.seed, 0, 2**63 - 1, "seed")
    within(recipe.fps, 1, 240, "fps")
    within(recipe.seconds, 0, 3600, "seconds")
    within(recipe.background_frames, 0, 10000, "background_frames")
    within(recipe.silhouette_every, 1, 10**6, "silhouette_every")
    within(recipe.cell_m, 0.008, 0.03, "cell_m")
    within(recipe.light.lamps, 1, 6, "lamps")
    for pixels in recipe.rig.size_px:
        within(pixels, 8, MOST_PX, "each side of the images, size_px,")
    within(recipe.rig.field_of_view_deg, 0, 150, "field_of_view_deg")
    for side in recipe.room.size_m:
        within(side, 1, MOST_SIDE_M, "each side of the room, size_m,")
    within(recipe.room.posters, 0, MOST_POSTERS, "posters")
    among(recipe.rig.kind, RIGS, "rig kind")
    for texture in (*recipe.room.walls, recipe.room.floor, *(item.texture for item in recipe.furniture)):
        among(texture, TEXTURES, "texture")
    for count in (len(recipe.room.walls), len(recipe.room.wall_colors)):
        if count not in (1, 4):
            raise InputError(f"{where}: [room] takes one wall texture and color or four of each; got {count}")
    for item in recipe.furniture:
        among(item.kind, FURNITURE, "furniture")
        for edge in item.size_m or ():
            within(edge, 0.01, MOST_SIDE_M, "each side of a piece of furniture, size_m,")
    for wall, _ in recipe.room.doors:
        within(wall, 0, 3, "the wall of a door")
    if len(recipe.actors) > MOST_ACTORS:
        raise InputError(f"{where}: at most {MOST_ACTORS} actors, so that silhouettes can be told apart; got {len(recipe.actors)}")
    for actor in recipe.actors:
        among(actor.motion, MOTIONS, "motion")
        among(actor.pattern, PATTERNS, "pattern")
        among(actor.sex, ("man", "woman"), "sex")
        among(actor.sleeves, ("long", "short"), "sleeves")
        among(actor.hands, ("open", "fists"), "hands")
        among(actor.legs, ("long", "short"), "legs")
        within(actor.height_m, 1.2, 2.2, "height_m")
        within(actor.loose_m, 0, 0.1, "loose_m")
        for share, limb in zip(actor.longer_left, ("arm", "leg"), strict=True):
            within(share, -0.2, 0.2, f"longer_left ({limb})")
        within(actor.cube_m, 0, 1, "cube_m")
        girth_of(actor.build)
        if (actor.motion == "bvh") != bool(actor.bvh):
            raise InputError(f"{where}: motion = 'bvh' and the key 'bvh' (a file) go together")
        if (actor.motion == "script") != bool(actor.script):
            raise InputError(f"{where}: motion = 'script' and the key 'script' (a list of steps) go together")
        for one in actor.script:
            among(one.do, STEPS, "step of a script")
            within(one.chair, 0, len(recipe.furniture), "chair, the number of a piece of furniture,")
            within(one.seconds, 0, 3600, "seconds of a step")
            if one.do == "walk" and not one.to_m:
                raise InputError(f"{where}: a step that walks needs 'to_m', a list of places [[x, y], ...]")
            if one.do not in ("walk", "turn") and not one.seconds and not one.until_s:
                raise InputError(f"{where}: the step '{one.do}' needs 'seconds' or 'until_s'")
