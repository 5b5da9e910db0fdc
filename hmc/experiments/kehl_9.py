"""Figures 9 and 10: stochastic against deterministic sampling, from a displaced arm.

Source: Kehl (2006), section 7.1. There one arm is moved by 18 and 6 degrees at shoulder and elbow; here it is done 50 times, in random
directions. The best pose is what the descent finds from the true one with five times the samples. Takes about 5 minutes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from hmc.body.inverse import fit_landmarks
from hmc.body.joints import dof_index
from hmc.body.kinematics import landmarks
from hmc.body.proportions import default_body
from hmc.body.solids import CHAINS, FREE, FREE_NAMES, GROUPS
from hmc.experiments import kehl_runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.experiments.engine.style import COLORS
from hmc.experiments.truth import HEIGHT_M, first_truth, standing_state, stature_m
from hmc.landmarks import LANDMARKS
from hmc.pose.steps.descent.tracker import make_cue_frame, make_tracker, optimise

__all__ = ["EXPERIMENT"]

SECOND = 3.0
DISPLACEMENTS, DEGREES = 50, (15.0, 45.0)
MOVED = np.array([FREE_NAMES.index(name) for name in ("r_shoulder_x", "r_shoulder_y", "r_shoulder_z", "r_elbow_z")])
ARM = CHAINS[GROUPS.index("r_arm") - 1]
ENDS = [LANDMARKS.index(name) for name in ("r_elbow", "r_wrist")]
#: Escaped: elbow and wrist within this of where they are in the best pose, metres.
NEAR_M = 0.05
METHODS = {"SMD": "stochastic", "deterministic": "deterministic"}


def grid(plan: Plan) -> list[dict]:
    """One cell a recording."""
    sources = plan.recordings or (rendered("pedal_arms"),)
    return [{"recording": source.label, "displacements": DISPLACEMENTS, "second": SECOND} for source in sources]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Displace the arm and descend, either way from the same places."""
    recording = inputs.recording(parameters["recording"])
    truth = first_truth(recording)
    frame = round(parameters["second"] * recording.fps)
    *_, (_, seen, _) = kehl_runs.observations(recording, frame + 1)
    if seen is None:
        return {"distance_m": {name: [] for name in METHODS}, "degrees": []}
    skeleton = default_body(stature_m(recording) or HEIGHT_M)
    points = truth.positions[int(np.searchsorted(truth.frames, recording.start + frame))]
    state, _ = fit_landmarks(skeleton, points, standing_state(skeleton, points))
    state[dof_index("torso_x", "torso_y", "torso_z")] = 0.0
    preset = kehl_runs.preset_of("SMD")
    # The paper has 10 points on the arm's surface and 10 on each contour.
    preset = replace(preset, cues=replace(preset.cues, surface_points=(60, 20, 10, 20, 20, 20), colors=None))
    dense = make_tracker(skeleton, replace(preset, times=5))
    ready = make_cue_frame(dense, seen, state[FREE])
    best, _, _ = optimise(rng, ready, state[FREE], [np.arange(len(FREE))])
    best, _, _ = optimise(rng, ready, best, CHAINS, 0.5)
    goal = _ends(skeleton, best)
    distance: dict[str, list[float]] = {name: [] for name in METHODS}
    sizes = []
    for _ in range(parameters["displacements"]):
        push = rng.normal(size=len(MOVED))
        size = rng.uniform(*DEGREES)
        start = best.copy()
        start[MOVED] += np.radians(size) * push / np.linalg.norm(push)
        start = np.clip(start, skeleton.limits.low[FREE], skeleton.limits.high[FREE])
        seed = int(rng.integers(2**31))
        sizes.append(size)
        for name in METHODS:
            tracker = make_tracker(skeleton, replace(preset, optimiser=kehl_runs.preset_of(name).optimiser))
            ready = make_cue_frame(tracker, seen, start)
            found, _, _ = optimise(np.random.default_rng(seed), ready, start, [ARM], 0.5)
            distance[name].append(float(np.linalg.norm(_ends(skeleton, found) - goal, axis=1).max()))
    return {"distance_m": distance, "degrees": sizes}


def _ends(skeleton, parameters: np.ndarray) -> np.ndarray:
    state = np.zeros(27)
    state[FREE] = parameters
    return landmarks(skeleton, state)[ENDS]


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """How often either way leads back."""
    figure, axes = plt.subplots(figsize=(6, 3.5))
    rows, escaped = [], {}
    for name, title in METHODS.items():
        distance = np.concatenate([np.array(one.results["distance_m"][name], float) for one in cells])
        escaped[name] = int((distance < NEAR_M).sum())
        color = COLORS["sparse"] if name == "SMD" else COLORS["naive"]
        axes.plot(np.sort(1000 * distance), np.arange(1, len(distance) + 1), color=color, label=title, drawstyle="steps-post")
        rows.append({"sampling": title, "displacements": len(distance), "led_back": escaped[name],
                     "median_distance_mm": float(1000 * np.median(distance))})  # fmt: skip
    axes.axvline(1000 * NEAR_M, color=COLORS["paper"], linewidth=1, linestyle="--")
    axes.set(xlabel="elbow or wrist off the best pose, the farther, mm", ylabel="displacements")
    axes.legend()
    detail = f"{escaped['SMD']} and {escaped['deterministic']} of {rows[0]['displacements']}"
    claims = (Claim("stochastic sampling leads back more often than deterministic", escaped["SMD"] > escaped["deterministic"], detail),)
    low, high = DEGREES
    caption = (
        f"A right arm displaced by {low:.0f} to {high:.0f} degrees; led back: elbow and wrist within {1000 * NEAR_M:.0f} mm. Figure 9."
    )
    return Report((Table("kehl-9", caption, rows),), {"kehl-9": figure}, claims)


EXPERIMENT = Experiment("kehl-9", "stochastic against deterministic sampling", "Kehl, Figures 9 and 10", grid, cell, report)
