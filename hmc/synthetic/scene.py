"""A scene: everything a recipe stands for, built and ready to be rendered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.camera.model import Rig
from hmc.errors import InputError
from hmc.synthetic.actor import Actor, make_actor, pose_mesh
from hmc.synthetic.clothes import Clothes
from hmc.synthetic.held import with_cube
from hmc.synthetic.library import make_motion
from hmc.synthetic.markers import with_balls
from hmc.synthetic.motions import Motion
from hmc.synthetic.recipe import ActorRecipe, FurnitureRecipe, Recipe
from hmc.synthetic.rigs import make_rig
from hmc.synthetic.room import DOOR_M, Room, furnish, paint_boxes
from hmc.synthetic.script import furniture_place
from hmc.synthetic.shading import Light, make_lights

__all__ = ["Crowd", "Scene", "build_scene", "crowd_at"]


#: Furniture that moves is drawn as a mesh of so long edges, metres.
_PROP_EDGE_M = 0.04


@dataclass(frozen=True)
class Prop:
    """A piece of furniture that moves, where it stands at first.

    Parameters
    ----------
    item : FurnitureRecipe
    vertices, normals, albedo : ndarray, shape (n, 3)
    triangles : ndarray of int, shape (m, 3)
    """

    item: FurnitureRecipe
    vertices: np.ndarray
    normals: np.ndarray
    albedo: np.ndarray
    triangles: np.ndarray


@dataclass(frozen=True)
class Scene:
    """What is rendered.

    Parameters
    ----------
    recipe : Recipe
    seed : int
    rig : Rig
    room : Room
        With the furniture that stays.
    lights : tuple of Light
    actors : tuple of Actor
    motions : tuple of Motion
        One an actor, in the world.
    props : tuple of Prop
        The furniture that moves.
    """

    recipe: Recipe
    seed: int
    rig: Rig
    room: Room
    lights: tuple[Light, ...]
    actors: tuple[Actor, ...]
    motions: tuple[Motion, ...]
    props: tuple[Prop, ...] = ()

    def in_room(self, actor: int) -> np.ndarray:
        """In which frames an actor's pelvis is between the walls, shape (n_frames,)."""
        low, high = self.room.corners[:, :2]
        place = self.motions[actor].root[:, :2]
        return ((place > low) & (place < high)).all(axis=1)


@dataclass(frozen=True)
class Crowd:
    """All that moves in one frame as one mesh.

    Parameters
    ----------
    vertices, normals, albedo : ndarray, shape (n, 3)
    triangles : ndarray, shape (m, 3)
    persons : ndarray of int, shape (n,)
        Whose vertex it is; -1 for furniture.
    """

    vertices: np.ndarray
    normals: np.ndarray
    albedo: np.ndarray
    triangles: np.ndarray
    persons: np.ndarray


