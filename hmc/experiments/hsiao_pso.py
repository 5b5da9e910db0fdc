"""Hierarchical against flat swarms, three topologies, and SciPy's global optimisers at equal evaluations. Hsiao (2008), section 3.2.2.2.

Each optimiser minimises Eq. 3-27 as printed, for the thesis's skeleton and the same curves (read by the modified method as we have it, all
six parts found), from the same place, with the spin unknown within a right angle; what counts is the error that it ends with, and the
distance of the landmarks from the true ones. The thesis says that in stages fewer particles are needed, and has one global best. Quick:
about five minutes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import differential_evolution, dual_annealing

from hmc.body.spin_skeleton import model_of_height, skeleton_landmarks
from hmc.experiments.engine.experiment import Cell, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.ratios import Parts, ratio_gain
from hmc.experiments.engine.selection import REPEAT
from hmc.experiments.engine.style import COLORS
from hmc.experiments.hsiao_runs import VOXEL_M, person_hulls, sequences
from hmc.experiments.truth import HEIGHT_M, first_truth, stature_m
from hmc.pose.objectives.curves import curves_of, observe_curves, skeleton_error
from hmc.pose.spectral.reading import read_body
from hmc.pose.steps.swarm.fit import FitSettings, bounds_around, fit_cost, fit_flat, fit_hierarchical, rest_state
from hmc.pose.steps.swarm.heading import heading_of, spin_towards
from hmc.search.swarm import PsoSettings

__all__ = ["EXPERIMENT"]

METHODS = (
    "hierarchical, global", "hierarchical, ring", "hierarchical, swarms", "flat, global", "flat, ring", "flat, swarms",
    "differential evolution", "dual annealing",
)  # fmt: skip
HIERARCHICAL, FLAT = METHODS[0], METHODS[3]
_NAMES = ("s1_wave", "s2_throw_ball", "s3_throw_item", "s4_struggle", "s6_close_door", "s9_lift_drop")
#: Particles of a flat swarm; every so many frames are fitted; seeds.
PARTICLES, EVERY, EVERY_FULL, SEEDS = 50, 15, 30, 3
SPIN = np.pi / 2


def grid(plan: Plan) -> list[dict]:
    """A cell a sequence and seed."""
    labels = [source.label for source in (sequences(plan, _NAMES) if plan.quick else sequences(plan))]
    return [
        {"recording": label, "every": EVERY if plan.quick else EVERY_FULL, REPEAT: k}
        for label in labels
        for k in range(1 if plan.quick else SEEDS)
    ]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Every optimiser on some frames whose parts were all found."""
    recording = inputs.recording(parameters["recording"])
    truth = first_truth(recording)
    height = stature_m(recording) or HEIGHT_M
    model = model_of_height(height, thesis=True)
    rows = []
    for step, grid_, voxels, votes in person_hulls(recording):
        if step.index % parameters["every"] or step.index not in truth.frames:
            continue
        reading = read_body(voxels, grid_.centres(voxels), VOXEL_M, height, None, votes)
        heading = heading_of(reading.feet)
        if not reading.segmentation.whole or heading is None:
            continue
        true = truth.positions[truth.frames == step.index][0]
        observed = observe_curves(model, curves_of(reading, feet=True), 8, named=False)
        trunk = reading.curves["trunk"]
        start = rest_state(model, trunk.mean(0), trunk[-1] - trunk[0])
        start[6] = spin_towards(start, heading)
        budget = 0
        for method in METHODS:
            kind, _, name = method.partition(", ")
            topology: Any = name
            if kind == "hierarchical":
                found = fit_hierarchical(
                    rng, model, observed, start, FitSettings(swarm=PsoSettings(topology=topology), limbs_stay=False), SPIN, 0.0
                )
                state, spent, budget = found.state, found.evaluations, max(budget, found.evaluations)
            elif kind == "flat":
                swarm = PsoSettings(PARTICLES, budget // PARTICLES - 1, topology=topology)
                found = fit_flat(rng, model, observed, start, swarm, SPIN, 0.0)
                state, spent = found.state, found.evaluations
            else:
                state, spent = _by_scipy(rng, method, model, observed, start, budget)
            error = 1000 * float(skeleton_error(model, state[None], observed)[0][0])
            joints = 1000 * float(np.linalg.norm(skeleton_landmarks(model, state) - true, axis=1).mean())
            rows.append([step.index, METHODS.index(method), error, joints, spent])
    return {"rows": np.array(rows).reshape(-1, 5)}


def _by_scipy(rng, method, model, observed, start, budget) -> tuple[np.ndarray, int]:
    """The state that one of SciPy's optimisers ends with, and its evaluations."""
    low, high = bounds_around(model, start, 0.25, 4 * np.pi)
    low[6], high[6] = start[6] - SPIN, start[6] + SPIN
    spent = 0

    def cost(values: np.ndarray, /) -> Any:
        nonlocal spent
        states = np.atleast_2d(values.T)
        spent += len(states)
        errors = fit_cost(model, states, observed)
        return errors if values.ndim > 1 else float(errors[0])

    bounds: Any = list(zip(low.tolist(), high.tolist(), strict=True))
    found: Any
    if method == "differential evolution":
        members = 2 * len(start)
        found = differential_evolution(
            cost,
            bounds,
            maxiter=budget // members - 1,
            popsize=2,
            rng=rng,
            vectorized=True,
            updating="deferred",
            polish=False,
            tol=0,
            x0=start,
        )
    else:
        found = dual_annealing(cost, bounds, maxfun=budget, rng=rng, x0=start)
    return found.x, spent


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row an optimiser."""
    rows = np.concatenate([np.array(one.results["rows"], float).reshape(-1, 5) for one in cells])
    table = []
    for k, method in enumerate(METHODS):
        own = rows[rows[:, 1] == k]
        if len(own):
            table.append(
                {
                    "optimiser": method, "fits": len(own), "median_error_mm": np.median(own[:, 2]), "worst_error_mm": own[:, 2].max(),
                    "stuck_percent": 100 * np.mean(own[:, 2] > 80), "landmarks_mm": np.median(own[:, 3]), "evaluations": own[:, 4].mean(),
                }
            )  # fmt: skip
    gain = ratio_gain(cells, cells, _errors(FLAT), smaller_parts=_errors(HIERARCHICAL))
    claims = (decide("hierarchical swarms end with a smaller error than flat ones at equal evaluations", gain, f"by {gain} mm"),)
    figure, ax = plt.subplots(figsize=(7, 3.2))
    ax.boxplot([rows[rows[:, 1] == k, 2] for k in range(len(METHODS))], tick_labels=METHODS, medianprops={"color": COLORS["sparse"]})
    ax.tick_params(axis="x", rotation=30)
    ax.set_ylabel("error (mm)")
    return Report((Table("hsiao-pso", "Optimisers at equal evaluations.", table),), {"hsiao-pso": figure}, claims)


def _errors(method: str) -> Parts:
    """Sum of the errors with which a method ends, mm, and number of fits."""

    def parts(one: Cell) -> tuple[float, float]:
        rows = np.array(one.results["rows"], float).reshape(-1, 5)
        errors = rows[rows[:, 1] == METHODS.index(method), 2]
        return float(errors.sum()), float(len(errors))

    return parts


EXPERIMENT = Experiment("hsiao-pso", "hierarchical against flat swarms and SciPy", "Hsiao, 3.2.2.2", grid, cell, report, version=2)
