"""Figure 6.11: the likelihood over two angles of a hip, score by score.

Source: Canton (2009), section 6.5.1.2: out and occupancy, then double occupancy, the surface by itself, and all together; here in the
factorised likelihood (Table 6.2). Every other angle is that of the true pose, read as a pose of the thesis's body.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from scipy import ndimage

from hmc.body.flesh import flesh_points
from hmc.body.inverse import fit_landmarks
from hmc.body.joints import DOF_NAMES
from hmc.body.proportions import canton_body
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.intervals import Interval, decide
from hmc.experiments.engine.style import COLORS
from hmc.experiments.markerless_runs import FRONTEND, MASKS_KEY, action_sources, tracked
from hmc.experiments.run_means import gains, mean_interval
from hmc.experiments.truth import HEIGHT_M, first_truth, standing_state, stature_m
from hmc.io.masks import kept_masks
from hmc.io.results import TrackTable
from hmc.pose.objectives.four_scores import SCORES, ScoreVariances, log_likelihood_factorised, make_score_table, observe, scores
from hmc.pose.views.person_view import views_of
from hmc.tracking.resumable import person_grid
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import stream_hulls

__all__ = ["EXPERIMENT", "count_modes"]

#: Panels, and the scores that each takes.
PANELS = {
    "out and occupancy": ("out", "empty"),
    "and double occupancy": ("out", "empty", "double_occupancy"),
    "surface": ("surface",),
    "all": SCORES,
}
ANGLES = ("r_hip_x", "r_hip_y")
#: Points a side of the map, and the voxel size, metres.
SIDE, VOXEL_M = 61, 0.02
#: A mode is a highest point within this many points each way, at least this likely against the best.
REACH, LEAST = 3, 0.05
#: Depth of the picture, in units of the log-likelihood.
DEPTH = 30.0


def grid(plan: Plan) -> list[dict]:
    """Some frames of walks and jogs (quick: of one walk), as shares of their length."""
    sources = action_sources(plan, ("walk",) if plan.quick else ("walk", "jog"))[: 1 if plan.quick else None]
    shares = tuple(k / 12 for k in range(1, 12, 2)) if plan.quick else tuple(k / 20 for k in range(1, 20, 2))
    return [{"recording": source.label, "at": at} for source in sources for at in shares]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """The four scores of every part over the map, as log-likelihoods by panel; degrees."""
    seen = tracked(inputs, parameters["recording"], 0)
    recording, masks = seen.recording, seen.masks
    truth = first_truth(recording)
    k = int(parameters["at"] * len(truth.frames))
    frame, points = int(truth.frames[k]), truth.positions[k]
    room_grid = person_grid(recording, VOXEL_M)
    kept = kept_masks(masks, MASKS_KEY, frame, frame + 1)
    hull = next(iter(stream_hulls(recording, room_grid, FRONTEND, first=frame, last=frame + 1, masks=kept, on_problem=lambda line: None)))
    where = TrackTable(np.array([frame]), np.array([0]), points.mean(axis=0)[None])
    target = views_of(recording, room_grid, where, hull)[0].target
    if target is None:
        return {"degrees": [], "log_likelihood": [], "true_degrees": []}
    body = canton_body(stature_m(recording) or HEIGHT_M)
    state, _ = fit_landmarks(body, points, standing_state(body, points))
    places = [DOF_NAMES.index(name) for name in ANGLES]
    axes = [np.linspace(body.limits.low[place], body.limits.high[place], SIDE) for place in places]
    states = np.tile(state, (SIDE * SIDE, 1))
    states[:, places] = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    around = VoxelGrid(target.origin - 0.5 * target.voxel_size_m, target.voxel_size_m, target.distance.shape)
    values = scores(make_score_table(body, flesh_points(body, VOXEL_M)), states, observe(target.tolerant, around, recording.room))
    variances = ScoreVariances().by_part()
    maps = []
    for names in PANELS.values():
        columns = [SCORES.index(name) for name in names]
        maps.append(log_likelihood_factorised(values[..., columns], variances[:, columns]).reshape(SIDE, SIDE))
    return {"degrees": np.degrees(axes), "log_likelihood": maps, "true_degrees": np.degrees(state[places])}


def count_modes(log_likelihood: np.ndarray) -> int:
    """Modes of a map: highest points of their surroundings that are not much less likely than the best; a plateau is one."""
    return _modes(log_likelihood)[1]


def _modes(log_likelihood: np.ndarray) -> tuple[np.ndarray, int]:
    """The points of a map that are modes, and how many modes they make."""
    highest = log_likelihood >= ndimage.maximum_filter(log_likelihood, 2 * REACH + 1)
    likely = log_likelihood >= log_likelihood.max() + np.log(LEAST)
    return highest & likely, int(ndimage.label(highest & likely, np.ones((3, 3)))[1])


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The maps of one frame; modes, sharpness and distance from the truth over all."""
    whole = [one for one in cells if len(one.results["log_likelihood"])]
    rows: list[dict[str, Any]] = []
    for k, panel in enumerate(PANELS):
        maps = [np.array(one.results["log_likelihood"][k]) for one in whole]
        off = [_off_degrees(one, values) for one, values in zip(whole, maps, strict=True)]
        rows.append(
            {
                "scores": panel,
                "frames": len(maps),
                "modes": float(np.mean([count_modes(values) for values in maps])),
                "width_percent": float(100 * np.mean([np.exp(values - values.max()).mean() for values in maps])),
                "best_off_truth_deg": float(np.mean(off)),
                "spread_deg": float(np.mean([_spread_degrees(one, k) for one in whole])),
                "expected_off_truth_deg": float(np.mean([_expected_off_degrees(one, _map(one, k)) for one in whole])),
            }
        )
    modes = {panel: _by_frame(whole, partial(_n_modes, panel=k)) for k, panel in enumerate(PANELS)}
    spread = {panel: _by_frame(whole, partial(_spread_degrees, panel=k)) for k, panel in enumerate(PANELS)}
    anywhere = _by_frame(whole, lambda one: _expected_off_degrees(one, np.zeros_like(_map(one, 0))))
    there = mean_interval(gains(anywhere, _by_frame(whole, lambda one: _expected_off_degrees(one, _map(one, len(PANELS) - 1)))))
    first, second, last = "out and occupancy", "and double occupancy", "all"
    claims = (
        _more("double occupancy takes modes away", modes[first], modes[second], "modes fewer", there),
        _more("all scores together leave fewer modes than out and occupancy", modes[first], modes[last], "modes fewer", there),
        _more("the surface sharpens", spread[second], spread[last], "degrees less spread", there),
    )
    caption = (
        f"Likelihood over {ANGLES[0]} and {ANGLES[1]}; its width is its mean against its best, its spread is about its own mean. "
        "The paper: Canton, Figure 6.11, surfaces without numbers."
    )
    return Report((Table("fig-6.11", caption, rows),), {"fig-6.11": _draw(whole[len(whole) // 2])}, claims)


def _map(one: Cell, panel: int) -> np.ndarray:
    return np.array(one.results["log_likelihood"][panel], float)


def _by_frame(cells: Sequence[Cell], value: Callable[[Cell], float]) -> dict:
    return {(one.parameters["recording"], one.parameters["at"]): float(value(one)) for one in cells}


def _more(text: str, first: dict, second: dict, what: str, there: Interval) -> Claim:
    """That the first figure is larger; nothing is claimed of a likelihood that is no nearer to the truth than any place is."""
    gain = mean_interval(gains(first, second))
    return decide(text, (gain, there), f"{gain.value:.2f} [{gain.low:.2f}, {gain.high:.2f}] {what}")


def _n_modes(one: Cell, panel: int) -> float:
    return float(count_modes(_map(one, panel)))


def _spread_degrees(one: Cell, panel: int) -> float:
    """Spread of the likelihood about its own mean; that few points carry it makes it no smaller."""
    points = np.stack(np.meshgrid(*np.array(one.results["degrees"]), indexing="ij"), axis=-1).reshape(-1, 2)
    values = _map(one, panel)
    weights = np.exp(values - values.max()).ravel()
    weights /= weights.sum()
    variance = (weights @ (points - weights @ points) ** 2).sum() / max(1 - weights @ weights, 1e-9)
    return float(np.sqrt(variance))


def _expected_off_degrees(one: Cell, values: np.ndarray) -> float:
    """Mean distance of the map's points from the truth, by likelihood."""
    first, second = np.array(one.results["degrees"])
    away = np.hypot(first[:, None] - one.results["true_degrees"][0], second - one.results["true_degrees"][1])
    weights = np.exp(values - values.max())
    return float((away * weights).sum() / weights.sum())


def _off_degrees(one: Cell, values: np.ndarray) -> float:
    best = np.unravel_index(values.argmax(), values.shape)
    degrees = np.array(one.results["degrees"])
    return float(np.hypot(*(degrees[axis][best[axis]] - one.results["true_degrees"][axis] for axis in (0, 1))))


def _draw(one: Cell) -> plt.Figure:
    """Log-likelihood below the best, with modes and the truth: on a plain scale all but the best point would look the same."""
    figure, panels = plt.subplots(2, 2, figsize=(7.4, 6), sharex=True, sharey=True)
    first, second = np.array(one.results["degrees"])
    colors = ScalarMappable(Normalize(-DEPTH, 0), "viridis")
    for k, (axes, panel) in enumerate(zip(panels.flat, PANELS, strict=True)):
        values = np.array(one.results["log_likelihood"][k])
        axes.pcolormesh(first, second, (values - values.max()).T, norm=colors.norm, cmap="viridis", shading="nearest")
        i, j = np.nonzero(_modes(values)[0])
        axes.plot(first[i], second[j], "o", color=COLORS["other"], fillstyle="none", label="mode")
        axes.plot(*one.results["true_degrees"], "+", color="white", markersize=9, markeredgewidth=1.5, label="truth")
        axes.grid(False)
        n = count_modes(values)
        axes.set_title(f"{panel}: {n} mode{'s' if n > 1 else ''}")
    for axes in panels[-1]:
        axes.set_xlabel(f"{ANGLES[0]} (degrees)")
    for axes in panels[:, 0]:
        axes.set_ylabel(f"{ANGLES[1]} (degrees)")
    panels[0, 0].legend(facecolor="0.6", frameon=True)
    figure.colorbar(colors, ax=panels, label="log-likelihood below the best")
    return figure


EXPERIMENT = Experiment("fig-6.11", "likelihood over two hip angles, score by score", "Canton, Figure 6.11", grid, cell, report)
