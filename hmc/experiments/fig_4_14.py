"""Figure 4.14: MOTP and MOTA against the real-time factor of the filter. Source: Canton (2009), section 4.4.3; cells of table-4.3."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import table_4_3
from hmc.experiments import tracking_runs as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table

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
    claims = tuple(claim for preset in runs.PRESETS for claim in _claims(preset, rows))
    names = ", ".join(source.name for source in runs.sources(plan))
    caption = f"Real-time factor of the filter alone (Canton, Eq. 4.27 and 4.34), and accuracy, on {names}. The paper: Figure 4.14."
    return Report((Table("fig-4.14", caption, rows),), figures, claims)


def _claims(preset: str, rows: list[dict]) -> list[Claim]:
    own = [row for row in rows if row["preset"] == preset]

    def factors(**where) -> dict[tuple, float]:
        return {(row["voxel_cm"], row["N"]): row["RTF"] for row in own if all(row[key] == value for key, value in where.items())}

    raw, color = ({m: factors(method=f"{m} {kind}") for m in ("SS", "PF")} for kind in ("raw", "color"))
    costs = [raw[m][key] / color[m][key] for m in ("SS", "PF") for key in raw[m]]
    coarse, fine = max(row["voxel_cm"] for row in own), min(row["voxel_cm"] for row in own)
    means = {v: float(np.mean([row["RTF"] for row in own if row["voxel_cm"] == v])) for v in (coarse, fine)}
    ahead = [_ahead(own, voxel, kind) for voxel in sorted({row["voxel_cm"] for row in own}) for kind in ("raw", "color")]
    return [
        Claim(
            f"{preset}: SS above PF at equal factor, in MOTP",
            all(gain > 0 for gain in ahead),
            ", ".join(f"{gain:+.1f} mm" for gain in ahead) + " less at each voxel size, raw and color, from fine to coarse",
        ),
        Claim(f"{preset}: color costs time", min(costs) > 1, f"{min(costs):.2f} to {max(costs):.2f} times"),
        Claim(
            f"{preset}: finer voxels cost time",
            means[fine] < means[coarse],
            f"mean factor {means[coarse]:.0f} at {coarse:g} cm, {means[fine]:.0f} at {fine:g} cm",
        ),
    ]


def _ahead(rows: list[dict], voxel: float, kind: str) -> float:
    """By how many millimetres the particle filter's MOTP is worse than Sparse Sampling's, over the factors that both reach."""
    curves = []
    for method in ("SS", "PF"):
        part = sorted(
            (np.log(row["RTF"]), row["MOTP_mm"]) for row in rows if row["voxel_cm"] == voxel and row["method"] == f"{method} {kind}"
        )
        curves.append(np.array(part).T)
    (x_ss, y_ss), (x_pf, y_pf) = curves
    low, high = max(x_ss[0], x_pf[0]), min(x_ss[-1], x_pf[-1])
    at = np.linspace(low, high, 50) if high > low else np.array([(low + high) / 2])
    return float(np.mean(np.interp(at, x_pf, y_pf) - np.interp(at, x_ss, y_ss)))


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
