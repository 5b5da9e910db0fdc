"""Scalable body models against the plain annealed filter: one cell is one recording, one method, one number of evaluations a frame.

Source: Canton (2009), chapters 7 and 8. As in `filter_runs`, the filter starts from the first frame's true pose and the hull is that around
the true person, so that what is compared is the filters. They have the factorised likelihood and the thesis's body; their annealing is
``printed``, or ``strong`` as in the preset `default`. Beside them stand the marker-based filter, and whole chains from videos alone by the
preset `default`, with refinement and fitted body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hmc.body.joints import N_DOF
from hmc.experiments import marker_runs
from hmc.experiments.engine.experiment import Cell, Parameters, Plan, Results
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.filter_grids import QUICK_FRAMES
from hmc.experiments.filter_runs import ANNEALING, filter_preset, follow_from_truth
from hmc.experiments.markerless_runs import VOXEL_M, TrackedRecording, action_sources, pose_results, run_method, tracked
from hmc.experiments.removal import remover
from hmc.pose.follow import FollowOptions
from hmc.pose.methods.scalable import method_preset
from hmc.pose.registry import pose_method
from hmc.pose.steps.presets import PRESETS, PosePreset
from hmc.search.structural import StructuralSettings

__all__ = [
    "APF",
    "APF_EVALUATIONS",
    "CHAINS",
    "FAMILY",
    "MARKERS",
    "METHODS",
    "SHBM",
    "VERSION",
    "WHOLE",
    "by_method",
    "cell",
    "chain",
    "method_grid",
    "run_preset",
]

FAMILY = "scalable-filter"
#: Of these cells.
VERSION = 3
APF = "APF"
#: Methods, and what they are on the command line.
METHODS: dict[str, tuple[str, tuple[str, ...]]] = {
    APF: ("apf", ()),
    "SHBM-APF, model 1": ("shbm-apf", ("1",)),
    "SHBM-APF, model 2": ("shbm-apf", ("2",)),
    "SHBM-APF, chosen": ("shbm-apf", ("auto",)),
    "DDM-APF": ("ddm-apf", ()),
    "SHBM-DDM-APF": ("shbm-ddm-apf", ("1",)),
}
#: Model 1 as the thesis has it: particles stay whole, and as few survive as the plain filter keeps.
WHOLE = "SHBM-APF, model 1, no exchange of limbs"
MARKERS = "marker-based APF"
#: Whole chains by the preset `default`, and their methods.
CHAINS = {"default, APF": APF, "default, SHBM-APF": "SHBM-APF, model 1"}
SHBM = tuple(name for name in METHODS if name.startswith("SHBM-APF"))
#: Evaluations a frame of the thesis's APF: 6 layers of 600 particles.
APF_EVALUATIONS = 3600
APF_LAYERS = 6
#: The marker-based filter as in table 6.3, `default`.
_MARKERS = {"start": "found", "detection_rate": 0.9, "false_positives": 20.0, "variance_px2": 4.0, "preset": "default", "reprojection": 0.5,
            "layers": 3, "particles": 700}  # fmt: skip


def run_preset(parameters: Parameters) -> PosePreset:
    """The filter of a cell, with so many evaluations a frame."""
    evaluations, annealing = parameters["evaluations"], ANNEALING[parameters["annealing"]]
    base = {"likelihood": "factorised", "density": 1.0, "layers": APF_LAYERS, "particles": round(evaluations / APF_LAYERS)}
    preset = filter_preset(base | {"annealing": parameters["annealing"]})
    structural = StructuralSettings() if annealing == "canton2009" else PRESETS[annealing].structural
    structural = replace(structural, gamma=evaluations / (N_DOF * structural.layers))
    method = parameters["method"]
    if method == WHOLE:
        method, structural = SHBM[0], replace(structural, by_limb=False, survival_rate=preset.annealed.layer_survival(0))
    name, models = METHODS[method]
    return method_preset(replace(preset, structural=structural), name, models)


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Follow the first person from the true first pose; landmarks and truth of the frames after it, metres, and the filter's seconds.

    Parameters
    ----------
    parameters : mapping
        ``recording``, ``cameras`` (0: all), ``frames`` (0: all), ``voxel_mm``, ``annealing``, ``method`` (a key of `METHODS` or
        `CHAINS`; or `WHOLE`; or `MARKERS`, which has settings of its own), ``evaluations`` (of the likelihood, a frame),
        ``removed_percent`` and ``removed`` (`hmc.experiments.removal`), ``repeat``.
    inputs : Inputs
    rng : numpy.random.Generator
    """
    if parameters["method"] == MARKERS:
        return marker_runs.cell(dict(parameters) | _MARKERS, inputs, rng)
    if parameters["method"] in CHAINS:
        seen = tracked(inputs, parameters["recording"], parameters["cameras"])
        return chain(seen, CHAINS[parameters["method"]], rng)
    # What is removed must not depend on the method.
    change = remover(parameters["removed"], parameters["removed_percent"] / 100, parameters["repeat"]) if parameters["removed"] else None
    return follow_from_truth(run_preset(parameters), parameters, inputs, rng, change)


def chain(seen: TrackedRecording, method: str, rng: np.random.Generator) -> Results:
    """Poses of the first person from videos alone by the preset `default` of one of `METHODS`; landmarks and truth, metres."""
    name, models = METHODS[method]
    people = run_method(seen, pose_method(name, models=models), FollowOptions(VOXEL_M, int(rng.integers(2**31))))
    return pose_results(seen.recording, people)


def method_grid(
    plan: Plan, actions: Sequence[str], settings: Sequence[dict[str, Any]], repeats: int = 3, quick_repeats: int = 1
) -> list[dict[str, Any]]:
    """Every setting on every action, by the actors in turn.

    Parameters
    ----------
    plan : Plan
    actions : sequence of str
    settings : sequence of mapping
        ``method`` and what else differs from 7 cameras, 20 mm (quick: 30 mm), strong annealing, whole silhouettes.
    repeats, quick_repeats : int
        Of every setting, in full and quick.
    """
    sources = action_sources(plan, actions)
    if not plan.recordings:
        sources = [source for k, source in enumerate(sources) if k % 2 == k // 2 % 2]  # one actor an action, in turn
    base = {"cameras": 0, "frames": QUICK_FRAMES if plan.quick else 0, "voxel_mm": 30 if plan.quick else 20, "annealing": "strong",
            "evaluations": APF_EVALUATIONS, "removed_percent": 0, "removed": ""}  # fmt: skip
    return [
        {"recording": source.label} | base | setting | {"repeat": repeat}
        for source in sources
        for setting in settings
        for repeat in range(quick_repeats if plan.quick else repeats)
    ]


def by_method(cells: Sequence[Cell], **wanted: Any) -> dict[str, list[Cell]]:
    """Cells of every method, of those that have the wanted parameters."""
    groups: dict[str, list[Cell]] = {}
    for one in cells:
        if all(one.parameters[name] == value for name, value in wanted.items()):
            groups.setdefault(one.parameters["method"], []).append(one)
    return groups
