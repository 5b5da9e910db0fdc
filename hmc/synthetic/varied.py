"""Recipes drawn at random: rooms, lamps, cameras, people, clothes and motions that nobody chose.

A recipe that somebody writes shows what they thought of. These are drawn from a seed, so that what is learnt from some of them can be tried
on others that nobody has looked at. Half of all clothes have nearly the color of the floor or of a wall, brighter or darker, as these are
what silhouettes are lost on.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hmc.synthetic.rigs import RIGS

__all__ = ["varied_recipe"]

#: Motions that stay near where they begin.
MOTIONS = (
    "stand", "box", "gesture", "throw_catch", "sit", "pick_up", "kick_turn", "pedal_arms", "dance", "wave", "throw_item", "struggle",
    "close_door", "push_case", "lift_and_drop", "walk", "jog",
)  # fmt: skip
WALLS = ("plain", "plaster", "wallpaper", "brick", "tiles")
FLOORS = ("plain", "carpet", "wood", "tiles")
BUILDS = ("thin", "slim", "average", "sturdy", "heavy")
PATTERNS = ("plain", "plain", "plain", "stripes", "checks", "dots")
#: Share of the garments that have a color of the room, the light by which they differ from it, and how far each channel may be off.
ALIKE, ALIKE_LIGHT, ALIKE_OFF = 0.5, (0.45, 1.25), 0.03
#: People are so far from the middle of the room at most and from one another at least, and go round in circles of this radius, metres.
AROUND_M, APART_M, CIRCLE_M = 1.0, 0.8, 0.9
#: Furniture stands so far from the walls and from where people are at least, middle to middle, metres.
WALL_M, CLEAR_M = 0.6, 1.7

Color = list[float]


def varied_recipe(seed: int) -> dict[str, Any]:
    """A recipe that follows from a seed alone, as its TOML would give it (`hmc.synthetic.recipe.recipe_from`).

    One to three people for three and a half seconds at 25 frames a second; true silhouettes of every tenth frame.

    Parameters
    ----------
    seed : int
    """
    rng = np.random.default_rng([seed, 0x7A51ED])
    walls = [_color(rng) for _ in range(4)] if rng.random() < 0.4 else [_color(rng)]
    floor = _color(rng)
    size_m = np.round(rng.uniform((5.0, 4.6, 2.7), (7.0, 6.2, 3.4)), 2)
    room = {
        "size_m": size_m.tolist(),
        "walls": [str(wall) for wall in rng.choice(WALLS, 4)] if rng.random() < 0.4 else [str(rng.choice(WALLS))],
        "wall_colors": walls,
        "floor": str(rng.choice(FLOORS)),
        "floor_color": floor,
        "posters": int(rng.integers(0, 5)),
        "gloss": float(rng.choice([0.0, 0.0, 0.08, 0.15])),
    }
    places = _places(rng, int(rng.choice([1, 1, 1, 2, 3])))
    return {
        "name": f"varied-{seed}",
        "seed": seed,
        "fps": 25,
        "seconds": 3.6,
        "silhouette_every": 10,
        "rig": {
            "kind": str(rng.choice(list(RIGS))),
            "distorted": bool(rng.random() < 0.5),
            "camera_height_m": _between(rng, 1.7, 2.5),
            "target_height_m": _between(rng, 0.9, 1.1),
        },
        "room": room,
        "light": {
            "lamps": int(rng.integers(1, 5)),
            "brightness": _between(rng, 0.75, 1.25),
            "ambient": _between(rng, 0.2, 0.4),
            "dimmed": float(rng.choice([1.0, 1.0, 0.9])),
        },
        "image": {
            "read_noise": _between(rng, 1.0, 2.8),
            "shot_noise": _between(rng, 1.2, 2.6),
            "flicker": _between(rng, 0.0, 0.01),
            "exposure": float(rng.choice([1.0, 1.0, 0.96])),
            "auto_exposure": float(rng.choice([0.0, 0.0, 0.6])),
        },
        "actor": [_actor(rng, place, [floor, *walls]) for place in places],
        "furniture": _furniture(rng, size_m[:2], places),
    }


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return round(float(rng.uniform(low, high)), 3)


def _color(rng: np.random.Generator, grey: float = 0.6) -> Color:
    """A color as rooms have it: more grey than not."""
    light = rng.uniform(0.2, 0.9)
    tint = rng.normal(0, 0.12, 3) * (rng.random() > grey) + rng.normal(0, 0.03, 3)
    return [round(float(value), 3) for value in np.clip(light + tint - tint.mean(), 0.05, 0.95)]


def _garment(rng: np.random.Generator, room: list[Color]) -> Color:
    if rng.random() < ALIKE:
        like = np.array(room[rng.integers(len(room))]) * rng.uniform(*ALIKE_LIGHT) + rng.normal(0, ALIKE_OFF, 3)
        return [round(float(value), 3) for value in np.clip(like, 0.04, 0.95)]
    return [round(float(value), 3) for value in rng.uniform(0.06, 0.9, 3)]


def _places(rng: np.random.Generator, n: int) -> list[np.ndarray]:
    places: list[np.ndarray] = []
    while len(places) < n:
        place = rng.uniform(-AROUND_M, AROUND_M, 2)
        if all(np.hypot(*(place - other)) > APART_M for other in places):
            places.append(place)
    return places


def _furniture(rng: np.random.Generator, size_m: np.ndarray, people: list[np.ndarray]) -> list[dict[str, Any]]:
    """Up to two pieces, out of the way of the people."""
    pieces = []
    for _ in range(int(rng.choice([0, 0, 1, 2]))):
        place = rng.uniform(-size_m / 2 + WALL_M, size_m / 2 - WALL_M)
        kind, heading, color = str(rng.choice(["table", "chair", "box", "stool"])), float(rng.integers(-180, 180)), _color(rng)
        if all(np.hypot(*(place - person)) > CLEAR_M for person in people):
            pieces.append({"kind": kind, "at_m": [round(float(value), 2) for value in place], "heading_deg": heading, "color": color})
    return pieces


def _actor(rng: np.random.Generator, place: np.ndarray, room: list[Color]) -> dict[str, Any]:
    woman = bool(rng.random() < 0.5)
    skin = np.array([0.86, 0.68, 0.57]) * (1 - np.array([0.55, 0.65, 0.7]) * rng.random() ** 1.5)
    motion, heading = str(rng.choice(MOTIONS)), float(rng.uniform(-np.pi, np.pi))
    radius = float(rng.choice([-CIRCLE_M, CIRCLE_M])) if motion in ("walk", "jog") else 0.0
    # Who goes round in a circle goes round the place.
    start = place - radius * np.array([-np.sin(heading), np.cos(heading)])
    return {
        "height_m": round(float(np.clip(rng.normal(1.65 if woman else 1.78, 0.08), 1.45, 2.05)), 2),
        "build": str(rng.choice(BUILDS)),
        "sex": "woman" if woman else "man",
        "shirt": _garment(rng, room),
        "trousers": _garment(rng, room),
        "shoes": _color(rng),
        "skin": [round(float(value), 3) for value in skin],
        "hair": [[0.05, 0.05, 0.05], [0.25, 0.16, 0.10], [0.45, 0.32, 0.18], [0.72, 0.68, 0.62]][rng.integers(4)],
        "pattern": str(rng.choice(PATTERNS)),
        "pattern_color": _garment(rng, room),
        "sleeves": str(rng.choice(["short", "long"])),
        "legs": str(rng.choice(["short", "long", "long"])),
        "long_hair": bool(woman and rng.random() < 0.6),
        "loose_m": _between(rng, 0.004, 0.018),
        "motion": motion,
        "turn_radius_m": radius,
        "start_m": [round(float(value), 2) for value in start],
        "heading_deg": round(float(np.degrees(heading))),
    }
