"""Figure 4.13: measured time of the filters beside the theory's (Table 4.5). Source: Canton (2009), section 4.4.3; cells of table-4.3.

Theory, a person and frame: naive alpha^2 s_x^2 h / s_v^3, particle filter N s_x^2 h / s_v^3, Sparse Sampling N q r^3. Its curves are
scaled to the measured ones by one factor a method.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import table_4_3
from hmc.experiments import tracking_runs as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table

__all__ = ["EXPERIMENT"]

PRESET = "default"


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Time against the voxel size and against the number of samples or particles, with the exponents of their growth."""
    scores = {key[1:]: score for key, score in table_4_3.configurations(cells).items() if key[0] == PRESET}
    rows = []
    for method in dict.fromkeys(method for _, method, _ in scores):
        own = {(voxel, n): score.filter_s for (voxel, name, n), score in scores.items() if name == method}
        theory = {key: _theory(method, *key) for key in own}
        scale = np.exp(np.mean([np.log(own[key] / theory[key]) for key in own]))
        rows += [
            {
                "method": method,
                "voxel_cm": 100 * voxel,
                "N": n,
                "measured_ms": 1000 * own[voxel, n],
                "theory_ms": 1000 * scale * theory[voxel, n],
            }
            for voxel, n in own
        ]
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.4))
    for (tracker, color), method in runs.methods(PRESET).items():
        own_rows = [row for row in rows if row["method"] == method]
        most = max((row["N"] for row in own_rows if row["N"]), default=None)
        finest = min(row["voxel_cm"] for row in own_rows)
        style = runs.style_of(tracker, color)
        label = method + (f", N = {most}" if most else "")
        for axes, key, part in (
            (left, "voxel_cm", [row for row in own_rows if row["N"] == most]),
            (right, "N", [row for row in own_rows if row["N"] and row["voxel_cm"] == finest]),
        ):
            at = [row[key] for row in part]
            axes.plot(at, [row["measured_ms"] for row in part], marker="o", label=label if axes is left else None, **style)
            axes.plot(at, [row["theory_ms"] for row in part], color=style["color"], linestyle=":", linewidth=1)
    left.set(xlabel="voxel (cm)", ylabel="filter, a frame and person (ms)", xscale="log", yscale="log")
    right.set(xlabel=f"samples, particles (voxels of {min(row['voxel_cm'] for row in rows):g} cm)", xscale="log", yscale="log")
    sizes = sorted({row["voxel_cm"] for row in rows})
    left.set_xticks(sizes, [f"{size:g}" for size in sizes])
    left.minorticks_off()
    left.legend(title="dotted: theory")
    caption = "Processor time of the filters and the theory's growth (Canton, Table 4.5 and Figure 4.13)."
    return Report((Table("fig-4.13", caption, rows),), {"fig-4.13": figure}, tuple(_claims(rows)))


def _theory(method: str, voxel_m: float, n: int | None) -> float:
    ellipsoid = 0.3**2 * 1.7 / voxel_m**3
    if method == "naive":
        return 1.5**2 * ellipsoid
    return float(n or 1) * (ellipsoid if method.startswith("PF") else 26 * 2**3)


def _claims(rows: list[dict]) -> list[Claim]:
    def growth(method: str, key: str) -> float:
        """Exponent by which the time grows with one over the voxel's side, or with N, the other held."""
        other = "N" if key == "voxel_cm" else "voxel_cm"
        own = [row for row in rows if row["method"] == method]
        slopes = []
        for fixed in {row[other] for row in own}:
            line = [row for row in own if row[other] == fixed]
            slopes.append(np.polyfit(np.log([row[key] for row in line]), np.log([row["measured_ms"] for row in line]), 1)[0])
        return float(np.mean(slopes)) * (-1 if key == "voxel_cm" else 1)

    names = dict.fromkeys(row["method"] for row in rows)
    by_voxel = {method: growth(method, "voxel_cm") for method in names}
    by_number = {method: growth(method, "N") for method in names if any(row["N"] for row in rows if row["method"] == method)}
    return [
        Claim(
            "naive and PF grow with the number of voxels, SS less than they",
            by_voxel["SS raw"] < min(by_voxel["naive"], by_voxel["PF raw"]) and min(by_voxel["naive"], by_voxel["PF raw"]) > 0,
            "time goes with the voxel's side to the power of " + ", ".join(f"{name} -{value:.2f}" for name, value in by_voxel.items()),
        ),
        Claim(
            "SS and PF grow with their samples",
            min(by_number.values()) > 0,
            "time goes with N to the power of " + ", ".join(f"{name} {value:.2f}" for name, value in by_number.items()),
        ),
    ]


EXPERIMENT = Experiment(
    "fig-4.13",
    "measured and theoretical complexity",
    "Canton, Figure 4.13 and Table 4.5",
    table_4_3.grid,
    runs.cell,
    report,
    runs.FAMILY,
    runs.VERSION,
)