def build_scene(recipe: Recipe, seed: int | None = None) -> Scene:
    """Build what a recipe describes; the same recipe and seed give the same scene.

    Parameters
    ----------
    recipe : Recipe
    seed : int, optional
        In place of the recipe's.

    Returns
    -------
    Scene

    Raises
    ------
    InputError
        When a person leaves the room, but through a door.
    """
    seed = recipe.seed if seed is None else seed
    rng_rig, rng_room, rng_light, *rng_actors = (
        np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3 + 2 * len(recipe.actors))
    )
    x, y, z = recipe.room.size_m
    corners = np.array([[-x / 2, -y / 2, 0.0], [x / 2, y / 2, z]])
    rig = make_rig(recipe.rig, corners, rng_rig)
    walls = recipe.room.walls * (4 // len(recipe.room.walls))
    colors = recipe.room.wall_colors * (4 // len(recipe.room.wall_colors))
    fixed = [item for item in recipe.furniture if not item.moves]
    boxes = tuple(box for f in fixed for box in furnish(f.kind, f.at_m, f.heading_deg, f.size_m, f.color, f.texture))
    posters = tuple(
        (k % 4, float(rng_room.uniform(-0.33, 0.33) * (y if k % 4 < 2 else x)), float(rng_room.uniform(1.5, 1.9)), 0.5, 0.65)
        for k in range(recipe.room.posters)
    )
    room = Room(
        corners,
        tuple(zip(walls, colors, strict=True)),
        (recipe.room.floor, recipe.room.floor_color),
        boxes,
        posters,
        int(rng_room.integers(2**16)),
        recipe.room.doors,
    )
    props = tuple(
        Prop(f, *paint_boxes(furnish(f.kind, f.at_m, f.heading_deg, f.size_m, f.color, f.texture), _PROP_EDGE_M, room.seed))
        for f in recipe.furniture
        if f.moves
    )
    lights = make_lights(corners, recipe.light.lamps, recipe.light.brightness, rng_light)
    times = np.arange(recipe.n_frames) / recipe.fps
    actors, motions = [], []
    for k, a in enumerate(recipe.actors):
        clothes = Clothes(
            a.shirt, a.trousers, a.skin, a.hair, a.shoes, a.pattern, a.pattern_color, a.sleeves, a.legs, a.long_hair, a.loose_m
        )
        actor = make_actor(a.height_m, a.build, rng_actors[2 * k], a.sex, clothes, recipe.cell_m, a.hands == "fists", a.longer_left)
        actor = with_balls(actor, a.pattern_color) if a.pattern == "markers" else actor
        actors.append(with_cube(actor, a.cube_m, a.cube_color) if a.cube_m > 0 else actor)
        motions.append(make_motion(a, actor.skeleton, times, rng_actors[2 * k + 1], recipe.furniture))
        if (first := _first_in_wall(a, motions[-1], room)) is not None:
            raise InputError(
                f"recipe '{recipe.name}': actor {k + 1} walks into a wall after {times[first]:.1f} s; "
                "change start_m, heading_deg, turn_radius_m or speed_m_s, make the clip shorter (seconds) or the room larger (size_m)"
                + ("; a script may lead through a door (doors) only" if a.motion == "script" else "")
            )
    return Scene(recipe, seed, rig, room, lights, tuple(actors), tuple(motions), props)


def _first_in_wall(actor: ActorRecipe, motion: Motion, room: Room) -> int | None:
    """The first frame in which a person comes too near to a wall or is beyond one, other than at a door."""
    place = motion.root[:, :2]
    high = room.corners[1, :2]
    near = (np.abs(place) > high - 0.3).any(axis=1)
    if actor.motion == "script":
        for wall, along in room.doors:
            axis, sign = wall // 2, 2 * (wall % 2) - 1
            near &= ~((np.abs(place[:, 1 - axis] - along) < DOOR_M[0] / 2) & (sign * place[:, axis] > high[axis] - 0.6))
    return int(np.argmax(near)) if near.any() else None


def crowd_at(scene: Scene, frame: int) -> Crowd:
    """All that moves as it is in a frame; before frame 0 the furniture alone, where it stands at first."""
    parts, count = [], 0
    for k, (actor, motion) in enumerate(zip(scene.actors, scene.motions, strict=True)):
        if frame < 0 or _far_outside(motion.root[frame], scene.room):
            continue
        vertices, normals = pose_mesh(actor, motion.root[frame], motion.orientations[frame])
        parts.append((vertices, normals, actor.albedo, actor.triangles + count, np.full(len(vertices), k)))
        count += len(vertices)
    for prop in scene.props:
        place = furniture_place(prop.item, max(frame, 0) / scene.recipe.fps)
        vertices = prop.vertices + np.append(place - np.array(prop.item.at_m), 0.0)
        parts.append((vertices, prop.normals, prop.albedo, prop.triangles + count, np.full(len(vertices), -1)))
        count += len(vertices)
    if not parts:
        return Crowd(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3), int), np.zeros(0, int))
    return Crowd(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _far_outside(root: np.ndarray, room: Room, reach_m: float = 1.2) -> bool:
    """Whether nothing of a person reaches into the room."""
    return bool((root[:2] < room.corners[0, :2] - reach_m).any() or (root[:2] > room.corners[1, :2] + reach_m).any())
