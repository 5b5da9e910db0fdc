"""Table 4.4: the best case of each tracker, with its false positives, misses and mismatches.

Source: Canton (2009), section 4.4.2. The cells are those of table-4.3. The other rows of the thesis's table are systems of other groups
on CLEAR 2007; they are repeated as printed, except for the naive row's mismatches, which are a copy of its false positives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hmc.experiments import table_4_3
from hmc.experiments import tracking_runs as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.tracking_intervals import ahead, score_interval

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
    """The paper's best cases, on which it is decided, and the best cases here, by MOTA and then by MOTP."""
    groups, claims = table_4_3.groups(cells), list[Claim]()
    rows: list[dict[str, Any]] = []
    for preset in runs.PRESETS:
        printed = {family: _printed_case(preset, family, groups) for family in PAPER}
        for family, paper in PAPER.items():
            own = {key: runs.scores_of(group) for key, group in groups.items() if key[0] == preset and key[2].startswith(family)}
            best = max(own, key=lambda key: (own[key].mota, -own[key].motp_mm))
            for chosen, key in (("the paper's", printed[family]), ("best here", best)):
                _, voxel, method, n = key
                score, between = own[key], score_interval(groups[key], "MOTA")
                ours = (score.motp_mm, *(100 * rate for rate in (score.mota, score.false_positives, score.misses, score.mismatches)))
                case = f"{100 * voxel:g} cm" + (f", {n}, {'color' if method.endswith('color') else 'raw'}" if n else "")
                rows.append(
                    {
                        "method": family, "preset": preset, "chosen": chosen, "best_case": case, "runs": len(groups[key]),
                        **_columns(ours, paper),
                        "MOTA_low": between.low, "MOTA_high": between.high, "centroid_MOTP_mm": score.centroid_motp_mm,
                    }
                )  # fmt: skip
        for better, worse in (("SS", "PF"), ("PF", "naive")):
            first, second = (groups[printed[family]] for family in (better, worse))
            by = ("recording",) if worse == "naive" else ("recording", "repeat")
            claims += [ahead(f"{preset}: {better} ahead of {worse} in {score}", first, second, score, by) for score in ("MOTA", "MOTP")]
    empty: dict[str, Any] = {"MOTA_low": None, "MOTA_high": None, "centroid_MOTP_mm": None}
    nothing: dict[str, Any] = {"preset": "", "chosen": "", "best_case": "", "runs": None}
    rows += [{"method": name} | nothing | _columns((None,) * 5, paper) | empty for name, paper in OTHERS.items()]
    recordings = ", ".join(source.name for source in runs.sources(plan))
    caption = (
        f"Each tracker's best case, against the heads, on {recordings}: the configuration that is the paper's best, at the finest "
        "voxels that were run, and the best one here, which is chosen on the same clips. The paper's (Canton, Table 4.4) on CLEAR 2007."
    )
    return Report((Table("table-4.4", caption, rows),), {}, tuple(claims))


def _printed_case(preset: str, family: str, groups: Mapping[table_4_3.Configuration, Sequence[Cell]]) -> table_4_3.Configuration:
    """The thesis's best case: with color, 800 samples or 100 particles; at the finest voxels."""
    number = {"SS": table_4_3.BEST["sparse"], "PF": table_4_3.BEST["particle"], "naive": None}[family]
    method = family if number is None else f"{family} color"
    own = [key for key in groups if key[0] == preset and key[2] == method]
    return min(own, key=lambda key: (key[1], abs((key[3] or 0) - (number or 0))))


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
