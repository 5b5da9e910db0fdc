"""Figure 8.1: APF and SHBM-APF by evaluations a frame: SHBM better at every count.

Source: Canton (2009), section 8.1; at 2,200 the thesis has 58.0 % better MMTP and 51.2 % better MMTA. Of what it is a share it does not
say: 76.85 over 71.36 % of MMTA it calls 7.69 % better, which is of the smaller, and 71.06 over 54.74 % it calls 22.96 %, which is of the
larger; gains here are of APF's. Beside the printed annealing stands the strong one, with our models.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt

from hmc.experiments import filter_study as runs
from hmc.experiments.by_action import pose_scores
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.intervals import all_of
from hmc.experiments.pose_intervals import ahead
from hmc.experiments.study import draw_lines, runs_of, score_table, table_of

__all__ = ["EXPERIMENT", "settings_of"]

COUNTS = {False: (600, 1200, 2200, 3600), True: (600, 1200)}
METHODS = (runs.APF, *runs.SHBM[:2])
#: Where the thesis states the gains, and its gains in MMTP and MMTA, percent of the APF's.
STATED, PAPER_GAINS = 2200, (58.0, 51.2)


def settings_of(method: str, annealing: str, evaluations: int) -> dict:
    """A method's settings for about so many evaluations a frame: particles of the plain filter, or particles a dimension."""
    setting = {"method": method, "annealing": annealing}
    if method == runs.APF:
        return setting | {"particles": round(evaluations / runs.BASE["layers"])}
    one = runs.evaluations(runs.BASE | setting | {"gamma": 1000.0}) / 1000
    return setting | {"gamma": round(evaluations / one, 2)}


def grid(plan: Plan) -> list[dict]:
    """Every method with every count and both ways of annealing."""
    settings = [settings_of(method, annealing, count) for annealing in runs.ANNEALING for method in METHODS for count in COUNTS[plan.quick]]
    return runs.study_grid(plan, settings, runs.STUDY_FRAMES, share="third")


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTP and MMTA by evaluations, a row of panels a way of annealing; the claims are the thesis's, on its own annealing."""
    frame = runs_of(cells)
    frame["evaluations"] = [_count(one, plan) for one in cells]
    table = score_table(frame, ("annealing", "method", "evaluations"))
    ways = [annealing for annealing in runs.ANNEALING if (table.annealing == annealing).any()]
    figure, panels = plt.subplots(len(ways), 2, figsize=(7.5, 1.2 + 1.5 * len(ways)), sharex=True, squeeze=False)
    for annealing, line in zip(ways, panels, strict=True):
        own = table[table.annealing == annealing]
        for axes, column, label in zip(line, ("MMTP_mm", "MMTA_percent"), ("MMTP (mm)", "MMTA at 100 mm (%)"), strict=True):
            draw_lines(axes, own, "evaluations", column, "method", title=f"{annealing} annealing", xlabel="evaluations", ylabel=label)
    panels[0, 1].legend()
    printed, claims = frame[frame.annealing == "printed"], []
    for method in METHODS[1:]:
        for score in ("MMTP_mm", "MMTA_percent"):
            claims.append(_at_every_count(printed, method, score))
    caption = "APF and SHBM-APF by evaluations of the likelihood a frame (Canton, Figure 8.1, drawn without numbers)."
    stated = min(COUNTS[plan.quick], key=lambda count: abs(count - STATED))
    gains = Table("fig-8.1-gains", f"Gains of SHBM-APF over APF at {stated:,} evaluations (Canton, section 8.1).", _gains(frame, stated))
    return Report((table_of("fig-8.1", caption, table), gains), {"fig-8.1": figure}, tuple(claims))


def _count(one: Cell, plan: Plan) -> int:
    found = runs.evaluations(one.parameters)
    return min(COUNTS[plan.quick], key=lambda count: abs(count - found))


def _at_every_count(frame, method: str, score: str) -> Claim:
    """One claim of all counts: each must hold by itself."""
    parts = []
    for count, own in frame.groupby("evaluations"):
        better, worse = (list(own[own.method == name].run) for name in (method, runs.APF))
        parts.append(ahead(f"{count:,}", better, worse, score, ("method", "particles", "gamma")))
    name = score.partition("_")[0]
    detail = "; ".join(f"{part.text}: {part.detail}" for part in parts)
    return all_of(f"{method} better than APF in {name} at every count", parts, detail)


def _gains(frame, count: int) -> list[dict]:
    rows = []
    for annealing, own in frame[frame.evaluations == count].groupby("annealing", sort=False):
        plain = pose_scores(list(own[own.method == runs.APF].run))
        for method in METHODS[1:]:
            scores = pose_scores(list(own[own.method == method].run))
            rows.append(
                {
                    "annealing": annealing,
                    "method": method,
                    "evaluations": count,
                    "MMTP_gain_percent": 100 * (1 - scores["MMTP_mm"] / plain["MMTP_mm"]),
                    "MMTP_gain_paper_percent": PAPER_GAINS[0],
                    "MMTA_gain_percent": 100 * (scores["MMTA_percent"] / plain["MMTA_percent"] - 1) if plain["MMTA_percent"] else None,
                    "MMTA_gain_paper_percent": PAPER_GAINS[1],
                }
            )
    return rows


EXPERIMENT = Experiment(
    "fig-8.1", "APF and SHBM-APF by evaluations", "Canton, Figure 8.1", grid, runs.cell, report, runs.FAMILY, runs.VERSION
)
