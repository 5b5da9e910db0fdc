"""Why the printed filters are behind who walks: the error along the way, of the thesis's filters and of each with one thing changed; ours.

Samples and particles of Canton (2009, sections 4.3.2 and 4.3.3) have no motion model. What is changed stands in `CHANGES`; the preset
``default`` has all of these and moves its samples on with their person.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hmc.experiments import tracking_runs as runs
from hmc.experiments.engine.experiment import Cell, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.ratios import Parts, ratio_gain, ratio_interval
from hmc.io.results import TrackTable, read_centroids
from hmc.metrics.scores import evaluate_tracks
from hmc.tracking.trackers import TRACKERS

__all__ = ["EXPERIMENT"]

#: By name, the tracker and what is otherwise than in its preset ``canton2009``.
CHANGES: dict[str, tuple[str, dict]] = {
    "naive": ("naive", {}),
    "SS": ("sparse", {}),
    "SS, no sample in an empty voxel": ("sparse", {"solid": True}),
    "SS, half of the samples drawn anew": ("sparse", {"scouts": 0.5}),
    "SS, none in an empty voxel and half drawn anew": ("sparse", {"solid": True, "scouts": 0.5}),
    "PF": ("particle", {}),
    "PF, weights to the power of 20": ("particle", {"sharpness": 20.0}),
    "PF, no exclusion zones": ("particle", {"blocking": 0.0}),
}
#: What the whole difference is expected to come from.
CAUSES = {"SS": "SS, none in an empty voxel and half drawn anew", "PF": "PF, weights to the power of 20"}
#: Of a run's results: how far the estimate is behind who walks, metres, and in how many frames somebody does.
BEHIND = ("behind_m", "walking")
VOXEL_M = 0.05
NUMBERS = {"sparse": 800, "particle": 100}
#: Who is slower stands, who is faster walks, metres a second; speeds are over so many frames before and after.
STANDING_M_S, WALKING_M_S, REACH = 0.2, 0.7, 3


def grid(plan: Plan) -> list[dict]:
    """Every change on every recording, with three seeds where numbers are drawn."""
    return [
        {"recording": source.label, "voxel_m": VOXEL_M, "change": name, "repeat": seed}
        for source in runs.sources(plan)
        for name, (tracker, _) in CHANGES.items()
        for seed in range(1 if TRACKERS[tracker].particles is None else 3)
    ]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Sums of the errors of who stands and who walks, and of how far estimates are behind, against true centroids."""
    name, changes = CHANGES[parameters["change"]]
    method = TRACKERS[name]
    settings = method.settings("canton2009", color=False if method.uses_colors else None, particles=NUMBERS.get(name))
    tracker = method.tracker(replace(settings, **changes))
    run = {"recording": parameters["recording"], "voxel_m": parameters["voxel_m"], "color": False}
    tracks, _, fps = runs.follow(run, inputs, int(rng.integers(2**31)), tracker)
    return _errors(tracks, read_centroids(inputs.truth(parameters["recording"])), fps)


def _errors(tracks: TrackTable, truth: TrackTable, fps: float) -> Results:
    places = {(f, p): xy for f, p, xy in zip(truth.frames.tolist(), truth.persons.tolist(), truth.positions[:, :2], strict=True)}
    found = {"standing": 0, "standing_m": 0.0, "walking": 0, "walking_m": 0.0, "behind_m": 0.0}
    for row, other in evaluate_tracks(tracks, truth).matched:
        frame, person = int(truth.frames[row]), int(truth.persons[row])
        before, after = (places.get((frame + step, person)) for step in (-REACH, REACH))
        if before is None or after is None:
            continue
        velocity = (after - before) * fps / (2 * REACH)
        speed, off = float(np.hypot(*velocity)), tracks.positions[other, :2] - places[frame, person]
        if speed < STANDING_M_S:
            found["standing"] += 1
            found["standing_m"] += float(np.hypot(*off))
        elif speed > WALKING_M_S:
            found["walking"] += 1
            found["walking_m"] += float(np.hypot(*off))
            found["behind_m"] -= float(off @ velocity) / speed
    return found


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row a change, and whether the causes named are the causes."""
    rows: list[dict] = []
    for name in CHANGES:
        own = _of(cells, name)
        standing, walking, behind = (
            ratio_interval(own, _mean(*names)) for names in (("standing_m", "standing"), ("walking_m", "walking"), BEHIND)
        )
        rows.append({"tracker": name, "runs": len(own), "standing_mm": standing.value, "walking_mm": walking.value,
                     "behind_mm": behind.value, "behind_low": behind.low, "behind_high": behind.high})  # fmt: skip
    claims = []
    for name, changed in CAUSES.items():
        late, gain = ratio_interval(_of(cells, name), _mean(*BEHIND)), ratio_gain(_of(cells, name), _of(cells, changed), _mean(*BEHIND))
        claims.append(decide(f"{name} as printed is behind who walks", late, f"by {late} mm"))
        claims.append(decide(f"{name} is less behind with this changed: {changed.partition(', ')[2]}", gain, f"by {gain} mm"))
    caption = (
        f"Errors against true centroids of who stands (below {STANDING_M_S} m/s) and walks (above {WALKING_M_S} m/s), and how far the "
        f"estimate is behind along the way; preset canton2009 without color, voxels of {100 * VOXEL_M:g} cm."
    )
    return Report((Table("why-behind", caption, rows),), {}, tuple(claims))


def _of(cells: Sequence[Cell], name: str) -> list[Cell]:
    return [one for one in cells if one.parameters["change"] == name]


def _mean(total: str, count: str) -> Parts:
    return lambda one: (1000 * one.results[total], float(one.results[count]))


EXPERIMENT = Experiment("why-behind", "why the printed filters are behind who walks", "ours", grid, cell, report)
