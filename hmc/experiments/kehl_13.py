"""Figures 12 and 13: Stochastic Meta Descent against Levenberg-Marquardt, with equal points and with five times the points.

Source: Kehl (2006), section 7.3. There: SMD 2.89 cm at 1.3 frames a second; LM loses track with equal points and has 4.27 cm at .73 with
five times the points. Twice: with nothing of ours ("as printed", `kehl2006`), which the claims are about, and in the house's company. When
Levenberg-Marquardt stops is not printed: each kind has the tolerance with which it is nearest on a clip apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from hmc.experiments import kehl_runs
from hmc.experiments.drill_clips import clip_names, training_name
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Table
from hmc.experiments.engine.inputs import rendered
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.selection import REPEAT
from hmc.experiments.engine.style import COLORS

__all__ = ["EXPERIMENT"]

#: What a variant's name ends with, and what the table says.
ENDINGS = {", as printed": "as printed", "": "default"}
METHODS = {"SMD": COLORS["sparse"], "LM": COLORS["naive"], "LM, 5 times the points": COLORS["particle"]}
#: In the table alone: what the comparison owes to the stop and to the axes of the descent.
BESIDE = {", as printed": kehl_runs.QUARTER, "": "SMD along the parameters"}
PAPER = {"SMD": (28.9, 1.3), "LM, 5 times the points": (42.7, 0.73)}


def grid(plan: Plan) -> list[dict]:
    """Every method on every clip, and Levenberg-Marquardt with every tolerance on the clip to train on, once."""
    stops = _lm_variants(kehl_runs.TOLERANCES[: 2 if plan.quick else None])
    tests = kehl_runs.cell_grid(plan, clip_names("kick_turn"), [*(f"SMD{ending}" for ending in ENDINGS), *BESIDE.values(), *stops])
    if plan.recordings:  # these may be anything: there is none apart
        return tests
    apart = replace(plan, recordings=(rendered(training_name("kick_turn")),))
    return tests + [one for one in kehl_runs.cell_grid(apart, (), stops) if one[REPEAT] == 0]


def _lm_variants(tolerances: Sequence[float]) -> list[str]:
    return [f"{kehl_runs.lm_name(times, stop)}{ending}" for ending in ENDINGS for times in (1, 5) for stop in tolerances]


def best_stop(training: Sequence[Cell], times: int, ending: str) -> tuple[float, str]:
    """The tolerance with which Levenberg-Marquardt is nearest on the training clip, and the variant's name."""
    names = {stop: f"{kehl_runs.lm_name(times, stop)}{ending}" for stop in kehl_runs.TOLERANCES}
    found = {stop: kehl_runs.of_variant(training, name) for stop, name in names.items()}
    errors = {stop: kehl_runs.error_interval(own).value for stop, own in found.items() if own}
    stop = min(errors, key=errors.__getitem__) if errors else kehl_runs.TOLERANCES[1]
    return stop, names[stop]


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Errors and times over the frames, their means with intervals, and the paper's claims."""
    apart = [one for one in cells if str(one.parameters["recording"]).startswith(f"{training_name('kick_turn')}@")]
    tests = [one for one in cells if one not in apart]
    figure, panels = plt.subplots(2, len(ENDINGS), figsize=(10, 5), sharex=True, sharey="row", squeeze=False)
    rows, claims = [], []
    for column, (ending, family) in zip(panels.T, ENDINGS.items(), strict=True):
        stops = {name: best_stop(apart, times, ending) for name, times in (("LM", 1), ("LM, 5 times the points", 5))}
        variants = {"SMD": f"SMD{ending}"} | {name: variant for name, (_, variant) in stops.items()}
        groups = {name: kehl_runs.of_variant(tests, variant) for name, variant in variants.items()}
        for name, own in groups.items():
            first = own[0].results
            column[0].plot(first["frames"], 1000 * np.array(first["seconds"]), color=METHODS[name])
            column[1].plot(first["frames"], kehl_runs.errors_mm(own[0]).mean(axis=1), color=METHODS[name], label=name)
            rows.append(_row(name, family, own, stops.get(name, (None,))[0], PAPER.get(name, (None, None))))
        column[0].set(title=family, yscale="log")
        rows.append(_row(BESIDE[ending].replace(ending, ""), family, kehl_runs.of_variant(tests, BESIDE[ending]), None, (None, None)))
        if ending:
            claims = _claims(groups)
    panels[0, 0].set(ylabel="processor time, ms")
    panels[1, -1].legend(loc="upper left")  # of `default`, whose errors leave room under those of the printed preset
    panels[1, 0].set(ylabel="mean joint error, mm", xlabel="frame")
    caption = (
        "Stochastic Meta Descent and Levenberg-Marquardt on kicks and a turn; the tracker's processor time. LM stops at the tolerance that "
        "is best on a clip apart. The paper: Kehl, Figure 13."
    )
    return Report((Table("kehl-13", caption, rows),), {"kehl-13": figure}, tuple(claims))


def _row(name: str, family: str, own: Sequence[Cell], stop: float | None, paper: tuple[float | None, float | None]) -> dict:
    errors = [kehl_runs.errors_mm(one) for one in own]
    found = kehl_runs.error_interval(own)
    return {
        "method": name, "preset": family, "runs": len(own), "mean_error_mm": found.value, "low_mm": found.low, "high_mm": found.high,
        "worst_run_mm": float(max(one.mean() for one in errors)), "within_100mm": float(np.mean([(one <= 100).mean() for one in errors])),
        "frames_per_s": 1 / float(np.mean(np.concatenate([one.results["seconds"] for one in own]))),
        "iterations_mean_of_six": float(np.mean([np.array(one.results["iterations"]).mean() for one in own])), "lm_stop": stop,
        "paper_mean_error_mm": paper[0], "paper_frames_per_s": paper[1],
    }  # fmt: skip


def _claims(groups: dict[str, list[Cell]]) -> list[Claim]:
    """The paper's, of the methods as printed. Who is lost is no faster and no nearer than anybody."""
    smd, equal, five = groups.values()
    followed = {name: kehl_runs.following(own) for name, own in groups.items()}
    errors = {name: kehl_runs.error_interval(own) for name, own in groups.items()}
    nearer, nearer_five = kehl_runs.joint_gain(smd, equal), kehl_runs.joint_gain(smd, five)
    quicker = kehl_runs.seconds_gain(smd, five)
    both = f"SMD {errors['SMD']}, LM {errors['LM']}, with five times the points {errors['LM, 5 times the points']} mm"
    return [
        decide("SMD follows the whole sequence", followed["SMD"], f"{errors['SMD']} mm"),
        decide("LM with equal points loses the track, SMD does not", (followed["SMD"], errors["LM"].over(kehl_runs.FOLLOWED_MM)), both),
        decide("SMD is nearer than LM with equal points", (followed["SMD"], nearer), f"{both}: by {nearer}"),
        decide("LM with five times the points follows the whole sequence", followed["LM, 5 times the points"], both),
        decide("SMD is nearer than LM with five times the points", (followed["SMD"], nearer_five), f"{both}: by {nearer_five}"),
        decide(
            "SMD takes less time a frame than LM with five times the points", (followed["SMD"], quicker),
            f"by {quicker} ms; both {'followed' if all(one.above_zero for one in followed.values()) else 'not all followed'}",
        ),
    ]  # fmt: skip


EXPERIMENT = Experiment(
    "kehl-13", "SMD against Levenberg-Marquardt", "Kehl, Figures 12 and 13", grid, kehl_runs.cell, report, family=kehl_runs.FAMILY,
    version=kehl_runs.VERSION,
)  # fmt: skip
