"""Figure 4.12: two people who meet and go past each other, followed by Sparse Sampling with and without color.

Source: Canton (2009), section 4.4.2. Without color the thesis's tracks change identity where people cross; with color they do not.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import tracking_runs as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.experiments.tracking_intervals import ahead, is_followed, score_interval
from hmc.io.results import TrackTable, read_centroids
from hmc.view.plots import draw_tracks

__all__ = ["EXPERIMENT"]

#: Two people who are dressed differently; in the second a third stands by, in the third they are of one build.
CROSSINGS = ("pass_stop", "pass_beside", "pass_like")
SAMPLES = 400
VOXEL_M = 0.05
#: Least extent of the picture along y, metres.
LEAST_HEIGHT_M = 1.4


def grid(plan: Plan) -> list[dict]:
    """Both presets with and without color, several times."""
    sources = plan.recordings or tuple(rendered(name) for name in (CROSSINGS[:1] if plan.quick else CROSSINGS))
    return [
        runs.parameters_of(source.label, VOXEL_M, ("sparse", color), SAMPLES, preset, repeat)
        for source in sources
        for preset in runs.PRESETS
        for color in (False, True)
        for repeat in range(3 if plan.quick else 5)
    ]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Tracks and their mismatches; the first repeat keeps the tracks for the picture."""
    truth = read_centroids(inputs.truth(parameters["recording"]))
    tracks, timing, _ = runs.follow(parameters, inputs, int(rng.integers(2**31)))
    kept = {"tracks": _plain(tracks), "truth": _plain(truth)} if parameters["repeat"] == 0 else {}
    counts = {"rows": len(tracks.frames), "filter_s": timing.filter_s, "persons": len(np.unique(tracks.persons))}
    return {**runs.errors_of(tracks, truth), **counts, **kept}


def _plain(table: TrackTable) -> dict:
    return {"frames": table.frames, "persons": table.persons, "positions": table.positions.round(4)}


def _table(plain: dict) -> TrackTable:
    return TrackTable(np.array(plain["frames"], int), np.array(plain["persons"], int), np.array(plain["positions"], float).reshape(-1, 3))


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Tracks from above, and how often identities change."""
    first = cells[0].parameters["recording"]
    figure, axes = plt.subplots(len(runs.PRESETS), 2, figsize=(8, 2.2 * len(runs.PRESETS)), sharex=True, sharey=True)
    rows, groups = [], dict[tuple[str, bool], list[Cell]]()
    for row, preset in zip(axes, runs.PRESETS, strict=True):
        for ax, color in zip(row, (False, True), strict=True):
            own = [one for one in cells if (one.parameters["preset"], one.parameters["color"]) == (preset, color)]
            groups[preset, color] = own
            changes = [one.results["head"]["mismatches"] for one in own]
            mota = score_interval(own, "MOTA")
            rows.append(
                {
                    "preset": preset, "color": "yes" if color else "no", "runs": len(own), "mismatches_a_run": float(np.mean(changes)),
                    "runs_without_mismatch": sum(change == 0 for change in changes),
                    "identities_a_run": float(np.mean([one.results["persons"] for one in own])),
                    "MOTA_percent": mota.value, "MOTA_low": mota.low, "MOTA_high": mota.high,
                }
            )  # fmt: skip
            shown = next(one.results for one in own if one.parameters["recording"] == first and one.parameters["repeat"] == 0)
            draw_tracks(_table(shown["tracks"]), truth=_table(shown["truth"]), ax=ax)
            ax.set_title(f"{preset}, {'color' if color else 'raw'}")
            ax.get_legend().remove()
            middle, half = np.mean(ax.get_ylim()), max(np.ptp(ax.get_ylim()) / 2, LEAST_HEIGHT_M / 2)
            ax.set_ylim(middle - half, middle + half)
    handles = {label: handle for ax in axes.flat for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=len(handles))
    claims = []
    for preset in runs.PRESETS:
        with_color, without = (groups[preset, color] for color in (True, False))
        claims.append(ahead(f"{preset}: fewer changes of identity with color", with_color, without, "mismatches", ("recording", "repeat")))
        changed = sum(one.results["head"]["mismatches"] for one in with_color)
        claims.append(
            Claim(
                f"{preset}: no identity changes with color",
                changed == 0 and is_followed(with_color),
                f"{changed} changes in {len(with_color)} runs, MOTA {score_interval(with_color, 'MOTA')} %",
            )
        )
    names = ", ".join(dict.fromkeys(one.parameters["recording"].rpartition("@")[0] for one in cells))
    caption = (
        f"Two people pass each other ({names}): Sparse Sampling with {SAMPLES} samples, voxels of {100 * VOXEL_M:g} cm. The paper: Figure "
        "4.12."
    )
    return Report((Table("fig-4.12", caption, rows),), {"fig-4.12": figure}, tuple(claims))


EXPERIMENT = Experiment("fig-4.12", "a crossing, with and without color", "Canton, Figure 4.12", grid, cell, report, version=3)
