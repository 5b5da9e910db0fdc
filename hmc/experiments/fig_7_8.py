"""Figure 7.8: effective particles behind the variables of every model, and how their spread falls from layer to layer.

Source: Canton (2009), Eq. 7.20, 7.23 to 7.29 and section 7.3.2.4: a variable's spread always falls as it is processed, within a model and
from model to model; the trunk's variables are filtered by all models' particles, the last model's by its own alone. All of it is read off a
run of the filter with the printed settings (`StructuralInfo`): how many particles were weighed in every layer, and how far they moved along
every variable.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from hmc.body.inverse import fit_landmarks
from hmc.body.proportions import canton_body
from hmc.body.scalable_models import PRINTED_1, PRINTED_2
from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.intervals import decide
from hmc.experiments.five_actions import ACTIONS
from hmc.experiments.markerless_runs import FRONTEND, MASKS_KEY, VOXEL_M, action_sources, tracked
from hmc.experiments.run_means import mean_interval
from hmc.experiments.truth import HEIGHT_M, first_truth, standing_state, stature_m, truth_track
from hmc.io.masks import kept_masks
from hmc.pose.method import Capture, begin_tracking
from hmc.pose.methods.annealed import annealed_pose_step
from hmc.pose.methods.scalable import method_preset
from hmc.pose.steps.annealed import annealed_subject
from hmc.pose.steps.presets import PRESETS
from hmc.pose.views.person_view import views_of
from hmc.tracking.resumable import person_grid
from hmc.voxels.hulls import stream_hulls

__all__ = ["EXPERIMENT"]

MODELS = {"1": PRINTED_1, "2": PRINTED_2}
#: What the thesis prints: dimensions that each model adds (Eq. 7.19), and particles (Eq. 7.29).
ADDED_PAPER, PARTICLES_PAPER = (6, 10, 6), (300, 500, 300)
#: Frames of a run.
FRAMES = 5


def grid(plan: Plan) -> list[dict]:
    """Both hierarchies on some actions, by the actors in turn."""
    sources = action_sources(plan, ("walk", "gesture") if plan.quick else ACTIONS, in_turn=True)
    return [
        {"recording": source.label, "model": model, "frames": FRAMES, "repeat": repeat}
        for source in sources
        for model in MODELS
        for repeat in range(2 if plan.quick else 3)
    ]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Follow the first person for some frames from the true first pose: particles of every layer, and how far they moved."""
    seen = tracked(inputs, parameters["recording"], 0)
    recording, truth = seen.recording, first_truth(seen.recording)
    preset = method_preset(PRESETS["canton2009"], "shbm-apf", (parameters["model"],))
    body, room_grid = canton_body(stature_m(recording) or HEIGHT_M), person_grid(recording, VOXEL_M)
    subject = annealed_subject(body, Capture(recording.fps, VOXEL_M, recording.room, recording.rig), preset)
    state, _ = fit_landmarks(body, truth.positions[0], standing_state(body, truth.positions[0]))
    pose, step = begin_tracking(subject, state), annealed_pose_step(preset)
    first = int(truth.frames[0])
    last = first + parameters["frames"]
    kept = kept_masks(seen.masks, MASKS_KEY, first, last)
    hulls = stream_hulls(recording, room_grid, FRONTEND, first=first, last=last, masks=kept, on_problem=lambda line: None)
    counts, drifts = [], []
    for hull in hulls:
        pose, info = step(rng, pose, views_of(recording, room_grid, truth_track(truth), hull)[0])
        if info.structural is None:
            raise InputError(f"{parameters['recording']}: frame {hull.index} shows nobody, and figure 7.8 reads off what the filter does")
        layers = [layer for model in info.structural.layers for layer in model]
        counts.append([layer.evaluations for layer in layers])
        drifts.append([layer.drift for layer in layers])
    moved = np.sqrt(np.mean(np.square(drifts), axis=0))
    group = MODELS[parameters["model"]].group
    of_model = [[float(np.sqrt(np.mean(line[group == k] ** 2))) for k in range(group.max() + 1)] for line in moved]
    return {"evaluations": np.mean(counts, axis=0), "drift": moved, "drift_of_model": np.array(of_model), "group": group}


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Bars of effective particles and a line a model of its variables' spread, for both hierarchies."""
    figure, panels = plt.subplots(len(MODELS), 2, figsize=(7.5, 5.4), squeeze=False)
    rows: list[dict[str, Any]] = []
    claims: list[Claim] = []
    for model, (bars, lines) in zip(MODELS, panels, strict=True):
        own = [one for one in cells if one.parameters["model"] == model]
        particles, effective, spread = (np.mean([part(one) for one in own], axis=0) for part in (_particles, _effective, _spread))
        added = np.bincount(np.array(own[0].results["group"], int))
        for k in range(len(added)):
            steps = spread[spread[:, k] > 0, k]
            rows.append({"hierarchy": model, "variables_of_model": k + 1, "dimensions": int(added[k]), "dimensions_paper": ADDED_PAPER[k],
                         "particles": float(particles[k]), "particles_paper": PARTICLES_PAPER[k],
                         "effective_particles": float(effective[k]), "effective_particles_paper": 2 * sum(PARTICLES_PAPER[k:]),
                         "spread_in_the_last_layer": float(steps[-1]),
                         "spread_by_Eq_7_26": _printed_spread(len(added), len(spread) // len(added), k)})  # fmt: skip
        bars.bar(range(1, len(effective) + 1), effective)
        bars.set(xlabel="variables of model", ylabel="effective particles", xticks=range(1, len(effective) + 1), title=f"hierarchy {model}")
        steps = 1 + np.arange(len(spread)) / (len(spread) // len(added))
        for k in range(len(added)):
            there = spread[:, k] > 0
            lines.plot(steps[there], spread[there, k], "o-", label=f"{k + 1}")
        lines.set(xlabel="model (between: inner layers)", ylabel="spread over the first", ylim=(0, 1.45))
        lines.legend(loc="upper left", title="variables of model", ncols=3)
        claims += _claims(own, model, particles)
    caption = "The printed SHBM-APF at work, read off its runs. The paper: Canton, Figure 7.8, Eq. 7.19 and 7.29."
    return Report((Table("fig-7.8", caption, rows),), {"fig-7.8": figure}, tuple(claims))


def _claims(cells: Sequence[Cell], model: str, particles: np.ndarray) -> list[Claim]:
    effective = np.diff([_effective(one) for one in cells], axis=1)
    more = [mean_interval(_by_run(cells, -effective[:, k])) for k in range(effective.shape[1])]
    falls = [mean_interval(_by_run(cells, fall)) for fall in np.transpose([_falls(one) for one in cells])]
    worst = min(falls, key=lambda one: one.low)
    told = f"{particles.round().astype(int).tolist()}, {particles.sum():.0f} in all"
    return [
        decide(
            f"hierarchy {model}: each model's variables are filtered by more particles than the next one's",
            more,
            ", ".join(f"{one.value:.0f} more" for one in more),
        ),
        decide(
            f"hierarchy {model}: a variable's spread falls in every layer",
            worst,
            f"least by {worst.value:.3f} [{worst.low:.3f}, {worst.high:.3f}] of the first",
        ),
        Claim(f"hierarchy {model}: 1,100 particles, 300, 500 and 300", bool(np.allclose(particles, PARTICLES_PAPER)), told),
    ]


def _by_run(cells: Sequence[Cell], values: np.ndarray) -> dict:
    return {(one.parameters["recording"], one.parameters["repeat"]): float(v) for one, v in zip(cells, values, strict=True)}


def _particles(one: Cell) -> np.ndarray:
    """Particles of every model, the mean over its layers."""
    counts, models = np.array(one.results["evaluations"], float), np.shape(one.results["drift_of_model"])[1]
    return counts.reshape(models, -1).mean(axis=1)


def _effective(one: Cell) -> np.ndarray:
    """Particles that were moved along each model's variables and weighed, in all layers (Eq. 7.20)."""
    moved = np.array(one.results["drift_of_model"], float) > 0
    return np.array(one.results["evaluations"], float) @ moved


def _spread(one: Cell) -> np.ndarray:
    """Spread of each model's variables in every layer as a share of the first in which they move, (layers, models)."""
    drift = np.array(one.results["drift_of_model"], float)
    first = drift[(drift > 0).argmax(axis=0), np.arange(drift.shape[1])]
    return drift / np.where(first > 0, first, 1)


def _falls(one: Cell) -> np.ndarray:
    """By how much the spread of each model's variables falls from each layer to the next, while they move; one row of all."""
    spread = _spread(one)
    layers = len(spread) // spread.shape[1]
    return np.concatenate([-np.diff(spread[k * layers :, k]) for k in range(spread.shape[1])])


def _printed_spread(models: int, layers: int, model: int) -> float:
    """What is left in the last layer by Eq. 7.26 with alpha_S = .8 and alpha_H = .5 (section 7.5.1)."""
    later = models - 1 - model
    return 0.8**later * 0.5 ** (layers * later + layers - 1)


EXPERIMENT = Experiment("fig-7.8", "effective particles and spread by model", "Canton, Figure 7.8", grid, cell, report, version=3)
