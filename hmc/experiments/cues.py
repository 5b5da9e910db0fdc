"""Silhouettes, keypoints of a 2-D detector, or both: how near each comes with how many cameras, and what a detector's faults cost. Ours.

Scored are the 12 joints of the limbs, which all three have. Detections of rendered recordings are pretended and no measure of any detector;
recordings with a real detector's keypoints and another system's joints for a truth are in the tables, and in no claim.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from hmc.errors import InputError
from hmc.experiments.chain_runs import FEW, MANY, name_of
from hmc.experiments.cue_runs import BOTH, FAMILY, KEYPOINTS, SILHOUETTES, VERSION, WAYS, cell
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Source, Table
from hmc.experiments.engine.inputs import recipe_of, rendered
from hmc.experiments.engine.intervals import Interval, decide
from hmc.experiments.engine.style import COLORS
from hmc.experiments.keypoint_faults import FAULTS, NO_FAULT
from hmc.experiments.run_means import RunValues, gains, mean_interval, run_values
from hmc.experiments.truth import estimates
from hmc.io.keypoints import open_keypoints
from hmc.io.recording import open_recording
from hmc.landmarks import LANDMARKS
from hmc.metrics.landmarks import landmark_errors
from hmc.synthetic.rigs import RIGS

__all__ = ["EXPERIMENT"]

RECORDINGS = ("box", "jog", "gesture", "crossing", "pale", "sit")
QUICK_RECORDINGS = ("box", "jog")
FRAMES, QUICK_FRAMES = 90, 45
SEEDS, QUICK_SEEDS = 3, 1
#: Numbers of cameras beside all of them.
CAMERAS, QUICK_CAMERAS = (2, 3, FEW, MANY), (FEW,)
FAR_MM, NEAR_MM = 100.0, 50.0
#: What a fault may cost both cues together, and how far wrists may be off with `FEW` cameras or `MANY`.
COST_MM, WRIST_MM = 5.0, 20.0
LIMBS = [k for k, name in enumerate(LANDMARKS) if name.startswith(("l_", "r_"))]
WRISTS = [k for k, name in enumerate(LANDMARKS) if name.endswith("wrist")]
#: Of a run: a recording and a seed.
ByCameras = Mapping[int, RunValues]


def grid(plan: Plan) -> list[dict[str, Any]]:
    """Every recording with all and with fewer cameras, all three ways; then, with four cameras, the faults.

    Raises
    ------
    InputError
        When the user's recordings are without keypoints.
    """
    sources = _with_keypoints(plan.recordings) or tuple(map(rendered, QUICK_RECORDINGS if plan.quick else RECORDINGS))
    frames, seeds, fewer = (QUICK_FRAMES, QUICK_SEEDS, QUICK_CAMERAS) if plan.quick else (FRAMES, SEEDS, CAMERAS)
    rigs = {source.label: _n_cameras(source) for source in sources}

    def one(source: Source, cameras: int, cues: str, fault: str, repeat: int) -> dict[str, Any]:
        return {"recording": source.label, "cameras": cameras, "cues": cues, "fault": fault, "frames": frames, "repeat": repeat}

    # Cells that share silhouettes are apart, so that no worker waits for another's.
    plain = [
        one(source, cameras, cues, NO_FAULT, repeat)
        for cues in WAYS
        for repeat in range(seeds)
        for cameras in (0, *fewer)
        for source in sources
        if cameras < rigs[source.label]
    ]
    faulty = [
        one(source, FEW if rigs[source.label] > FEW else 0, cues, fault, repeat)
        for fault in FAULTS
        for cues in (BOTH, KEYPOINTS)
        for repeat in range(seeds)
        for source in sources
        if rigs[source.label] >= FEW
    ]
    return plain + faulty


def _with_keypoints(sources: Sequence[Source]) -> tuple[Source, ...]:
    """Those for which there are keypoints, or for which they are pretended."""
    kept = tuple(one for one in sources if one.folder is None or _has_keypoints(one.folder))
    if sources and not kept:
        raise InputError(f"none of the recordings has keypoints ({', '.join(one.name for one in sources)}); see docs/conventions.md")
    return kept


def _has_keypoints(folder: Path) -> bool:
    try:
        return open_keypoints(open_recording(folder)) is not None
    except InputError:  # its cells tell what is wrong
        return True


def _n_cameras(source: Source) -> int:
    """Cameras of a source; of a recording that cannot be opened, as if it had one."""
    if source.folder is None:
        return sum(RIGS[recipe_of(source.name).rig.kind])
    try:
        return len(open_recording(source.folder).rig)
    except InputError:
        return 1


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """A row a recording, number of cameras and way; a row a fault and way."""
    plain = [one for one in cells if one.parameters["fault"] == NO_FAULT]
    groups: dict[tuple[str, int, str], list[Cell]] = {}
    for one in plain:
        groups.setdefault((one.parameters["recording"], one.results["cameras"], one.parameters["cues"]), []).append(one)
    rows = [_row(own) for _, own in sorted(groups.items(), key=lambda pair: (pair[0][0], -pair[0][1]))]
    costs = {key: _costs(cells, *key) for key in ((fault, cues) for fault in FAULTS for cues in (BOTH, KEYPOINTS))}
    pretended = "" if plan.recordings else " Detections are pretended: they are no measure of any detector."
    caption = (
        "Silhouettes alone, keypoints alone (lines of sight met robustly, low-passed at 6 Hz) and both (the command hmc pose with "
        "keypoints): mean error of the 12 joints of the limbs that were found, with its interval of 95 % over seeds, and median; share "
        "within 100 and 50 mm, and not found at all; wrists apart." + pretended
    )
    faults_caption = (
        f"What a detector's faults in one person cost with {FEW} cameras: mean error of the limbs without and with the fault, the "
        "difference with its interval of 95 % over recordings and seeds, over the whole run and in the fault's own frames." + pretended
    )
    tables = (
        Table("cues", caption, rows),
        Table("cues-faults", faults_caption, [_fault_row(*key, *found) for key, found in costs.items() if found[0]]),
    )
    own = [one for one in cells if not one.results["reference"]]
    return Report(tables, {"cues": _draw(plain, costs)}, tuple(_claims(own)))


def _errors_mm(one: Cell, joints: Sequence[int] = LIMBS, frames: tuple[int, int] | None = None) -> np.ndarray:
    """Errors of some joints, (n, len(joints)): infinite where nothing was found, NaN without a truth."""
    errors = 1000 * landmark_errors(*estimates(one))[:, list(joints)]
    if frames is None:
        return errors
    numbers = np.array(one.results["frames"])
    return errors[(numbers >= frames[0]) & (numbers < frames[1])]


def _of_found(errors: np.ndarray, figure: Callable[[np.ndarray], Any]) -> float:
    found = errors[np.isfinite(errors)]
    return float(figure(found)) if len(found) else np.nan


def _mean_mm(one: Cell, joints: Sequence[int] = LIMBS, frames: tuple[int, int] | None = None) -> float:
    return _of_found(_errors_mm(one, joints, frames), np.mean)


def _median_mm(one: Cell) -> float:
    return _of_found(_errors_mm(one), np.median)


def _percent(one: Cell, within_mm: float, joints: Sequence[int] = LIMBS) -> float:
    errors = _errors_mm(one, joints)
    true = errors[~np.isnan(errors)]
    return float(100 * (true <= within_mm).mean()) if len(true) else np.nan


def _row(cells: Sequence[Cell]) -> dict[str, Any]:
    first, mean = cells[0], mean_interval(run_values(cells, _mean_mm))

    def over_seeds(value: Callable[[Cell], float]) -> float:
        return mean_interval(run_values(cells, value)).value

    return {
        "recording": name_of(first),
        "cameras": first.results["cameras"],
        "cues": first.parameters["cues"],
        **_columns("mean", mean),
        "median_mm": over_seeds(_median_mm),
        "within_100_percent": over_seeds(partial(_percent, within_mm=FAR_MM)),
        "within_50_percent": over_seeds(partial(_percent, within_mm=NEAR_MM)),
        "not_found_percent": 100 - over_seeds(partial(_percent, within_mm=np.finfo(float).max)),
        "wrists_mm": over_seeds(partial(_mean_mm, joints=WRISTS)),
        "wrists_within_50_percent": over_seeds(partial(_percent, within_mm=NEAR_MM, joints=WRISTS)),
        "truth": "another system's" if first.results["reference"] else "rendered",
    }


def _columns(name: str, found: Interval) -> dict[str, float | None]:
    low, high = (float(end) if np.isfinite(end) else None for end in (found.low, found.high))
    return {f"{name}_mm": found.value if np.isfinite(found.value) else None, f"{name}_low_mm": low, f"{name}_high_mm": high}


def _fault_row(fault: str, cues: str, whole: RunValues, there: RunValues, before: RunValues) -> dict[str, Any]:
    without = mean_interval({run: before[run] for run in whole}).value
    cost = mean_interval(whole)
    means = {"without_mm": without, "with_mm": without + cost.value}
    return {"fault": fault, "cues": cues, **means, **_columns("costs", cost), **_columns("costs_while_it_lasts", mean_interval(there))}


def _costs(cells: Sequence[Cell], fault: str, cues: str) -> tuple[RunValues, RunValues, RunValues]:
    """What a fault adds to the mean error of each run, over all frames and over its own; and the error without it."""
    own = [one for one in cells if one.parameters["cues"] == cues]
    faulty = {_run_of(one): one for one in own if one.parameters["fault"] == fault}
    sound = {_run_of(one): one for one in own if one.parameters["fault"] == NO_FAULT}
    whole: dict[tuple[str, Hashable], float] = {}
    there: dict[tuple[str, Hashable], float] = {}
    before: dict[tuple[str, Hashable], float] = {}
    for run, one in faulty.items():
        if run not in sound:
            continue
        recording, _, seed = run
        frames = (int(one.results["faulty"][0]), int(one.results["faulty"][1]))
        added = _mean_mm(one) - _mean_mm(sound[run])
        inside = _mean_mm(one, frames=frames) - _mean_mm(sound[run], frames=frames)
        if np.isfinite([added, inside]).all():
            whole[recording, seed], there[recording, seed], before[recording, seed] = added, inside, _mean_mm(sound[run])
    return whole, there, before


def _run_of(one: Cell) -> tuple[str, int, Hashable]:
    """What a cell shares with the same one without its fault."""
    return one.parameters["recording"], one.parameters["cameras"], one.parameters["repeat"]


def _claims(cells: Sequence[Cell]) -> Iterator[Claim]:
    """Of the recordings with a truth of their own; nothing of a number of cameras that none of them has."""
    plain = [one for one in cells if one.parameters["fault"] == NO_FAULT]
    means = {cues: _by_cameras(plain, cues, _mean_mm) for cues in WAYS}
    for n in CAMERAS:
        for other in (SILHOUETTES, KEYPOINTS):
            gain = gains(means[other].get(n, {}), means[BOTH].get(n, {}))
            if gain:
                found, pair = mean_interval(gain), [mean_interval({run: means[cues][n][run] for run in gain}) for cues in (BOTH, other)]
                detail = f"{pair[0].value:.1f} mm for {pair[1].value:.1f}: nearer by {found} mm, {_of_runs(gain)}"
                yield decide(f"{n} cameras: both are nearer than {other} alone", found, detail)
    wrists = _by_cameras(plain, BOTH, partial(_mean_mm, joints=WRISTS))
    for n in (MANY, FEW):
        if wrists.get(n):
            found = mean_interval(wrists[n])
            yield Claim(
                f"{n} cameras, both: wrists {WRIST_MM:g} mm at most", bool(found.value <= WRIST_MM), f"{found} mm, {_of_runs(wrists[n])}"
            )
    for fault in FAULTS:
        whole, there, _ = _costs(cells, fault, BOTH)
        for when, cost in (("", whole), (" while it lasts", there)):
            if cost:
                found = mean_interval(cost)
                yield decide(f"{fault}: costs both less than {COST_MM:g} mm{when}", found.under(COST_MM), f"{found} mm, {_of_runs(cost)}")


def _by_cameras(cells: Sequence[Cell], cues: str, value: Callable[[Cell], float]) -> ByCameras:
    """A figure of every run of one way, by how many cameras there were."""
    own = [one for one in cells if one.parameters["cues"] == cues]
    numbers = sorted({int(one.results["cameras"]) for one in own})
    return {n: run_values([one for one in own if one.results["cameras"] == n], value) for n in numbers}


def _of_runs(values: RunValues) -> str:
    n = len({recording for recording, _ in values})
    return f"{n} recording{'s' * (n > 1)}"


def _draw(plain: Sequence[Cell], costs: Mapping[tuple[str, str], tuple[RunValues, RunValues, RunValues]]) -> plt.Figure:
    """Errors against the number of cameras, means over the recordings that have so many; beside it what the faults cost."""
    shades = {SILHOUETTES: COLORS["sparse"], KEYPOINTS: COLORS["naive"], BOTH: COLORS["particle"]}
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2))
    for cues in WAYS:
        means = {n: mean_interval(values) for n, values in _by_cameras(plain, cues, _mean_mm).items() if values}
        left.plot(list(means), [found.value for found in means.values()], "o-", color=shades[cues], label=cues)
        for n, found in means.items():
            if np.isfinite([found.low, found.high]).all():
                left.plot([n, n], [max(found.low, 0), found.high], color=shades[cues], linewidth=0.8)
    left.set(xlabel="cameras", ylabel="mean error of the limbs (mm)", yscale="log")  # with two cameras hulls are far off
    left.set_xticks(sorted({int(one.results["cameras"]) for one in plain}))
    left.set_yticks([10, 20, 50, 100, 200, 500], minor=False)
    left.yaxis.set_major_formatter("{x:g}")
    left.yaxis.set_minor_formatter("")
    left.legend()
    for shift, cues in ((-0.18, BOTH), (0.18, KEYPOINTS)):
        places = np.arange(len(FAULTS)) + shift
        there = [mean_interval(costs[fault, cues][1]).value for fault in FAULTS]
        right.barh(places, there, 0.32, color=shades[cues], label=cues)
    right.axvline(COST_MM, color=COLORS["paper"], linewidth=0.8, linestyle=":")
    right.set_yticks(np.arange(len(FAULTS)), [fault.replace(" in ", "\nin ").replace(" for ", "\nfor ") for fault in FAULTS])
    right.set(xlabel=f"added error while it lasts (mm), {FEW} cameras")
    right.invert_yaxis()
    right.legend()
    return figure


EXPERIMENT = Experiment(
    "cues",
    "silhouettes, keypoints, both",
    "ours; docs/accuracy.md",
    grid,
    cell,
    report,
    FAMILY,
    VERSION,
)
