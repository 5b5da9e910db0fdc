"""Figure 3.3: particle filter and annealed particle filter on likelihoods with several peaks.

Source: Canton (2009), section 3.2. Shown there without figures: with as many particles in all, and 3 layers, the particle filter's mean is
misled by the lower peaks and the annealed one's lies on the highest. The thesis does not state its function: here a family of them is
drawn, each with several seeds. The survival rate is .5, as section 3.2.2 has it for all layers; beside it a lower rate, and twice the
layers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.style import COLORS
from hmc.experiments.run_means import gains, mean_interval, run_values
from hmc.experiments.toy_likelihood import BOUNDS, drawn_peaks, log_mixture
from hmc.search import AnnealedSettings, filter_layer, normalise, particle_init, sir_step, spread_scale, truncated_drift

__all__ = ["EXPERIMENT"]

PF, PRINTED = "PF", "APF"
#: What is compared: survival rate and layers of the annealed filters. The last two keep as small a share of the particles in all, .016.
METHODS: dict[str, tuple[float | None, int]] = {PF: (None, 1), PRINTED: (0.5, 3), "APF, rate .25": (0.25, 3), "APF, 6 layers": (0.5, 6)}
#: Particles in all.
PARTICLES = 300
SD = 5.0
#: An estimate within so many widths of the highest peak lies on it.
ON_PEAK = 2.0


def grid(plan: Plan) -> list[dict]:
    """Every filter on every function, several times; equally many particles in all."""
    functions, repeats = (12, 5) if plan.quick else (50, 20)
    return [
        {"method": name, "layers": layers, "particles": PARTICLES // layers, "survival_rate": rate, "function": function, "repeat": k}
        for name, (rate, layers) in METHODS.items()
        for function in range(functions)
        for k in range(repeats)
    ]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """One instant from a particle in the middle; the estimate, and once a filter the particles of every layer."""
    settings = AnnealedSettings(parameters["layers"], parameters["particles"], parameters["survival_rate"] or 1.0)
    peaks = drawn_peaks(parameters["function"])

    def log_likelihood(states: np.ndarray) -> np.ndarray:
        return log_mixture(states, peaks)

    state, layers = particle_init(np.zeros((1, 1))), []
    if parameters["survival_rate"] is None:
        state, _ = sir_step(rng, state, log_likelihood, truncated_drift(SD, *BOUNDS), settings.layer_particles(0))
        layers = [(state.particles[:, 0], normalise(state.log_weights))]
    else:
        rates: list[float] = []
        for layer in range(settings.layers):
            drift = truncated_drift(SD, *BOUNDS, spread_scale(settings.spread, rates))
            state, info = filter_layer(rng, state, log_likelihood, drift, settings.layer_particles(layer), settings.layer_survival(layer))
            rates.append(info.survival_rate)
            layers.append((state.particles[:, 0], normalise(state.log_weights)))
    shown = layers if parameters["repeat"] == parameters["function"] == 0 else []
    return {"estimate": float(state.mean[0]), "layers": [{"x": x, "weight": weight} for x, weight in shown]}


def _distance(one: Cell) -> float:
    """From the highest peak, in its widths."""
    _, place, width = drawn_peaks(one.parameters["function"])[0]
    return abs(one.results["estimate"] - place) / width


def _on_peak(one: Cell) -> float:
    return float(_distance(one) < ON_PEAK)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The particles of one run each, and where the estimates of all functions lie."""
    places = np.linspace(*BOUNDS, 800)
    likelihood = np.exp(log_mixture(places[:, None]))
    figure, panels = plt.subplots(len(METHODS), 2, figsize=(8, 7.5), width_ratios=(2, 1))
    groups = {name: [one for one in cells if one.parameters["method"] == name] for name in METHODS}
    rows = []
    for (left, right), (name, own), color in zip(
        panels, groups.items(), (COLORS[key] for key in ("particle", "sparse", "naive", "person")), strict=True
    ):
        shown = next((one.results for one in own if one.results["layers"]), None)
        left.plot(places, likelihood, color=COLORS["paper"], linewidth=1)
        for layer, kept in enumerate(shown["layers"] if shown else ()):
            size = 400 * np.array(kept["weight"])
            low = np.full(len(size), -0.12 * (layer + 1))
            left.scatter(kept["x"], low, s=np.maximum(size, 0.3), color=color, alpha=0.6, linewidth=0)
        if shown:
            left.axvline(shown["estimate"], color=color, linestyle="--", linewidth=1)
        left.set(ylabel=name, yticks=(0, 0.5, 1))
        right.hist([min(_distance(one), 20.0) for one in own], bins=np.linspace(0, 20, 41), color=color)
        near, on = (mean_interval(run_values(own, value, "function")) for value in (_distance, _on_peak))
        rate, layers = METHODS[name]
        rows.append({"method": name, "survival_rate": rate, "layers": layers, "particles": PARTICLES, "runs": len(own),
                     "distance_in_widths": near.value, "distance_low": near.low, "distance_high": near.high,
                     "on_the_highest_peak": on.value, "on_low": on.low, "on_high": on.high})  # fmt: skip
    panels[-1, 0].set_xlabel("state; layers from top to bottom, the estimate dashed")
    panels[-1, 1].set_xlabel("estimates of all runs: widths\nfrom the highest peak (20: or more)")
    claims = (
        _ahead("the annealed filter's estimate is nearer to the highest peak", groups[PF], groups[PRINTED], _distance, "widths"),
        _ahead("it lies on the peak in more runs than the particle filter's", groups[PRINTED], groups[PF], _on_peak, "of all runs"),
    )
    caption = (
        f"Estimates from {PARTICLES} particles on a family of functions; on the peak: within {ON_PEAK:g} of its widths. "
        "The paper: Canton, Figure 3.3, on one function that it does not state."
    )
    return Report((Table("fig-3.3", caption, rows),), {"fig-3.3": figure}, claims)


def _ahead(text: str, more: Sequence[Cell], less: Sequence[Cell], value: Callable[[Cell], float], unit: str) -> Claim:
    gain = mean_interval(gains(run_values(more, value, "function"), run_values(less, value, "function")))
    return decide(text, gain, f"by {gain.value:.2f} [{gain.low:.2f}, {gain.high:.2f}] {unit}")


EXPERIMENT = Experiment("fig-3.3", "particle filter and annealed one on several peaks", "Canton, Figure 3.3", grid, cell, report, version=2)
