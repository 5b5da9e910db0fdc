"""Figure 7.8: effective particles behind the variables of every model, and how far their spread has fallen in every layer.

Source: Canton (2009), Eq. 7.20 and 7.23 to 7.29, with the printed settings. Nothing is estimated: it is the plan of the filter.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.search.structural import StructuralSettings, spread_schedule

__all__ = ["EXPERIMENT"]

#: Dimensions that each model adds (Eq. 7.19).
ADDED = (6, 10, 6)


def grid(plan: Plan) -> list[dict]:
    """One cell: the printed settings."""
    return [{"added": list(ADDED)}]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Effective particles of each model's variables, and their spread in every layer."""
    settings, added = StructuralSettings(), np.array(parameters["added"])
    particles = settings.particles(added)
    group = np.repeat(np.arange(len(added)), added)
    first = np.searchsorted(group, np.arange(len(added)))
    spreads = [spread_schedule(group, k, layer, settings)[first] for k in range(len(added)) for layer in range(settings.layers)]
    effective = np.cumsum((particles * settings.layers)[::-1])[::-1]
    return {"particles": particles, "effective": effective, "spread": np.array(spreads), "layers": settings.layers}


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Bars of effective particles, and a line a model of its variables' spread."""
    found = cells[0].results
    particles, effective, spread = (np.array(found[name]) for name in ("particles", "effective", "spread"))
    layers = int(found["layers"])
    rows = [
        {"variables_of_model": k + 1, "particles": int(particles[k]), "effective_particles": int(effective[k]),
         "spread_in_the_last_layer": float(spread[-1, k])}
        for k in range(len(particles))
    ]  # fmt: skip
    figure, (bars, lines) = plt.subplots(1, 2, figsize=(7.5, 3))
    bars.bar(range(1, len(effective) + 1), effective)
    bars.set(xlabel="variables of model", ylabel="effective particles", xticks=range(1, len(effective) + 1))
    steps = 1 + np.arange(len(spread)) / layers
    for k in range(len(particles)):
        own = spread[:, k] > 0
        lines.plot(steps[own], spread[own, k], "o-", label=f"variables of model {k + 1}")
    lines.set(xlabel="model (between: inner layers)", ylabel="spread over the first")
    lines.legend()
    claims = (
        Claim("the trunk's variables are filtered by most particles", bool(np.all(np.diff(effective) < 0)), f"{effective.tolist()}"),
        Claim("1,100 particles in all, 300, 500 and 300", particles.tolist() == [300, 500, 300], f"{particles.tolist()}"),
    )
    return Report((Table("fig-7.8", "The printed plan of SHBM-APF (Canton, Figure 7.8).", rows),), {"fig-7.8": figure}, claims)


EXPERIMENT = Experiment("fig-7.8", "effective particles and spread by model", "Canton, Figure 7.8", grid, cell, report)
