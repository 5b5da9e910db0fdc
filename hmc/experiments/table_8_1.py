"""Table 8.1: all methods together: marker based, APF, SHBM-APF with models 1 and 2 at a third of the APF's evaluations, and whole chains.

Source: Canton (2009), section 8.1; its order by MMTP and MMTA is marker based, SHBM 2, SHBM 1, APF.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from hmc.experiments import scalable_runs as runs
from hmc.experiments.by_action import AVERAGE, action_rows
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.five_actions import ACTIONS
from hmc.experiments.pose_intervals import ahead
from hmc.experiments.table_6_3 import PAPER as MARKER_PAPER
from hmc.experiments.table_6_4 import PAPER as APF_PAPER
from hmc.experiments.table_6_4 import bars
from hmc.experiments.table_7_1 import PAPER as SHBM_PAPER

__all__ = ["EXPERIMENT"]

#: Evaluations a frame: the thesis's APF, and a third of it.
EVALUATIONS = {runs.APF: runs.APF_EVALUATIONS} | dict.fromkeys((*runs.SHBM, runs.WHOLE), runs.APF_EVALUATIONS // 3)
PAPERS = {runs.MARKERS: MARKER_PAPER, runs.APF: APF_PAPER} | SHBM_PAPER
METHODS = (runs.MARKERS, *EVALUATIONS, *runs.CHAINS)


def grid(plan: Plan) -> list[dict]:
    """Every method on every action; the filters alone with three seeds even in the quick mode."""
    filters = [{"method": method, "evaluations": evaluations} for method, evaluations in EVALUATIONS.items()]
    others = [{"method": method, "evaluations": 0} for method in METHODS if method not in EVALUATIONS]
    # A filter alone loses or keeps a limb by chance: of a dozen frames one seed says little.
    return runs.method_grid(plan, tuple(ACTIONS), filters, quick_repeats=3) + runs.method_grid(plan, tuple(ACTIONS), others)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row an action and method."""
    groups = runs.by_method(cells)
    rows = [row for method in METHODS for row in action_rows(groups[method], method, PAPERS.get(method, {}))]
    means = {row["method"]: row for row in rows if row["action"] == AVERAGE}
    best = means["default, SHBM-APF"]
    # The printed order: marker based, SHBM 2, SHBM 1, APF.
    order = (runs.MARKERS, runs.SHBM[1], runs.SHBM[0], runs.APF)
    claims = [
        ahead(f"{better} is ahead of {worse} in {score.partition('_')[0]}", groups[better], groups[worse], score, ("method", "evaluations"))
        for better, worse in pairwise(order)
        for score in ("MMTP_mm", "MMTA_percent")
    ]
    claims.append(
        Claim(
            "the whole chain with SHBM-APF: mean error at most 40 mm, MMTA at 100 mm at least 97 %",
            best["mean_mm"] <= 40 and best["MMTA_percent"] >= 97,
            f"{best['mean_mm']:.1f} mm, {best['MMTA_percent']:.1f} %, at 50 mm {best['MMTA_50_percent']:.1f} %",
        )
    )
    caption = (
        "All methods by action. APF and SHBM-APF start from the true first pose and differ in nothing but the filter; chains have videos "
        "alone. The paper: Canton, Table 8.1, on HumanEva-I; here rendered recordings or the user's."
    )
    shown = [method for method in METHODS if method in PAPERS]
    figure = bars(rows, shown, SHBM_PAPER["SHBM-APF, model 2"])
    return Report((Table("table-8.1", caption, rows),), {"table-8.1": figure}, tuple(claims))


EXPERIMENT = Experiment("table-8.1", "all methods by action", "Canton, Table 8.1", grid, runs.cell, report, runs.FAMILY, runs.VERSION)
