"""Table 4.3 and Figure 4.11: MOTP and MOTA of the three trackers by voxel size, number of samples or particles, and color.

Source: Canton (2009), section 4.4.2. Two presets are run: ``canton2009``, parameters and life of tracks as the thesis prints them, and
``default``, ours. The full grid is a fraction of the thesis's 4 x 29 configurations: three numbers of samples or particles at 15 and 10 cm,
all seven at 5 cm, two at 2 cm, where a run takes longest. The numbers of the thesis's best cases have three seeds on every clip; each other
number has one seed a clip, by turns (a Latin square of clips and numbers), the same for all methods.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from hmc.experiments import tracking_runs as runs
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.tracking_intervals import ahead, score_interval
from hmc.tracking.trackers import TRACKERS

__all__ = ["BEST", "EXPERIMENT", "PAPER", "configurations", "grid", "groups"]

#: Samples and particles at each voxel size: all of the thesis's at 5 cm, some of them elsewhere.
SAMPLES = {"sparse": (50, 100, 200, 400, 600, 800, 1000), "particle": (10, 25, 50, 100, 150, 200, 250)}
SAMPLES_COARSE = {"sparse": (50, 200, 800), "particle": (10, 50, 100)}
SAMPLES_FEW = {"sparse": (50, 800), "particle": (10, 100)}
#: The numbers of the thesis's best cases (Table 4.4): these are run with every seed, others with one seed a clip by turns.
BEST = {"sparse": 800, "particle": 100}
SEEDS, SEEDS_QUICK = 3, 2
#: By method and number, MOTP (mm) and MOTA (%) at voxels of 15, 10, 5 and 2 cm.
PAPER_VOXELS = (0.15, 0.10, 0.05, 0.02)
PAPER: dict[tuple[str, int | None], tuple[float, ...]] = {
    ("naive", None): (190, 40.15, 189, 47.87, 185, 52.18, 179, 53.51),
    ("SS raw", 50): (187, 57.78, 182, 69.81, 174, 70.91, 165, 73.75),
    ("SS raw", 100): (181, 57.09, 177, 70.82, 171, 69.18, 161, 73.01),
    ("SS raw", 200): (175, 59.55, 175, 71.54, 168, 68.54, 157, 74.86),
    ("SS raw", 400): (173, 59.08, 172, 71.71, 166, 67.69, 154, 75.87),
    ("SS raw", 600): (172, 59.16, 170, 71.87, 165, 68.14, 150, 75.65),
    ("SS raw", 800): (172, 59.35, 169, 72.44, 165, 69.24, 146, 75.87),
    ("SS raw", 1000): (172, 59.99, 170, 73.19, 162, 69.31, 147, 75.28),
    ("SS color", 50): (184, 59.78, 183, 73.44, 172, 70.01, 165, 74.62),
    ("SS color", 100): (178, 59.09, 176, 72.47, 169, 71.88, 159, 74.99),
    ("SS color", 200): (174, 58.53, 170, 72.62, 162, 72.38, 154, 77.47),
    ("SS color", 400): (172, 59.52, 169, 72.77, 162, 72.44, 149, 78.98),
    ("SS color", 600): (170, 58.43, 167, 73.86, 160, 72.47, 145, 79.43),
    ("SS color", 800): (170, 59.98, 168, 74.23, 159, 72.07, 144, 81.50),
    ("SS color", 1000): (171, 60.17, 168, 72.84, 159, 72.3, 144, 80.45),
    ("PF raw", 10): (179, 43.62, 173, 54.64, 166, 56.21, 160, 60.66),
    ("PF raw", 25): (167, 51.05, 164, 63.82, 156, 66.56, 152, 69.20),
    ("PF raw", 50): (165, 57.33, 159, 67.52, 152, 68.13, 148, 71.02),
    ("PF raw", 100): (162, 57.54, 159, 68.96, 151, 71.18, 147, 72.10),
    ("PF raw", 150): (162, 58.40, 158, 68.71, 151, 70.95, 147, 70.76),
    ("PF raw", 200): (162, 58.40, 158, 67.24, 150, 70.48, 146, 71.62),
    ("PF raw", 250): (163, 57.99, 160, 67.94, 151, 69.28, 148, 70.97),
    ("PF color", 10): (177, 45.86, 171, 57.25, 164, 58.91, 160, 63.54),
    ("PF color", 25): (167, 54.70, 162, 66.86, 161, 68.75, 152, 71.56),
    ("PF color", 50): (164, 59.71, 158, 69.52, 150, 70.42, 147, 73.46),
    ("PF color", 100): (164, 58.68, 157, 71.11, 148, 73.35, 147, 74.56),
    ("PF color", 150): (163, 61.78, 157, 70.44, 149, 72.04, 146, 72.09),
    ("PF color", 200): (161, 59.75, 156, 68.61, 149, 71.71, 146, 73.44),
    ("PF color", 250): (161, 60.10, 155, 69.38, 150, 73.13, 145, 72.61),
}

Configuration = tuple[str, float, str, int | None]


def grid(plan: Plan) -> list[dict]:
    """All methods at all voxel sizes, for every recording."""
    return [
        runs.parameters_of(source.label, voxel, method, n, preset, seed)
        for clip, source in enumerate(runs.sources(plan))
        for voxel in runs.voxel_sizes(plan)
        for preset in runs.PRESETS
        for method in runs.methods(preset)
        for rank, n in enumerate(_numbers(plan, method[0], voxel))
        for seed in _seeds(plan, method[0], n, clip + rank)
    ]


def _numbers(plan: Plan, tracker: str, voxel_m: float) -> tuple[int | None, ...]:
    numbers = SAMPLES_FEW if plan.quick or voxel_m < 0.05 else SAMPLES if voxel_m == 0.05 else SAMPLES_COARSE
    return numbers.get(tracker, (None,))


def _seeds(plan: Plan, tracker: str, n: int | None, turn: int) -> tuple[int, ...]:
    """Which seeds a configuration is run with: none but 0 where nothing is drawn at random."""
    seeds = SEEDS_QUICK if plan.quick else SEEDS
    if TRACKERS[tracker].particles is None:
        return (0,)
    return tuple(range(seeds)) if n is None or n == BEST.get(tracker) else (turn % seeds,)


def groups(cells: Sequence[Cell]) -> dict[Configuration, list[Cell]]:
    """Runs by preset, voxel size, method and number."""
    found: dict[Configuration, list[Cell]] = {}
    for one in cells:
        p = one.parameters
        found.setdefault((p["preset"], p["voxel_m"], runs.method_name(p), p["particles"]), []).append(one)
    return dict(sorted(found.items(), key=lambda item: (runs.PRESETS.index(item[0][0]), -item[0][1])))


def configurations(cells: Sequence[Cell]) -> dict[Configuration, runs.Score]:
    """Scores by preset, voxel size, method and number, over recordings and repeats."""
    return {key: runs.scores_of(group) for key, group in groups(cells).items()}


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The table with the paper's figures, one Figure 4.11 a preset, and the paper's remarks."""
    scores, rows = configurations(cells), []
    for (preset, voxel, method, n), group in groups(cells).items():
        score, (motp, mota) = scores[preset, voxel, method, n], _paper(method, n, voxel)
        between = {name: score_interval(group, name) for name in ("MOTP", "MOTA")}
        rows.append(
            {
                "preset": preset, "voxel_cm": 100 * voxel, "method": method, "N": n, "runs": len(group),
                "MOTP_mm": score.motp_mm, "MOTP_low": between["MOTP"].low, "MOTP_high": between["MOTP"].high, "MOTP_paper_mm": motp,
                "MOTA_percent": 100 * score.mota, "MOTA_low": between["MOTA"].low, "MOTA_high": between["MOTA"].high,
                "MOTA_paper_percent": mota, "FP_percent": 100 * score.false_positives, "miss_percent": 100 * score.misses,
                "mismatch_percent": 100 * score.mismatches, "centroid_MOTP_mm": score.centroid_motp_mm,
            }
        )  # fmt: skip
    figures = {f"fig-4.11-{preset}": _draw(preset, scores) for preset in runs.PRESETS}
    names = ", ".join(source.name for source in runs.sources(plan))
    caption = (
        f"MOTP and MOTA against the heads on {names}, with intervals of 95 % over clips and seeds, and MOTP against true centroids; the "
        "paper's (Canton, Table 4.3) on CLEAR 2007."
    )
    claims = tuple(claim for preset in runs.PRESETS for claim in _claims(preset, cells))
    return Report((Table("table-4.3", caption, rows),), figures, claims)


