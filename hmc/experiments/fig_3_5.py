"""Figure 3.5: over-annealing. A score by the number of layers and of particles a layer, with the survival rate held.

Source: Canton (2009), section 3.2.3: past about four layers the score falls, as the particles all gather in one peak, and when that turns
out to be the wrong one none is left elsewhere. The thesis does not state its data; here a target is followed which something passes that
looks more like it, for some frames of every period, until the two part (`hmc.experiments.toy_likelihood`).
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.intervals import decide
from hmc.experiments.run_means import gains, mean_interval, run_values
from hmc.experiments.toy_likelihood import BOUNDS, moving_log_likelihood, target_path
from hmc.search import AnnealedSettings, annealed_step, particle_init

__all__ = ["EXPERIMENT"]

#: Past so many layers the thesis's score falls.
PRINTED = 4
LAYERS = (1, 2, 3, 4, 5, 6, 8, 10, 12)
#: Within this distance of the target a frame counts as tracked.
NEAR = 0.4
#: P0, somewhat more than half of what the target moves in one frame at most.
SD = 0.6


def grid(plan: Plan) -> list[dict]:
    """Layers by particles a layer, several times."""
    particles, repeats, frames = ((50, 100, 200), 8, 80) if plan.quick else ((25, 50, 100, 200, 400), 20, 120)
    return [
        {"layers": layers, "particles": n, "survival_rate": 0.5, "frames": frames, "repeat": repeat}
        for n in particles
        for layers in LAYERS
        for repeat in range(repeats)
    ]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Follow the target once; the share of frames in which the estimate is near it."""
    settings = AnnealedSettings(parameters["layers"], parameters["particles"], parameters["survival_rate"])
    path = target_path(parameters["frames"])
    state, errors = particle_init(path[:1]), []
    for frame, target in enumerate(path):

        def log_likelihood(states, target=target, frame=frame):
            return moving_log_likelihood(states, target, frame)

        state, info = annealed_step(rng, state, log_likelihood, SD, *BOUNDS, settings)
        errors.append(float(np.linalg.norm(info.estimate - target)))
    return {"score": float(np.mean(np.array(errors) < NEAR)), "mean_error": float(np.mean(errors))}


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The map of scores, and the scores by layers."""
    particles = sorted({one.parameters["particles"] for one in cells})
    score = np.array(
        [
            [
                np.mean([one.results["score"] for one in cells if one.parameters["particles"] == n and one.parameters["layers"] == k])
                for n in particles
            ]
            for k in LAYERS
        ]
    )
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.4))
    picture = left.imshow(score, origin="lower", aspect="auto", cmap="viridis")
    left.set(xticks=range(len(particles)), xticklabels=particles, yticks=range(len(LAYERS)), yticklabels=LAYERS)
    left.set(xlabel="particles a layer", ylabel="layers")
    left.grid(False)
    figure.colorbar(picture, ax=left, label="frames tracked")
    for column, n in enumerate(particles):
        right.plot(LAYERS, score[:, column], "o-", label=f"{n}", color=plt.get_cmap("viridis")(0.9 * column / max(1, len(particles) - 1)))
    right.set(xlabel="layers", ylabel="frames tracked", ylim=(0, 1))
    right.legend(title="particles a layer")
    rows = [_row(cells, n, k) for n in particles for k in LAYERS]
    by_layers = {k: _by_seed(cells, k) for k in LAYERS}
    told = ", ".join(f"{k}: {np.mean(list(by_layers[k].values())):.3f}" for k in LAYERS)
    claims = (
        _better("some annealing helps", by_layers, PRINTED, LAYERS[0], told),
        _better("past four layers the score falls", by_layers, PRINTED, LAYERS[-1], told),
    )
    caption = f"Share of frames tracked to within {NEAR:g}, survival rate .5, with intervals over seeds. The paper: Canton, Figure 3.5."
    return Report((Table("fig-3.5", caption, rows),), {"fig-3.5": figure}, claims)


def _by_seed(cells: Sequence[Cell], layers: int) -> dict:
    """Scores of every seed, the mean over numbers of particles."""
    own = [one for one in cells if one.parameters["layers"] == layers]
    seeds = sorted({one.parameters["repeat"] for one in own})
    return {("", seed): float(np.mean([one.results["score"] for one in own if one.parameters["repeat"] == seed])) for seed in seeds}


def _row(cells: Sequence[Cell], particles: int, layers: int) -> dict:
    own = [one for one in cells if one.parameters["particles"] == particles and one.parameters["layers"] == layers]
    known = mean_interval(run_values(own, lambda one: one.results["score"], "none"))
    return {"layers": layers, "particles_a_layer": particles, "score": known.value, "score_low": known.low, "score_high": known.high,
            "mean_error": float(np.mean([one.results["mean_error"] for one in own]))}  # fmt: skip


def _better(text: str, by_layers: dict, more: int, less: int, told: str) -> Claim:
    gain = mean_interval(gains(by_layers[more], by_layers[less]))
    detail = f"{more} layers are better than {less} by {gain.value:.3f} [{gain.low:.3f}, {gain.high:.3f}]; {told}"
    return decide(text, gain, detail)


EXPERIMENT = Experiment("fig-3.5", "over-annealing: layers by particles a layer", "Canton, Figure 3.5", grid, cell, report, version=2)
