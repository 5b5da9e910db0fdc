"""What the experiments of Hsiao (2008) share: rendered sequences, their true parts, and the whole method on a recording."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell, Parameters, Plan, Results, Source
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.experiments.engine.intervals import Interval
from hmc.experiments.engine.ratios import ratio_interval
from hmc.experiments.markerless_runs import FRONTEND, VOXEL_M, pose_results, run_method, tracked
from hmc.experiments.nine_actions import NINE_ACTIONS, QUICK_SUFFIX, nine_recipes
from hmc.experiments.truth import estimates, stature_m
from hmc.io.recording import Recording
from hmc.landmarks import LANDMARKS
from hmc.pose.follow import FollowOptions
from hmc.pose.method import PoseMethod, StepResult, Tracked
from hmc.pose.methods.pso import SWARM_PRESETS, pso_method
from hmc.pose.registry import pose_method
from hmc.pose.spectral.graph import color_votes, face_neighbours
from hmc.pose.steps.swarm.temporal import RestartSettings
from hmc.pose.views.person_view import PersonView
from hmc.synthetic.scene import Scene, build_scene
from hmc.voxels.components import components
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import HullStep, stream_hulls

__all__ = [
    "VOXEL_M", "WAYS", "facing_interval", "followed", "limbs_apart", "person_hulls", "pose_cell", "scene_of", "sequence_name", "sequences",
]  # fmt: skip


def _each_alone() -> PoseMethod:
    preset = SWARM_PRESETS["hsiao2008"]
    return pso_method(
        replace(preset, swarm=replace(preset.swarm, restart=RestartSettings(always=True, alone=True, margin_m=-np.inf, lost_m=np.inf)))
    )


#: The thesis's system; the same without its temporal consistency (3.2.2.5), every frame a new start; and ours.
WAYS: dict[str, Callable[[], PoseMethod]] = {
    "hsiao2008": partial(pose_method, "pso", "hsiao2008"),
    "each frame alone": _each_alone,
    "default": partial(pose_method, "pso", "default"),
}


def sequences(plan: Plan, names: tuple[str, ...] = tuple(NINE_ACTIONS)) -> tuple[Source, ...]:
    """The user's recordings, or the nine rendered sequences, short in the quick mode."""
    return plan.recordings or tuple(rendered(name + QUICK_SUFFIX * plan.quick) for name in names)


def scene_of(label: str) -> Scene:
    """The scene of a rendered sequence, which knows each actor's true parts.

    Raises
    ------
    InputError
        When the label is of a recording of the user's.
    """
    name = label.rpartition("@")[0]
    for recipe in nine_recipes():
        if recipe.name == name:
            return build_scene(recipe)
    raise InputError(f"{name}: the true parts of a body are known of rendered sequences only; leave --recordings out")


def person_hulls(recording: Recording, voxel_size_m: float = VOXEL_M) -> Iterator[tuple[HullStep, VoxelGrid, np.ndarray, tuple]]:
    """Every frame's strict hull of the only person, voxels (n, 3), with the frame, the grid and the color votes."""
    grid = VoxelGrid.from_room(recording.room, voxel_size_m, len(recording.rig))
    for step in stream_hulls(recording, grid, FRONTEND, on_problem=lambda line: None):
        blobs = components(step.strict, grid, 20)
        if not len(blobs):
            continue
        # Pieces near the largest one are the person's; what is elsewhere is noise.
        near = np.linalg.norm(blobs.centroids[:, :2] - blobs.centroids[0, :2], axis=1) < 1.0
        voxels = np.concatenate([blobs.of(k) for k in np.flatnonzero(near).tolist()])
        yield step, grid, voxels, color_votes(face_neighbours(voxels), voxels, grid, recording.rig, step.images)


def limbs_apart(points: np.ndarray) -> bool:
    """Whether arms and legs are apart from the trunk and from one another, by the true joints (15, 3), metres."""
    at = dict(zip(LANDMARKS, points, strict=True))
    axis, head = (at["pelvis"], at["neck"]), (at["neck"], at["head_top"])

    def away(name: str, segment: tuple, least: float) -> bool:
        a, b = segment
        t = np.clip((at[name] - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        return float(np.linalg.norm(at[name] - a - t * (b - a))) > least

    arms = all(away(f"{s}_wrist", axis, 0.28) and away(f"{s}_elbow", axis, 0.24) and away(f"{s}_wrist", head, 0.22) for s in "lr")
    legs = all(np.linalg.norm(at[f"l_{joint}"] - at[f"r_{joint}"]) > 0.2 for joint in ("knee", "ankle"))
    hands = np.linalg.norm(at["l_wrist"] - at["r_wrist"]) > 0.25
    thighs = all(np.linalg.norm(at[f"{s}_wrist"] - at[f"{t}_hip"]) > 0.25 for s in "lr" for t in "lr")
    return bool(arms and legs and hands and thighs)


def pose_cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """The whole method on a recording, from videos alone but for the stature, which the thesis knows beforehand.

    Parameters
    ----------
    parameters : mapping
        ``recording``, ``way`` (a key of `WAYS`), ``repeat``.
    inputs : Inputs
    rng : numpy.random.Generator
    """
    return followed(parameters["recording"], WAYS[parameters["way"]](), inputs, rng)


def followed(label: str, method: PoseMethod, inputs: Inputs, rng: np.random.Generator) -> Results:
    """A recording by any method, as `pose_cell` does it."""
    seen = tracked(inputs, label, 0)
    options = FollowOptions(VOXEL_M, int(rng.integers(2**31)), stature_m(seen.recording))
    spent: list[tuple[int, float]] = []

    def counted(rng: np.random.Generator, before: Tracked, view: PersonView) -> StepResult:
        begun = time.process_time()
        after = method.step(rng, before, view)
        spent.append((after[1].evaluations, time.process_time() - begun))
        return after

    people = run_method(seen, replace(method, step=counted), options)
    results = pose_results(seen.recording, people)
    evaluations, seconds = np.mean(spent, axis=0).tolist() if spent else (0.0, 0.0)
    return {
        "estimate_m": results["estimate_m"],
        "truth_m": results["truth_m"],
        "frames": len(results["frames"]),
        "restarts": sum(bool(told.get("started")) for told in people.details),
        "without_fit": sum(status != "fitted" for status in people.status),
        "evaluations_per_frame": evaluations,
        "seconds_per_frame": seconds,
    }


def sequence_name(one: Cell) -> str:
    """The sequence of a cell, in full or quick."""
    return one.parameters["recording"].rpartition("@")[0].removesuffix(QUICK_SUFFIX)


def facing_interval(cells: Sequence[Cell]) -> Interval:
    """Percentage of frames in which a body faces less than 90 degrees away from how it truly does, of those with a fit."""
    return ratio_interval(cells, _facing)


def _facing(one: Cell) -> tuple[float, float]:
    estimate, truth = (_across(points) for points in estimates(one))
    known = np.isfinite(estimate).all(1) & np.isfinite(truth).all(1)
    return 100 * float(np.sum((estimate * truth).sum(1)[known] > 0)), float(np.sum(known))


def _across(points: np.ndarray) -> np.ndarray:
    """From right to left over the floor, by hips and shoulders of landmarks (n, 15, 3): (n, 2)."""
    at = {name: points[:, k, :2] for k, name in enumerate(LANDMARKS)}
    return at["l_hip"] - at["r_hip"] + at["l_shoulder"] - at["r_shoulder"]
