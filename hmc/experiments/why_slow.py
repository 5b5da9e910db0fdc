"""How fast a motion the printed annealing can follow, whatever the likelihood is. Ours, not a paper's.

Source of what is changed: Canton (2009), sections 3.2.2 (P0, Eq. 3.22, survival rate), 6.6.1 (3 layers of 700) and 6.7.2 (6 of 600). The
thesis says that P0 is half of the largest variation of each variable in one frame, and prints no number.

A filter whose likelihood knows the true place of every landmark, of a body that can take every pose exactly, has nothing to mistake; what
it loses, the schedule loses. A layer that keeps half of the particles moves their mean by less than their own deviation along one line of
the state space, however strong the likelihood is (its power is chosen so that half survive); who walks moves in many variables at once.
Beside it the same changes of the thesis's marker-based filter, behind the detector of its Table 6.3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from hmc.body.kinematics import landmarks
from hmc.body.model import BodyModel
from hmc.body.proportions import canton_body
from hmc.experiments import marker_runs
from hmc.experiments.engine.experiment import Cell, Experiment, Parameters, Plan, Report, Results
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.intervals import decide
from hmc.experiments.engine.selection import REPEAT
from hmc.experiments.exploratory import action_drift, measured_truth, turned
from hmc.experiments.filter_study import MARKERS, STUDY_FRAMES
from hmc.experiments.five_actions import ACTIONS
from hmc.experiments.markerless_runs import action_sources
from hmc.experiments.pose_intervals import ahead, score_interval
from hmc.experiments.study import change_of, runs_of, score_table, table_of
from hmc.experiments.truth import HEIGHT_M, nearest_states, stature_m
from hmc.search.filters import AnnealedSettings, annealed_step, particle_init

__all__ = ["CHANGES", "EXPERIMENT", "PLACES"]

#: What is seen: the true place of every landmark; or the markers of Table 6.3.
PLACES, SEEN_MARKERS = "true places", "markers"
PRINTED: dict[str, Any] = {"layers": 6, "particles": 600, "spread": "survival", "drift_scale": 1.0}
MARKERS_PRINTED = PRINTED | {"layers": 3, "particles": 700}
AS_PRINTED, AS_PRINTED_3, WIDER = "6 layers of 600, as printed", "3 layers of 700, as printed", "P0 twice as wide"
_VARIANCES = {"spread": "variance"}
#: What is changed, and how, by what is seen.
CHANGES: dict[str, Mapping[str, Mapping[str, Any]]] = {
    PLACES: {
        AS_PRINTED: PRINTED,
        WIDER: PRINTED | {"drift_scale": 2.0},
        "P0 four times as wide": PRINTED | {"drift_scale": 4.0},
        "spreads' factors as variances": PRINTED | _VARIANCES,
        "four times the particles": PRINTED | {"particles": 2400},
        "12 layers of 600": PRINTED | {"layers": 12},
        AS_PRINTED_3: MARKERS_PRINTED,
    },
    SEEN_MARKERS: {
        AS_PRINTED_3: MARKERS_PRINTED,
        WIDER: MARKERS_PRINTED | {"drift_scale": 2.0},
        "P0 four times as wide": MARKERS_PRINTED | {"drift_scale": 4.0},
        "spreads' factors as variances": MARKERS_PRINTED | _VARIANCES,
        "P0 twice as wide, as variances": MARKERS_PRINTED | _VARIANCES | {"drift_scale": 2.0},
    },
}
SURVIVAL = 0.5
#: Actions with steps, and without; who stands is followed where all of MMTA's interval is above so many percent.
STEPS, STANDING = ("Walking", "Jog"), ("Throw/Catch", "Gesture", "Box")
FOLLOWED_PERCENT = 90.0
SEEDS, QUICK_ACTIONS = 3, ("walk", "jog", "gesture", "box")


def grid(plan: Plan) -> list[dict]:
    """Every change on every action, by both actors and, of markers, by the actors in turn; the seeds in turn."""
    actions = QUICK_ACTIONS if plan.quick else tuple(ACTIONS)
    return [
        {"recording": source.label, "seen": seen, "frames": STUDY_FRAMES} | dict(change) | {REPEAT: place % SEEDS}
        for seen, changes in CHANGES.items()
        for place, source in enumerate(action_sources(plan, actions, in_turn=plan.quick or seen == SEEN_MARKERS))
        for change in changes.values()
    ]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Follow the first person from the true first pose; landmarks and truth of the frames after it, metres.

    Of ``true places`` the truth is the pose of the thesis's body that is nearest to the person's, and ``motion_p0`` how far that moves in
    every frame, in units of P0 as printed, over all variables.
    """
    label = parameters["recording"]
    if parameters["seen"] == SEEN_MARKERS:
        return marker_runs.cell({**MARKERS["marker-based APF"], **parameters}, inputs, rng)
    recording = inputs.unseen_recording(label)
    truth, drift = measured_truth(recording, label), action_drift(recording, label)
    body = canton_body(stature_m(recording) or HEIGHT_M)
    states = nearest_states(body, truth.positions[: parameters["frames"] or None])
    true = np.array([landmarks(body, state) for state in states])
    estimates = _follow(rng, body, states[0], true, parameters["drift_scale"] * drift, _settings(parameters))
    return {
        "frames": truth.frames[1 : len(true)],
        "fps": recording.fps,
        "estimate_m": np.array([landmarks(body, state) for state in estimates]).reshape(-1, *true.shape[1:]),
        "truth_m": true[1:],
        "motion_p0": np.linalg.norm(turned(np.diff(states, axis=0)) / drift, axis=1),
    }


