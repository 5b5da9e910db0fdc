"""Figure 4.14: MOTP and MOTA against the real-time factor of the filter. Source: Canton (2009), section 4.4.3; cells of table-4.3."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import table_4_3
from hmc.experiments import tracking_runs as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.intervals import decide
from hmc.experiments.run_means import mean_interval
from hmc.experiments.tracking_intervals import ahead, following

__all__ = ["EXPERIMENT"]


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row of panels a metric, a column a voxel size."""
    scores = table_4_3.configurations(cells)
    rows: list[dict] = [
        {
            "preset": preset,
            "voxel_cm": 100 * voxel,
            "method": method,
            "N": n,
            "RTF": s.rtf,
            "MOTP_mm": s.motp_mm,
            "MOTA_percent": 100 * s.mota,
        }
        for (preset, voxel, method, n), s in scores.items()
    ]
    figures = {}
    for preset in runs.PRESETS:
        voxels = sorted({row["voxel_cm"] for row in rows}, reverse=True)
        figure, axes = plt.subplots(2, len(voxels), figsize=(2.6 * len(voxels), 4.6), sharex="col", sharey="row", squeeze=False)
        for column, voxel in zip(axes.T, voxels, strict=True):
            column[0].set_title(f"{voxel:g} cm")
            for (tracker, color), method in runs.methods(preset).items():
                part = [row for row in rows if (row["preset"], row["voxel_cm"], row["method"]) == (preset, voxel, method)]
                style = runs.style_of(tracker, color) | {"marker": "o", "label": method}
                for ax, key in zip(column, ("MOTP_mm", "MOTA_percent"), strict=True):
                    ax.plot([row["RTF"] for row in part], [row[key] for row in part], **style)
            column[1].set(xlabel="real-time factor of the filter", xlim=(0, None))
        axes[0, 0].set_ylabel("MOTP (mm)")
        axes[1, 0].set_ylabel("MOTA (%)")
        axes[0, -1].legend()
        figures[f"fig-4.14-{preset}"] = figure
    claims = tuple(claim for preset in runs.PRESETS for claim in _claims(preset, cells))
    names = ", ".join(source.name for source in runs.sources(plan))
    caption = f"Real-time factor of the filter alone (Canton, Eq. 4.27 and 4.34), and accuracy, on {names}. The paper: Figure 4.14."
    return Report((Table("fig-4.14", caption, rows),), figures, claims)


def _claims(preset: str, cells: Sequence[Cell]) -> list[Claim]:
    """The remarks of section 4.4.3, on this preset's runs."""
    own = [one for one in cells if one.parameters["preset"] == preset]

    def those(**wanted: object) -> list[Cell]:
        return [one for one in own if all(one.parameters[name] == value for name, value in wanted.items())]

    coarse, fine = (pick(one.parameters["voxel_m"] for one in own) for pick in (max, min))
    many = {tracker: those(tracker=tracker, particles=number) for tracker, number in table_4_3.BEST.items()}
    same = ("recording", "repeat", "voxel_m", "color")
    claims = [
        ahead(f"{preset}: SS takes less time than PF, at the numbers of the best cases", many["sparse"], many["particle"], "filter", same),
        ahead(f"{preset}: color costs time", _filters(own, color=False), _filters(own, color=True), "filter", _but("color")),
        ahead(f"{preset}: finer voxels cost time", those(voxel_m=coarse), those(voxel_m=fine), "filter", _but("voxel_m")),
    ]
    clips = dict.fromkeys(one.parameters["recording"] for one in own)
    gains = {(clip, 0): _ahead([one for one in own if one.parameters["recording"] == clip]) for clip in clips}
    gain = mean_interval({run: value for run, value in gains.items() if np.isfinite(value)})
    followed = following([one for one in own if one.parameters["tracker"] == "sparse"])
    return [
        decide(
            f"{preset}: SS above PF at equal factor, in MOTP",
            (gain, followed),
            f"{gain} mm less, over the voxel sizes at which both reach one, raw and color"
            + ("" if followed.above_zero else "; people may be lost"),
        ),
        *claims,
    ]


def _filters(cells: Sequence[Cell], color: bool) -> list[Cell]:
    return [one for one in cells if one.parameters["tracker"] in table_4_3.BEST and one.parameters["color"] == color]


def _but(name: str) -> list[str]:
    return [one for one in ("recording", "voxel_m", "tracker", "color", "particles", "repeat") if one != name]


def _ahead(cells: Sequence[Cell]) -> float:
    """By how many millimetres PF's MOTP is worse than that of SS, over factors that both reach: mean of voxel sizes, raw and color.

    Where the slowest of one is quicker than the quickest of the other there is no equal factor; NaN where there is none at all.
    """
    gains = []
    for voxel in dict.fromkeys(one.parameters["voxel_m"] for one in cells):
        for color in (False, True):
            curves = []
            for tracker in ("sparse", "particle"):
                groups: dict[int, list[Cell]] = {}
                for one in cells:
                    p = one.parameters
                    if (p["voxel_m"], p["tracker"], p["color"]) == (voxel, tracker, color):
                        groups.setdefault(p["particles"], []).append(one)
                scores = [runs.scores_of(group) for group in groups.values()]
                curves.append(np.array(sorted((np.log(score.rtf), score.motp_mm) for score in scores)).reshape(-1, 2).T)
            (x_ss, y_ss), (x_pf, y_pf) = curves
            if not len(x_ss) or not len(x_pf):
                continue
            low, high = max(x_ss[0], x_pf[0]), min(x_ss[-1], x_pf[-1])
            if low <= high:
                at = np.linspace(low, high, 50)
                gains.append(float(np.mean(np.interp(at, x_pf, y_pf) - np.interp(at, x_ss, y_ss))))
    return float(np.mean(gains)) if gains else float("nan")


EXPERIMENT = Experiment(
    "fig-4.14",
    "MOTP and MOTA against the real-time factor",
    "Canton, Figure 4.14",
    table_4_3.grid,
    runs.cell,
    report,
    runs.FAMILY,
    runs.VERSION,
)
