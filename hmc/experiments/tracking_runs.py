"""Runs of the person trackers that tables 4.3 and 4.4 and figures 4.11, 4.13 and 4.14 of Canton (2009) share: one cell is one run.

The thesis's recordings (CLEAR 2007: 40 sequences of 5 minutes, up to 5 people in rooms of 5 x 4 m, 4 cameras in the corners and one on the
ceiling, 25 frames a second) are not public; rendered meetings in such a room stand for them (recipes ``meeting_clear_*``: four and five
people, a noisy sensor, chairs, doors, one room without the camera overhead), or the user's recordings. As CLEAR does, centroids are
compared with the true centres of the heads, in the xy plane (section 4.4.1); beside that with the true centroids.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import repeat

import numpy as np

from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell, Parameters, Plan, Results, Source
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.experiments.engine.style import COLORS
from hmc.experiments.observations import observations
from hmc.io.recording import iterate_frames
from hmc.io.results import TrackTable, read_centroids
from hmc.metrics.scores import evaluate_tracks
from hmc.plugins import load_plugins
from hmc.tracking.following import finish, init
from hmc.tracking.resumable import Timing
from hmc.tracking.state import TrackRow
from hmc.tracking.trackers import TRACKERS, Tracker, make_tracker
from hmc.tracking.tracks import frame_rng, table_of
from hmc.tracking.views import FrameViews

__all__ = [
    "FAMILY", "PRESETS", "REFERENCES", "VERSION", "Method", "Score", "cell", "errors_of", "follow", "method_name", "methods",
    "parameters_of", "scores_of", "sources", "style_of", "voxel_sizes",
]  # fmt: skip

FAMILY = "tracking"
VERSION = 3

Method = tuple[str, bool]
#: What is compared; a tracker that lacks one of them is run with the others.
PRESETS = ("default", "canton2009")
#: With what a centroid is compared: the true center of the head, as CLEAR does, and the true centroid.
REFERENCES = ("head", "centroid")
_QUICK, _FULL = ("meeting_clear_2",), tuple(f"meeting_clear_{k}" for k in range(1, 6))


@dataclass(frozen=True)
class Score:
    """What several runs of one configuration came to.

    Attributes
    ----------
    motp_mm, mota : float
        Over all runs together (Eq. 4.22 and 4.23), against heads; MOTA as a fraction.
    false_positives, misses, mismatches : float
        Rates: of the true positions in all frames.
    centroid_motp_mm : float
        MOTP against true centroids.
    rtf : float
        Real-time factor of the filter alone (Eq. 4.27, 4.34).
    filter_s : float
        Processor seconds of the filter a frame and person.
    """

    motp_mm: float
    mota: float
    false_positives: float
    misses: float
    mismatches: float
    centroid_motp_mm: float
    rtf: float
    filter_s: float


def sources(plan: Plan) -> tuple[Source, ...]:
    """The user's recordings, or the rendered ones."""
    return plan.recordings or tuple(rendered(name) for name in (_QUICK if plan.quick else _FULL))


def voxel_sizes(plan: Plan) -> tuple[float, ...]:
    """The thesis's voxel sizes, metres; the finest is for full runs."""
    return (0.15, 0.05) if plan.quick else (0.15, 0.10, 0.05, 0.02)


def methods(preset: str | None = None) -> dict[Method, str]:
    """Each registered tracker without and with color, where it can, and what tables call it; only those that have a preset, if given."""
    load_plugins()
    return {
        (name, color): (method.label or name) + (f" {'color' if color else 'raw'}" if method.uses_colors else "")
        for name, method in TRACKERS.items()
        if preset is None or preset in method.presets
        for color in ((False, True) if method.uses_colors else (False,))
    }


def parameters_of(label: str, voxel_m: float, method: Method, particles: int | None, preset: str, repeat: int) -> dict:
    """The parameters of one run."""
    tracker, color = method
    return {
        "recording": label,
        "voxel_m": voxel_m,
        "tracker": tracker,
        "color": color,
        "particles": particles,
        "preset": preset,
        "repeat": repeat,
    }


