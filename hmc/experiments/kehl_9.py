"""Figures 9 and 10: stochastic against deterministic sampling, from a displaced arm.

Source: Kehl (2006), section 7.1. There one arm is moved by 18 and 6 degrees at shoulder and elbow; here it is done 50 times a run, in
random directions, of three people, with the descent as printed and in the house's form. The best pose is what the descent finds from the
true one with five times the samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from hmc.body.inverse import fit_landmarks
from hmc.body.joints import N_DOF, dof_index
from hmc.body.kinematics import landmarks
from hmc.body.proportions import default_body
from hmc.body.solids import CHAINS, FREE, FREE_NAMES, GROUPS
from hmc.experiments import kehl_runs
from hmc.experiments.drill_clips import clip_names
from hmc.experiments.engine.experiment import Cell, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.ratios import Parts, ratio_gain, ratio_interval
from hmc.experiments.engine.style import COLORS
from hmc.experiments.truth import HEIGHT_M, first_truth, standing_state, stature_m
from hmc.landmarks import LANDMARKS
from hmc.pose.steps.descent.tracker import make_cue_frame, make_tracker, optimise

__all__ = ["EXPERIMENT"]

DISPLACEMENTS, DEGREES = 50, (15.0, 45.0)
MOVED = np.array([FREE_NAMES.index(name) for name in ("r_shoulder_x", "r_shoulder_y", "r_shoulder_z", "r_elbow_z")])
ARM = CHAINS[GROUPS.index("r_arm") - 1]
ENDS = [LANDMARKS.index(name) for name in ("r_elbow", "r_wrist")]
#: Escaped: elbow and wrist within this of where they are in the best pose, metres.
NEAR_M = 0.05
METHODS = {"stochastic": "smd", "deterministic": "deterministic"}
#: Whose descent, and what it is called.
PRESETS = {"SMD, as printed": "as printed", "SMD": "default"}
#: Each clip at three seconds.
SECONDS = (2.6, 3.0, 3.4)


def grid(plan: Plan) -> list[dict]:
    """Every clip at three seconds, with either preset; quick: one clip."""
    sources = plan.recordings or tuple(rendered(name) for name in clip_names("pedal_arms")[: 1 if plan.quick else None])
    return [
        {"recording": source.label, "preset": preset, "displacements": DISPLACEMENTS, "second": second}
        for source in sources
        for second in SECONDS
        for preset in PRESETS
    ]


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
    preset = kehl_runs.preset_of(parameters["preset"])
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
        for name, optimiser in METHODS.items():
            tracker = make_tracker(skeleton, replace(preset, optimiser=optimiser))
            ready = make_cue_frame(tracker, seen, start)
            found, _, _ = optimise(np.random.default_rng(seed), ready, start, [ARM], 0.5)
            distance[name].append(float(np.linalg.norm(_ends(skeleton, found) - goal, axis=1).max()))
    return {"distance_m": distance, "degrees": sizes}


def _ends(skeleton, parameters: np.ndarray) -> np.ndarray:
    state = np.zeros(N_DOF)
    state[FREE] = parameters
    return landmarks(skeleton, state)[ENDS]


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """How often either way leads back."""
    figure, panels = plt.subplots(1, len(PRESETS), figsize=(9, 3.5), sharey=True)
    rows, claims = [], []
    for axes, (preset, family) in zip(panels, PRESETS.items(), strict=True):
        own = [one for one in cells if one.parameters["preset"] == preset]
        back = {name: ratio_interval(own, _led_back(name)) for name in METHODS}
        for name, found in back.items():
            distance = np.concatenate([np.array(one.results["distance_m"][name], float) for one in own])
            color = COLORS["sparse"] if name == "stochastic" else COLORS["naive"]
            share = np.arange(1, len(distance) + 1) / max(len(distance), 1)
            axes.plot(np.sort(1000 * distance), share, color=color, label=name, drawstyle="steps-post")
            rows.append({
                "sampling": name, "preset": family, "displacements": len(distance), "led_back_percent": found.value, "low": found.low,
                "high": found.high, "median_distance_mm": float(1000 * np.median(distance)) if len(distance) else None,
            })  # fmt: skip
        gain = ratio_gain(own, own, _led_back("stochastic"), smaller_parts=_led_back("deterministic"))
        detail = f"{back['stochastic']} and {back['deterministic']} %: more by {gain}"
        claims.append(decide(f"stochastic sampling, {family}, leads back more often than deterministic", gain, detail))
        axes.axvline(1000 * NEAR_M, color=COLORS["paper"], linewidth=1, linestyle="--")
        axes.set(xlabel="elbow or wrist off the best pose, the farther, mm", title=family)
    panels[0].set(ylabel="share of the displacements")
    panels[0].legend()
    low, high = DEGREES
    caption = (
        f"A right arm displaced by {low:.0f} to {high:.0f} degrees; led back: elbow and wrist within {1000 * NEAR_M:.0f} mm. Figure 9."
    )
    return Report((Table("kehl-9", caption, rows),), {"kehl-9": figure}, tuple(claims))


def _led_back(name: str) -> Parts:
    """Percentage of displacements."""

    def parts(one: Cell) -> tuple[float, float]:
        distance = np.array(one.results["distance_m"][name], float)
        return 100.0 * float((distance < NEAR_M).sum()), float(len(distance))

    return parts


EXPERIMENT = Experiment("kehl-9", "stochastic against deterministic sampling", "Kehl, Figures 9 and 10", grid, cell, report, version=2)
