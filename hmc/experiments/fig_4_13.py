"""Figure 4.13: measured time of the filters beside the theory's (Table 4.5). Source: Canton (2009), section 4.4.3; cells of table-4.3.

Theory, a person and frame: naive alpha^2 s_x^2 h / s_v^3, particle filter N s_x^2 h / s_v^3, Sparse Sampling N q r^3. The thesis finds the
first two as fast as that, and Sparse Sampling not: its time grows with the voxels too, as access to the data outweighs the rest. Curves of
the theory are scaled to the measured ones by one factor a method. What one more sample or particle costs is told apart from what is
there whatever their number.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import table_4_3
from hmc.experiments import tracking_runs as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.intervals import Interval, decide, interval

__all__ = ["EXPERIMENT"]

#: The trackers as the thesis has them.
PRESET = "canton2009"
#: By the theory (Table 4.5) time goes with one over the voxel's side to this power, naive and PF, and with N; how far a measured exponent
#: may be from that to be called the same.
VOXEL_POWER, NEAR = 3, 0.5


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
        # The largest number that was run at the most voxel sizes: at 5 cm there are numbers that no other size has.
        numbers = [row["N"] for row in own_rows]
        held = max(numbers, key=lambda n: (numbers.count(n), n or 0))
        finest = min(row["voxel_cm"] for row in own_rows)
        style = runs.style_of(tracker, color)
        label = method + (f", N = {held}" if held else "")
        for axes, key, part in (
            (left, "voxel_cm", [row for row in own_rows if row["N"] == held]),
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
    parts = "Of these the part that goes with samples or particles, by the straight line through the times of all numbers, and the rest."
    tables = (Table("fig-4.13", caption, rows), Table("fig-4.13-parts", parts, _parts(rows)))
    return Report(tables, {"fig-4.13": figure}, tuple(_claims(cells)))


def _parts(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """What a sample costs (microseconds), and what is there without any (milliseconds), method by method and voxel by voxel."""
    parts = []
    for method, voxel in dict.fromkeys((row["method"], row["voxel_cm"]) for row in rows if row["N"]):
        line = np.array([(row["N"], row["measured_ms"]) for row in rows if (row["method"], row["voxel_cm"]) == (method, voxel)])
        if len(line) > 1:
            each, rest = np.polyfit(line[:, 0], line[:, 1], 1)
            parts.append({"method": method, "voxel_cm": voxel, "one_sample_us": 1000 * each, "the_rest_ms": rest})
    return parts


def _theory(method: str, voxel_m: float, n: int | None) -> float:
    ellipsoid = 0.3**2 * 1.7 / voxel_m**3
    if method == "naive":
        return 1.5**2 * ellipsoid
    return float(n or 1) * (ellipsoid if method.startswith("PF") else 26 * 2**3)


def _claims(cells: Sequence[Cell]) -> list[Claim]:
    """Exponents of growth clip by clip, and their intervals over clips."""
    clips = list(dict.fromkeys(one.parameters["recording"] for one in cells))
    own = [[one for one in cells if one.parameters["recording"] == clip and one.parameters["preset"] == PRESET] for clip in clips]
    names = list(dict.fromkeys(runs.method_name(one.parameters) for one in cells))

    def growth(method: str, key: str) -> np.ndarray:
        return np.array([_growth([one for one in part if runs.method_name(one.parameters) == method], key) for part in own])

    def apart(exponents: np.ndarray) -> Interval:
        return interval(clips, exponents, np.ones(len(clips)))

    by_voxel = {method: growth(method, "voxel_m") for method in names}
    with_number = [name for name in names if name.startswith(("SS", "PF"))]
    by_number = {method: growth(method, "particles") for method in with_number}
    larger = [apart(by_voxel[name] - by_voxel["SS raw"]) for name in ("naive", "PF raw")]
    grows = [apart(by_voxel[name]) for name in ("naive", "PF raw")]
    as_in_theory = [name for name in names if not name.startswith("SS")]
    off = [np.abs(by_voxel[name] - VOXEL_POWER) for name in as_in_theory]
    off += [np.abs(by_number[name] - 1) for name in as_in_theory if name in by_number]
    return [
        decide(
            "naive and PF grow with the number of voxels, SS less than they",
            (*larger, *grows),
            "time goes with the voxel's side to the power of " + ", ".join(f"{name} {_power(-value)}" for name, value in by_voxel.items()),
        ),
        decide(
            "SS and PF grow with their samples",
            [apart(value) for value in by_number.values()],
            "time goes with N to the power of " + ", ".join(f"{name} {_power(value)}" for name, value in by_number.items()),
        ),
        decide(
            "naive and PF grow as fast as by the theory, to half a power",
            [apart(values).under(NEAR) for values in off],
            f"at most {max(float(np.mean(values)) for values in off):.2f} off",
        ),
        decide(
            "SS grows with the number of voxels, which the theory has not",
            [apart(by_voxel[name]) for name in names if name.startswith("SS")],
            ", ".join(f"{name} {_power(-by_voxel[name])}" for name in names if name.startswith("SS")),
        ),
    ]


def _growth(cells: Sequence[Cell], key: str) -> float:
    """Exponent by which a method's time grows with one over the voxel's side, or with N, the other held; NaN of one size or number."""
    other = "particles" if key == "voxel_m" else "voxel_m"
    slopes = []
    for fixed in dict.fromkeys(one.parameters[other] for one in cells):
        line = [one for one in cells if one.parameters[other] == fixed]
        at, times = ([one.parameters[key] for one in line], [one.results["filter_s"] / max(one.results["rows"], 1) for one in line])
        if len(set(at)) > 1 and min(times) > 0:
            slopes.append(np.polyfit(np.log(at), np.log(times), 1)[0])
    return (-1 if key == "voxel_m" else 1) * float(np.mean(slopes)) if slopes else float("nan")


def _power(exponents: np.ndarray) -> str:
    return f"{np.mean(exponents):.2f}"


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
