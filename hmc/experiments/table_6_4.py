"""Table 6.4: markerless pose by action: the thesis's filter from the true first pose, and whole chains from videos alone.

Source: Canton (2009), section 6.7.2: 7 cameras, 2 cm, the factorised likelihood, density 1, 6 layers of 600 particles. It
starts in a neutral pose where the person was tracked, headed as they walk (6.3.3): so does the chain `canton2009`. The filter here starts
from the true first pose, which is more than the thesis had.
"""

from __future__ import annotations

from collections.abc import Sequence

from hmc.experiments import filter_study as runs
from hmc.experiments.by_action import AVERAGE, action_rows
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report, Table
from hmc.experiments.engine.intervals import decide
from hmc.experiments.pose_intervals import reaches, score_interval
from hmc.experiments.study import action_bars, runs_of

__all__ = ["CHAINS", "EXPERIMENT", "PAPER", "grid"]

PAPER = {
    "Walking": (96.52, 41.64, 72.05, 79.55, 7.97, 2.51),
    "Jog": (130.34, 62.01, 92.21, 68.24, 9.91, 3.07),
    "Throw/Catch": (145.22, 52.13, 94.69, 61.30, 11.53, 3.47),
    "Gesture": (124.87, 45.66, 90.43, 69.17, 10.96, 4.25),
    "Box": (122.27, 42.68, 92.77, 68.38, 9.54, 4.10),
    AVERAGE: (121.18, 45.92, 90.17, 71.36, 10.12, 3.33),
}
#: Both readings of the thesis's spreads (`filter_study.ANNEALING`), and what tables call them.
READINGS = {"printed": runs.APF, "variances": f"{runs.APF}, P as variances"}
CHAINS = ("default, APF", "canton2009, APF")


def grid(plan: Plan) -> list[dict]:
    """The filter on every action by both actors, three seeds; chains with one seed a recording."""
    return runs.study_grid(plan, [{"annealing": annealing} for annealing in READINGS]) + runs.others_grid(plan, CHAINS)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row an action and way, and bars of mean error, MMTP and MMTA."""
    frame = runs_of(cells)
    groups = {name: list(frame[(frame.method == runs.APF) & (frame.annealing == annealing)].run) for annealing, name in READINGS.items()}
    groups |= {name: list(frame[frame.method == name].run) for name in CHAINS}
    rows = [row for name, own in groups.items() for row in action_rows(own, name, PAPER)]
    chain, mean = (score_interval(groups[CHAINS[0]], score) for score in ("MMTA_percent", "mean_mm"))
    claims = (
        *(
            reaches(f"{name} reaches the thesis's MMTA, from the true first pose", groups[name], PAPER[AVERAGE])
            for name in READINGS.values()
        ),
        decide(
            "from videos alone, default: mean error at most 50 mm and MMTA at 100 mm at least 95 %, with all of their intervals",
            (mean.under(50), chain.over(95)),
            f"{mean} mm, {chain} %",
        ),
    )
    caption = (
        "Markerless pose by action: mean, deviation, MMTP and MMTA (within 100 mm; also 70 and 50 mm), angles of the reference body. "
        "APF starts from the true first pose; the chains have videos alone. The paper: Canton, Table 6.4, on HumanEva-I; here rendered "
        "recordings or the user's."
    )
    figure = action_bars(rows, list(groups), dict.fromkeys(READINGS.values(), PAPER))
    return Report((Table("table-6.4", caption, rows),), {"table-6.4": figure}, claims)


EXPERIMENT = Experiment("table-6.4", "markerless pose by action", "Canton, Table 6.4", grid, runs.cell, report, runs.FAMILY, runs.VERSION)