def method_name(parameters: Parameters) -> str:
    """What tables call the method of a run."""
    return methods()[parameters["tracker"], parameters["color"]]


def style_of(tracker: str, color: bool) -> dict[str, str]:
    """How a tracker's lines are drawn: with color whole, without dashed where it could use colors."""
    return {"color": COLORS.get(tracker, COLORS["other"]), "linestyle": "-" if color or not TRACKERS[tracker].uses_colors else "--"}


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Follow all persons through a recording and score it."""
    tracks, timing, fps = follow(parameters, inputs, int(rng.integers(2**31)))
    return {
        **errors_of(tracks, read_centroids(inputs.truth(parameters["recording"]))),
        "frames": timing.frames,
        "fps": fps,
        "rows": len(tracks.frames),
        "filter_s": timing.filter_s,
        "color_s": timing.input_s,
    }


def errors_of(tracks: TrackTable, truth: TrackTable) -> Results:
    """What CLEAR MOT counts, against each of `REFERENCES`."""
    if truth.heads is None:
        raise InputError("the true centroids have no heads, against which trackers are measured; render the recording again")
    places = {"head": truth.heads, "centroid": truth.positions}
    scores = {name: evaluate_tracks(tracks, replace(truth, positions=places[name])) for name in REFERENCES}
    return {
        name: {
            "objects": one.objects,
            "misses": one.misses,
            "false_positives": one.false_positives,
            "mismatches": one.mismatches,
            "matches": len(one.distances),
            "distance_m": float(np.sum(one.distances)),
        }
        for name, one in scores.items()
    }


def follow(parameters: Parameters, inputs: Inputs, seed: int, tracker: Tracker | None = None) -> tuple[TrackTable, Timing, float]:
    """Tracks of a run, the processor time spent, and the recording's frames a second; by a tracker other than its parameters', if given."""
    label, color = parameters["recording"], parameters["color"]
    recording = inputs.recording(label)
    tracker = tracker or make_tracker(parameters["tracker"], color=color, particles=parameters["particles"], preset=parameters["preset"])
    state, timing = init(recording.fps, recording.persons), Timing()
    rows: list[TrackRow] = []
    images: Iterator = (frame.images for frame in iterate_frames(recording)) if color else repeat(())
    for (frame, observation), pictures in zip(observations(inputs, label, parameters["voxel_m"]), images, strict=False):
        if observation is not None and observation.views is not None:
            observation = replace(observation, views=FrameViews(recording.rig, observation.views.masks, pictures))
        state, info = tracker.step(frame_rng(seed, frame), state, frame, observation)
        timing = timing.plus(Timing(1, info.color_s, info.filter_s, 0.0))
        rows += info.rows
    rows += finish(state, recording.n_frames, tracker.following)
    return table_of(rows, recording.fps), timing, recording.fps


def scores_of(cells: Sequence[Cell]) -> Score:
    """Runs of one configuration, over recordings and repeats, taken together."""
    head, centroid = ({key: sum(one.results[name][key] for one in cells) for key in cells[0].results[name]} for name in REFERENCES)
    total = {key: sum(one.results[key] for one in cells) for key in ("filter_s", "rows")}
    objects = max(head["objects"], 1)
    recorded_s = sum(one.results["frames"] / one.results["fps"] for one in cells)
    return Score(
        motp_mm=_motp_mm(head),
        mota=1 - (head["misses"] + head["false_positives"] + head["mismatches"]) / objects,
        false_positives=head["false_positives"] / objects,
        misses=head["misses"] / objects,
        mismatches=head["mismatches"] / objects,
        centroid_motp_mm=_motp_mm(centroid),
        rtf=recorded_s / max(total["filter_s"], 1e-9),
        filter_s=total["filter_s"] / max(total["rows"], 1),
    )


def _motp_mm(errors: Mapping[str, float]) -> float:
    return 1000 * errors["distance_m"] / errors["matches"] if errors["matches"] else float("nan")
