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
from hmc.experiments.toy_likelihood import BOUNDS, moving_log_likelihood, target_path
from hmc.search import AnnealedSettings, annealed_step, particle_init

__all__ = ["EXPERIMENT"]

LAYERS = (1, 2, 3, 4, 5, 6, 8, 10, 12)
#: Within this distance of the target a frame counts as tracked.
NEAR = 0.4
#: P0, somewhat more than half of what the target moves in one frame at most.
SD = 0.6


def grid(plan: Plan) -> list[dict]:
    """Layers by particles a layer."""
    particles, repeats, frames = ((50, 100, 200), 8, 80) if plan.quick else ((25, 50, 100, 200, 400), 20, 120)
    return [
        {"layers": layers, "particles": n, "survival_rate": 0.5, "frames": frames, "repeats": repeats}
        for n in particles
        for layers in LAYERS
    ]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Follow the target several times; the share of frames in which the estimate is near it."""
    settings = AnnealedSettings(parameters["layers"], parameters["particles"], parameters["survival_rate"])
    path = target_path(parameters["frames"])
    tracked, errors = [], []
    for _ in range(parameters["repeats"]):
        state = particle_init(path[:1])
        for frame, target in enumerate(path):

            def log_likelihood(states, target=target, frame=frame):
                return moving_log_likelihood(states, target, frame)

            state, info = annealed_step(rng, state, log_likelihood, SD, *BOUNDS, settings)
            errors.append(float(np.linalg.norm(info.estimate - target)))
            tracked.append(errors[-1] < NEAR)
    return {"score": float(np.mean(tracked)), "mean_error": float(np.mean(errors))}


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The map of scores, and the scores by layers."""
    particles = sorted({one.parameters["particles"] for one in cells})
    score = np.array(
        [
            [
                next(one.results["score"] for one in cells if one.parameters["particles"] == n and one.parameters["layers"] == k)
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
    mean = score.mean(axis=1)
    best = int(mean.argmax())
    rows = [{"layers": one.parameters["layers"], "particles_a_layer": one.parameters["particles"], **one.results} for one in cells]
    claims = (
        Claim(
            "the best number of layers is neither the least nor the most", 0 < best < len(LAYERS) - 1, f"{LAYERS[best]}; the paper: about 4"
        ),
        Claim(
            "past it the score falls",
            bool(mean[-1] < mean[best] - 0.02),
            ", ".join(f"{k}: {value:.3f}" for k, value in zip(LAYERS, mean, strict=True)),
        ),
    )
    caption = f"Share of frames tracked to within {NEAR:g}, survival rate .5. The paper: Canton, Figure 3.5."
    return Report((Table("fig-3.5", caption, rows),), {"fig-3.5": figure}, claims)


EXPERIMENT = Experiment("fig-3.5", "over-annealing: layers by particles a layer", "Canton, Figure 3.5", grid, cell, report)
