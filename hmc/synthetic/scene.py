"""A scene: everything a recipe stands for, built and ready to be rendered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.camera.model import Rig
from hmc.errors import InputError
from hmc.synthetic.actor import Actor, make_actor, pose_mesh
from hmc.synthetic.clothes import Clothes
from hmc.synthetic.library import make_motion
from hmc.synthetic.motions import Motion
from hmc.synthetic.recipe import Recipe
from hmc.synthetic.rigs import make_rig
from hmc.synthetic.room import Room, furnish
from hmc.synthetic.shading import Light, make_lights

__all__ = ["Crowd", "Scene", "build_scene", "crowd_at"]


@dataclass(frozen=True)
class Scene:
    """What is rendered.

    Parameters
    ----------
    recipe : Recipe
    seed : int
    rig : Rig
    room : Room
    lights : tuple of Light
    actors : tuple of Actor
    motions : tuple of Motion
        One an actor, in the world.
    """

    recipe: Recipe
    seed: int
    rig: Rig
    room: Room
    lights: tuple[Light, ...]
    actors: tuple[Actor, ...]
    motions: tuple[Motion, ...]


@dataclass(frozen=True)
class Crowd:
    """All actors in one frame as one mesh.

    Parameters
    ----------
    vertices, normals, albedo : ndarray, shape (n, 3)
    triangles : ndarray, shape (m, 3)
    persons : ndarray of int, shape (n,)
        Whose vertex it is.
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
        When somebody leaves the room.
    """
    seed = recipe.seed if seed is None else seed
    rng_rig, rng_room, rng_light, *rng_actors = (
        np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3 + 2 * len(recipe.actors))
    )
    x, y, z = recipe.room.size_m
    corners = np.array([[-x / 2, -y / 2, 0.0], [x / 2, y / 2, z]])
    rig = make_rig(
        recipe.rig.kind, corners, rng_rig, recipe.rig.size_px, recipe.rig.camera_height_m, recipe.rig.target_height_m,
        recipe.rig.field_of_view_deg or None, recipe.rig.distorted,
    )  # fmt: skip
    walls = recipe.room.walls * (4 // len(recipe.room.walls))
    colours = recipe.room.wall_colours * (4 // len(recipe.room.wall_colours))
    boxes = tuple(box for f in recipe.furniture for box in furnish(f.kind, f.at_m, f.heading_deg, f.size_m, f.colour, f.texture))
    posters = tuple(
        (k % 4, float(rng_room.uniform(-0.33, 0.33) * (y if k % 4 < 2 else x)), float(rng_room.uniform(1.5, 1.9)), 0.5, 0.65)
        for k in range(recipe.room.posters)
    )
    room = Room(
        corners,
        tuple(zip(walls, colours, strict=True)),
        (recipe.room.floor, recipe.room.floor_colour),
        boxes,
        posters,
        int(rng_room.integers(2**16)),
    )
    lights = make_lights(corners, recipe.light.lamps, recipe.light.brightness, rng_light)
    times = np.arange(recipe.n_frames) / recipe.fps
    actors, motions = [], []
    for k, a in enumerate(recipe.actors):
        clothes = Clothes(
            a.shirt, a.trousers, a.skin, a.hair, a.shoes, a.pattern, a.pattern_colour, a.sleeves, a.legs, a.long_hair, a.loose_m
        )
        actor = make_actor(a.height_m, a.build, rng_actors[2 * k], a.sex, clothes, recipe.cell_m)
        actors.append(actor)
        motions.append(make_motion(a, actor.skeleton, times, rng_actors[2 * k + 1]))
        outside = np.flatnonzero((np.abs(motions[-1].root[:, :2]) > corners[1, :2] - 0.3).any(axis=1))
        if outside.size:
            raise InputError(
                f"recipe '{recipe.name}': actor {k + 1} walks into a wall after {times[outside[0]]:.1f} s; "
                "change start_m, heading_deg, turn_radius_m or speed_m_s, make the clip shorter (seconds) or the room larger (size_m)"
            )
    return Scene(recipe, seed, rig, room, lights, tuple(actors), tuple(motions))


def crowd_at(scene: Scene, frame: int) -> Crowd:
    """All actors as they are in a frame."""
    parts, count = [], 0
    for k, (actor, motion) in enumerate(zip(scene.actors, scene.motions, strict=True)):
        vertices, normals = pose_mesh(actor, motion.root[frame], motion.orientations[frame])
        parts.append((vertices, normals, actor.albedo, actor.triangles + count, np.full(len(vertices), k)))
        count += len(vertices)
    if not parts:
        return Crowd(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3), int), np.zeros(0, int))
    return Crowd(*(np.concatenate(column) for column in zip(*parts, strict=True)))
