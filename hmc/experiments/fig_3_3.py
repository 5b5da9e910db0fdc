"""Figure 3.3: particle filter and annealed particle filter on a likelihood with several peaks.

Source: Canton (2009), section 3.2. Shown there without figures: with as many particles in all, the particle filter's mean is misled by the
lower peaks and the annealed one's lies on the highest. The thesis does not state its function; this one is ours.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.style import COLORS
from hmc.experiments.toy_likelihood import BOUNDS, PEAKS, log_mixture
from hmc.search import AnnealedSettings, filter_layer, normalise, particle_init, sir_step, spread_scale, truncated_drift

__all__ = ["EXPERIMENT"]

#: What is compared, and the survival rate of the annealed filters. The thesis's usual .5 leaves an eighth of the particles after three
#: layers, which decides little; it states none for this figure.
METHODS = {"PF": None, "APF": 0.25, "APF, rate .5": 0.5}
LAYERS, PARTICLES = 3, 100
SD = 5.0


def grid(plan: Plan) -> list[dict]:
    """Both filters, several times; equally many particles in all."""
    repeats = 10 if plan.quick else 100
    return [
        {"method": name, "layers": LAYERS, "particles": PARTICLES, "survival_rate": rate, "repeat": k}
        for name, rate in METHODS.items()
        for k in range(repeats)
    ]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """One instant from a particle in the middle; the estimate, and in the first repetition the particles of every layer."""
    settings = AnnealedSettings(parameters["layers"], parameters["particles"], parameters["survival_rate"] or 1.0)
    state, layers = particle_init(np.zeros((1, 1))), []
    if parameters["survival_rate"] is None:
        state, _ = sir_step(rng, state, log_mixture, truncated_drift(SD, *BOUNDS), settings.layers * settings.layer_particles(0))
        layers = [(state.particles[:, 0], normalise(state.log_weights))]
    else:
        rates: list[float] = []
        for layer in range(settings.layers):
            drift = truncated_drift(SD, *BOUNDS, spread_scale(settings.spread, rates))
            state, info = filter_layer(rng, state, log_mixture, drift, settings.layer_particles(layer), settings.layer_survival(layer))
            rates.append(info.survival_rate)
            layers.append((state.particles[:, 0], normalise(state.log_weights)))
    shown = layers if parameters["repeat"] == 0 else []
    return {"estimate": float(state.mean[0]), "layers": [{"x": x, "weight": weight} for x, weight in shown]}


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The particles of one run each, and where the estimates lie."""
    places = np.linspace(*BOUNDS, 800)
    likelihood = np.exp(log_mixture(places[:, None]))
    best = float(places[likelihood.argmax()])
    width = next(width for _, place, width in PEAKS if abs(place - best) < 0.5)
    figure, panels = plt.subplots(len(METHODS), 2, figsize=(8, 6), width_ratios=(2, 1))
    rows, off = [], {}
    for (left, right), name, color in zip(panels, METHODS, (COLORS["particle"], COLORS["sparse"], COLORS["naive"]), strict=True):
        own = [one.results for one in cells if one.parameters["method"] == name]
        left.plot(places, likelihood, color=COLORS["paper"], linewidth=1)
        for layer, shown in enumerate(own[0]["layers"]):
            size = 400 * np.array(shown["weight"])
            left.scatter(shown["x"], np.full(len(size), -0.12 * (layer + 1)), s=np.maximum(size, 0.3), color=color, alpha=0.6, linewidth=0)
        left.axvline(own[0]["estimate"], color=color, linestyle="--", linewidth=1)
        left.set(ylabel=name, yticks=(0, 0.5, 1))
        estimates = np.array([one["estimate"] for one in own])
        right.hist(estimates, bins=np.linspace(*BOUNDS, 41), color=color)
        right.axvline(best, color=COLORS["paper"], linewidth=1)
        off[name] = np.abs(estimates - best)
        rows.append({"method": name, "particles": LAYERS * PARTICLES, "mean_estimate": estimates.mean(), "global_maximum": best,
                     "mean_distance": off[name].mean(), "on_the_maximum": float((off[name] < 2 * width).mean())})  # fmt: skip
    panels[-1, 0].set_xlabel("state; layers from top to bottom, the estimate dashed")
    panels[-1, 1].set_xlabel("estimates of all runs")
    detail = ", ".join(f"{row['method']} {row['on_the_maximum']:.0%} of runs, {row['mean_distance']:.2f} off" for row in rows)
    claims = (
        Claim(
            "the annealed filter's estimate lies on the global maximum in most runs", bool((off["APF"] < 2 * width).mean() > 0.5), detail
        ),
        Claim("the particle filter's does not", bool((off["PF"] < 2 * width).mean() < 0.5), detail),
    )
    caption = f"Estimates from {LAYERS * PARTICLES} particles; on the maximum: within twice its width. The paper: Canton, Figure 3.3."
    return Report((Table("fig-3.3", caption, rows),), {"fig-3.3": figure}, claims)


EXPERIMENT = Experiment("fig-3.3", "particle filter and annealed one on several peaks", "Canton, Figure 3.3", grid, cell, report)
