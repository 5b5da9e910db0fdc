"""What each repair of a silhouette is for: overlap with the true silhouettes with all of them, and without one after the other. Ours.

A repair is worth its place where it adds a hundredth on two recordings, and on two more for each it takes one from, and is wrong where it
takes more than that on any. Each camera's overlap (intersection over union) in the frames of which the truth is there, on their mean
over cameras and frames; and the same of the strict hulls that all cameras' silhouettes leave, in voxels of 4 cm, against those of the
true ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hmc.camera.segmentation import SegmentationSettings
from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.experiments.study import recording_bars
from hmc.io.true_silhouettes import true_silhouettes
from hmc.tracking.resumable import person_grid
from hmc.voxels.carving import carve, make_tables
from hmc.voxels.hulls import FrontendSettings, stream_masks

__all__ = ["EXPERIMENT", "WITHOUT"]

CLIPS = (
    "close_white",
    "close_queue",
    "pale",
    "crossing",
    "sit",
    "close_table",
    "bystander",
    "box",
    "throw_catch",
    "meeting_moved",
    "tan",
    "slate",
)
QUICK_CLIPS = 3
FRAMES, QUICK_FRAMES = 120, 61
VOXEL_M = 0.04
ALL = "all repairs"
_NO_GAPS = {"gap_threshold": 1e9, "reach_threshold": 1e9}
#: What is left out, as changes of `SegmentationSettings` and of `FrontendSettings`.
WITHOUT: dict[str, tuple[Mapping[str, Any], Mapping[str, Any]]] = {
    ALL: ({}, {}),
    "chances of shades": ({"least_chance": 0.0}, {}),
    "filling of gaps": (_NO_GAPS, {}),
    "cutting of halos": ({"halo_share": 0.0}, {}),
    "the floor as others see it": ({}, {"ask_floor": False}),
    "completion by other cameras": ({}, {"complete": False}),
    "cutting of shadows": ({}, {"cut_shadows": False}),
    "all of these": (_NO_GAPS | {"halo_share": 0.0, "least_chance": 0.0}, {"ask_floor": False, "complete": False, "cut_shadows": False}),
}
#: A repair may cost so much overlap on a recording, and is to add as much on so many, beyond two for each it takes as much from: of many
#: recordings some gain by chance, and as many lose.
MOST_HARM, LEAST_GAIN, LEAST_CLIPS = 0.01, 0.01, 2


def grid(plan: Plan) -> list[dict]:
    """A cell a recording and repair that is left out."""
    sources = plan.recordings or tuple(rendered(name) for name in CLIPS[: QUICK_CLIPS if plan.quick else None])
    frames = QUICK_FRAMES if plan.quick else FRAMES
    return [{"recording": source.label, "without": name, "frames": frames} for source in sources for name in WITHOUT]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Overlaps of silhouettes and of strict hulls, frame by frame of those with a truth.

    Raises
    ------
    InputError
        When the recording has no true silhouettes in these frames.
    """
    recording = inputs.recording(parameters["recording"])
    segmentation, frontend = WITHOUT[parameters["without"]]
    settings = replace(FrontendSettings(threads=1, **frontend), segmentation=SegmentationSettings(**segmentation))
    tables = make_tables(person_grid(recording, VOXEL_M), recording.rig)
    silhouettes, hulls = [], []
    last = min(recording.start + recording.n_frames, recording.start + parameters["frames"])
    for step in stream_masks(recording, settings, last=last, on_problem=lambda line: None):
        truth = true_silhouettes(recording, step.index)
        if truth is None:
            continue
        silhouettes.append([np.nan if mask is None else _overlap(mask, true) for mask, true in zip(step.masks, truth, strict=True)])
        hulls.append(_overlap(carve(tables, step.masks), carve(tables, truth)))
    if not silhouettes:
        raise InputError(f"{recording.path}: has no truth/silhouettes in these frames; this experiment judges silhouettes by them")
    return {"silhouettes": np.array(silhouettes), "hulls": np.array(hulls)}


def _overlap(found: np.ndarray, true: np.ndarray) -> float:
    """Intersection over union; 1 where both are empty."""
    union = np.count_nonzero(found | true)
    return np.count_nonzero(found & true) / union if union else 1.0


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Overlap with all repairs, and what each adds to it, by recording."""
    of = {(one.parameters["recording"], one.parameters["without"]): one.results for one in cells}
    names = list(dict.fromkeys(recording for recording, _ in of))
    repairs = [name for name in WITHOUT if name != ALL]
    rows, added = [], {name: np.zeros(0) for name in repairs}
    for what in ("silhouettes", "hulls"):
        for name in names:
            whole = float(np.nanmean(of[name, ALL][what]))
            gains = {repair: whole - float(np.nanmean(of[name, repair][what])) for repair in repairs}
            rows.append(
                {"of": what, "recording": name.rpartition("@")[0], "overlap": whole}
                | {f"added by {one}": gain for one, gain in gains.items()}
            )
            if what == "silhouettes":
                added = {repair: np.append(added[repair], gains[repair]) for repair in repairs}
    claims = [claim for repair in repairs[:-1] for claim in _claims(repair, added[repair], names)]
    figure = recording_bars(names, added, "added to the silhouettes' overlap")
    figure.axes[0].axvline(0, color="black", linewidth=0.8)
    caption = "Overlap (intersection over union) with the true silhouettes and strict hulls, and what each repair adds to it."
    return Report((Table("repairs", caption, rows),), {"repairs": figure}, tuple(claims))


def _claims(repair: str, added: np.ndarray, names: Sequence[str]) -> list[Claim]:
    worst = int(np.argmin(added))
    helped, harmed = int((added >= LEAST_GAIN).sum()), int((added <= -LEAST_GAIN).sum())
    return [
        Claim(
            f"{repair}: takes no more than {MOST_HARM} of overlap on any recording",
            bool(added[worst] >= -MOST_HARM),
            f"least {added[worst]:+.3f} on {names[worst].rpartition('@')[0]}",
        ),
        Claim(
            f"{repair}: adds {LEAST_GAIN} on {LEAST_CLIPS} recordings at least beyond two for each it takes that from",
            helped - 2 * harmed >= LEAST_CLIPS,
            f"adds on {helped} of {len(names)}, takes on {harmed}",
        ),
    ]


EXPERIMENT = Experiment("repairs", "what each repair of silhouettes is for", "ours", grid, cell, report)
