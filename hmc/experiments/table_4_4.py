"""Table 4.4: the best case of each tracker, with its false positives, misses and mismatches.

Source: Canton (2009), section 4.4.2. The cells are those of table-4.3. The other rows of the thesis's table are systems of other groups
on CLEAR 2007; they are repeated as printed, except for the naive row's mismatches, which are a copy of its false positives.
"""

from __future__ import annotations

from collections.abc import Sequence

from hmc.experiments import table_4_3
from hmc.experiments import tracking_runs as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table

__all__ = ["EXPERIMENT"]

#: MOTP (mm), MOTA, false positives, misses, mismatches (%).
PAPER = {
    "naive": (179, 53.51, 18.63, 22.05, None),
    "PF": (147, 74.56, 14.03, 10.48, 0.91),
    "SS": (144, 81.50, 9.34, 8.70, 0.46),
}
OTHERS = {
    "face detection, Kalman filter [KTPP07]": (91, 59.66, 6.99, 30.89, 2.46),
    "appearance models, particle filter [LCB07]": (141, 59.62, 18.58, 20.66, 1.14),
    "upper bodies, particle filter [BGS07]": (155, 69.58, 14.50, 15.09, 0.83),
    "camera overhead, particle filter [BGS07]": (222, 54.94, 20.24, 23.74, 1.08),
    "voxels, heuristic tracker [CFSC07a]": (168, 30.49, 40.19, 27.74, 1.58),
}
COLUMNS = ("MOTP_mm", "MOTA_percent", "FP_percent", "miss_percent", "mismatch_percent")


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The best cases, by MOTA and then by MOTP."""
    scores = table_4_3.configurations(cells)
    rows, best = [], {}
    for preset in runs.PRESETS:
        for family, paper in PAPER.items():
            own = {key: score for key, score in scores.items() if key[0] == preset and key[2].startswith(family)}
            (_, voxel, method, n), score = max(own.items(), key=lambda item: (item[1].mota, -item[1].motp_mm))
            best[preset, family] = score
            ours = (score.motp_mm, *(100 * rate for rate in (score.mota, score.false_positives, score.misses, score.mismatches)))
            case = f"{100 * voxel:g} cm" + (f", {n}, {'color' if method.endswith('color') else 'raw'}" if n else "")
            rows.append({"method": family, "preset": preset, "best_case": case} | _columns(ours, paper))
    rows += [{"method": name, "preset": "", "best_case": ""} | _columns((None,) * 5, paper) for name, paper in OTHERS.items()]
    claims = tuple(
        Claim(
            f"{preset}: SS ahead of PF ahead of naive in MOTA",
            best[preset, "SS"].mota > best[preset, "PF"].mota > best[preset, "naive"].mota,
            ", ".join(f"{family} {100 * best[preset, family].mota:.2f} % {best[preset, family].motp_mm:.0f} mm" for family in PAPER),
        )
        for preset in runs.PRESETS
    )
    names = ", ".join(source.name for source in runs.sources(plan))
    caption = f"Each tracker's best case on {names}; the paper's (Canton, Table 4.4) on CLEAR 2007."
    return Report((Table("table-4.4", caption, rows),), {}, claims)


def _columns(ours: Sequence[float | None], paper: Sequence[float | None]) -> dict[str, float | None]:
    pairs = zip(COLUMNS, ours, paper, strict=True)
    return {
        key: value
        for name, own, printed in pairs
        for key, value in ((name, own), (f"{name}_paper", None if printed is None else float(printed)))
    }


EXPERIMENT = Experiment(
    "table-4.4",
    "each tracker's best case, with its errors",
    "Canton, Table 4.4",
    table_4_3.grid,
    runs.cell,
    report,
    runs.FAMILY,
    runs.VERSION,
)