def _settings(parameters: Parameters) -> AnnealedSettings:
    return AnnealedSettings(parameters["layers"], parameters["particles"], SURVIVAL, parameters["spread"])


def _follow(
    rng: np.random.Generator, body: BodyModel, first: np.ndarray, true: np.ndarray, sd: np.ndarray, settings: AnnealedSettings
) -> list[np.ndarray]:
    """The estimates of all frames but the first, by a likelihood of the distances of all landmarks from their true places."""
    particles, found = particle_init(first[None]), []
    for places in true[1:]:

        def log_likelihood(states: np.ndarray, places: np.ndarray = places) -> np.ndarray:
            # Without a width: the power of the likelihood follows from the survival rate.
            return -((landmarks(body, states) - places) ** 2).sum(axis=(1, 2))

        particles, info = annealed_step(rng, particles, log_likelihood, sd, body.limits.low, body.limits.high, settings)
        found.append(info.estimate)
    return found


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """MMTA by what is seen, action and change, beside how fast the action is; of each reading of P0 what it brings who walks."""
    frame = runs_of(cells)
    frame["change"] = [change_of(one, CHANGES[one.parameters["seen"]]) for one in cells]
    table = score_table(frame, ("seen", "action", "change"))
    speeds = {action: _speed(list(own.run)) for action, own in frame[frame.seen == PLACES].groupby("action")}
    table.insert(2, "motion_P0_per_frame", [speeds.get(action) for action in table.action])
    figure, panels = plt.subplots(1, len(CHANGES), figsize=(9, 3.4), sharey=True)
    slow_first = sorted(speeds, key=speeds.__getitem__)
    for axes, (seen, own) in zip(panels, table.groupby("seen", sort=False), strict=True):
        for change, line in own.groupby("change", sort=False):
            scores = line.set_index("action").MMTA_percent
            axes.plot(range(len(slow_first)), [scores.get(action, np.nan) for action in slow_first], "o-", label=change)
        axes.set_xticks(range(len(slow_first)), [f"{action}\n{speeds[action]:.1f}" for action in slow_first])
        axes.set(title=f"seen: {seen}", xlabel="action, and its motion (P0 a frame)", ylim=(0, 105))
        axes.legend(fontsize=6)
    panels[0].set_ylabel("MMTA at 100 mm (%)")

    def those(seen: str, change: str, actions: Sequence[str]) -> list[Cell]:
        return list(frame[(frame.seen == seen) & (frame.change == change) & frame.action.isin(actions)].run)

    standing = score_interval(those(PLACES, AS_PRINTED, STANDING), "MMTA_percent")
    walking = those(PLACES, AS_PRINTED, STEPS)
    claims = (
        decide(
            f"a likelihood that knows every place: who stands and moves the arms is followed as printed, {FOLLOWED_PERCENT:g} % or more",
            standing.over(FOLLOWED_PERCENT),
            f"MMTA {standing} %",
        ),
        ahead(
            "it loses who walks and jogs as printed: P0 twice as wide follows them better",
            those(PLACES, WIDER, STEPS), walking, but=("drift_scale",),
        ),
        ahead(
            "three layers, as the marker-based filter has them, follow who walks and jogs less far than six",
            walking, those(PLACES, AS_PRINTED_3, STEPS), but=("layers", "particles"),
        ),
        ahead(
            "of markers: P0 twice as wide follows who walks and jogs better than as printed",
            those(SEEN_MARKERS, WIDER, STEPS), those(SEEN_MARKERS, AS_PRINTED_3, STEPS), but=("drift_scale",),
        ),
    )  # fmt: skip
    caption = (
        "The thesis's annealing from the true first pose: MMTA at 100 mm where the true place of every landmark is what is seen, and where "
        "the markers of Table 6.3 are; how far poses move in the median frame, in P0 over all variables."
    )
    return Report((table_of("why-slow", caption, table),), {"why-slow": figure}, claims)


def _speed(cells: Sequence[Cell]) -> float:
    """In the median frame: blows and throws are short."""
    return float(np.median(np.concatenate([np.asarray(one.results["motion_p0"], float) for one in cells])))


EXPERIMENT = Experiment("why-slow", "how fast a motion the printed annealing can follow", "ours", grid, cell, report)