def _paper(method: str, n: int | None, voxel: float) -> tuple[float | None, float | None]:
    values = PAPER.get((method, n))
    if values is None or voxel not in PAPER_VOXELS:
        return None, None
    place = 2 * PAPER_VOXELS.index(voxel)
    return float(values[place]), float(values[place + 1])


def _draw(preset: str, scores: dict[Configuration, runs.Score]) -> Figure:
    voxels = sorted({voxel for name, voxel, _, _ in scores if name == preset}, reverse=True)
    figure, axes = plt.subplots(2, len(voxels), figsize=(2.6 * len(voxels), 4.6), sharex=True, sharey="row", squeeze=False)
    for column, voxel in zip(axes.T, voxels, strict=True):
        column[0].set_title(f"{100 * voxel:g} cm")
        for (tracker, color), method in runs.methods(preset).items():
            points = sorted((n or 0, score) for (p, v, m, n), score in scores.items() if (p, v, m) == (preset, voxel, method))
            style = runs.style_of(tracker, color) | {"label": method}
            for ax, values in zip(column, ([s.motp_mm for _, s in points], [100 * s.mota for _, s in points]), strict=True):
                if TRACKERS[tracker].particles is None:
                    ax.axhline(values[0], **style)
                else:
                    ax.plot([n for n, _ in points], values, marker="o", **style)
                ax.set_xscale("log")
        column[1].set_xlabel("samples, particles")
    axes[0, 0].set_ylabel("MOTP (mm)")
    axes[1, 0].set_ylabel("MOTA (%)")
    handles, labels = axes[0, -1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def _claims(preset: str, cells: Sequence[Cell]) -> list[Claim]:
    """The remarks of section 4.4.2, on this preset's runs: pairs of runs that differ in the one thing, on the same clips and seeds."""
    printed = {name for name, _ in PAPER}
    own = [one for one in cells if one.parameters["preset"] == preset and runs.method_name(one.parameters) in printed]

    def those(**wanted: object) -> list[Cell]:
        return [one for one in own if all(one.parameters[name] == value for name, value in wanted.items())]

    everything = ("recording", "voxel_m", "tracker", "color", "particles", "repeat")
    claims = []
    for score in ("MOTP", "MOTA"):
        but_voxel = [name for name in everything if name != "voxel_m"]
        finest, coarsest = (pick(one.parameters["voxel_m"] for one in own) for pick in (min, max))
        text = f"{preset}: finer voxels are better, in {score}"
        claims.append(ahead(text, those(voxel_m=finest), those(voxel_m=coarsest), score, but_voxel))
        for tracker, name in (("sparse", "SS"), ("particle", "PF")):
            with_color, without = (those(tracker=tracker, color=color) for color in (True, False))
            text = f"{preset}: color is better, in {score} of {name}"
            claims.append(ahead(text, with_color, without, score, [name for name in everything if name != "color"]))
    for tracker, name in (("sparse", "SS"), ("particle", "PF")):
        many, few = (those(tracker=tracker, particles=n) for n in (BEST[tracker], SAMPLES[tracker][0]))
        text = f"{preset}: {BEST[tracker]} have a lower MOTP than {SAMPLES[tracker][0]}, in {name}"
        claims.append(ahead(text, many, few, "MOTP", [name for name in everything if name != "particles"]))
    return claims


EXPERIMENT = Experiment(
    "table-4.3", "MOTP and MOTA of naive, Sparse Sampling and particle filter, with figure 4.11", "Canton, Table 4.3 and Figure 4.11",
    grid, runs.cell, report, runs.FAMILY, runs.VERSION,
)  # fmt: skip
