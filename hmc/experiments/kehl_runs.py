"""One person followed by multi-cue descent through a rendered recording: what the experiments of Kehl (2006), section 7, share.

The recordings are rendered after the paper's descriptions, for its own are not public: five cameras (four in corners, one overhead), 15
frames a second, 640 x 480 pixels; each begins in the pose of da Vinci's man. Only the tracker is timed: hulls and colors are made before.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from hmc.body.kinematics import landmarks
from hmc.camera.model import project
from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell, Parameters, Results, Source
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.experiments.engine.style import COLORS
from hmc.experiments.truth import first_truth, stature_m
from hmc.io.recording import Recording
from hmc.landmarks import BONES, LANDMARKS
from hmc.metrics.landmarks import landmark_errors
from hmc.pose.methods.smd import SMD_PRESETS
from hmc.pose.starts.da_vinci import find_da_vinci
from hmc.pose.starts.settle import FirstPose, begin
from hmc.pose.steps.descent.levenberg import LmSettings
from hmc.pose.steps.descent.tracker import SmdPreset, track_step
from hmc.pose.views.hull_target import HullTarget, make_target
from hmc.pose.views.rays import with_rays
from hmc.pose.views.skin import Skin, observe_voxels
from hmc.search.meta_descent import SmdSettings
from hmc.tracking.resumable import person_grid
from hmc.voxels.hulls import FrontendSettings, stream_hulls

__all__ = ["FAMILY", "VARIANTS", "VERSION", "cell", "cell_grid", "errors_mm", "observations", "preset_of", "shown"]

FAMILY = "kehl"
#: Of the cells; 2: hulls say nothing below the floor.
VERSION = 2
VOXEL_M = 0.03
#: How long the person is watched before the body is fitted, seconds.
WINDOW_S = 1.5
_SURFACE = {"edge_weight": 0.0, "colors": None}
#: The descent along the parameters themselves, with the settings found best for that.
ALONG_PARAMETERS = SmdSettings(first_step=0.5, meta_step=3e-4, iterations=25, by_curvature=False, averaged=False)
#: Variants by name: what differs from the default preset, in the cues and elsewhere.
VARIANTS: dict[str, tuple[dict, dict]] = {
    "SMD": ({}, {}),
    "SMD, as printed": ({}, {"name": "kehl2006"}),
    "deterministic": ({}, {"optimiser": "deterministic"}),
    "LM": ({}, {"optimiser": "lm"}),
    "LM, 5 times the points": ({}, {"optimiser": "lm", "times": 5}),
    "LM that stops early": ({}, {"optimiser": "lm", "levenberg": LmSettings(tolerance=1e-2)}),
    "SMD along the parameters": ({}, {"descent": ALONG_PARAMETERS, "tolerance_m": 0.005, "tolerance_deg": 0.5}),
    "surface": (_SURFACE, {}),
    "surface, edges": ({"colors": None}, {}),
    "surface, color": ({"edge_weight": 0.0}, {}),
}


def preset_of(variant: str) -> SmdPreset:
    """The preset of a variant.

    Parameters
    ----------
    variant : str
        A key of `VARIANTS`.
    """
    cues, more = VARIANTS[variant]
    more = dict(more)
    preset = SMD_PRESETS[more.pop("name", "default")]
    return replace(preset, cues=replace(preset.cues, **cues), **more)


def cell_grid(
    quick: bool, recordings: Sequence[Source], name: str, variants: Sequence[str], repeats: int, shown_s: Sequence[float] = ()
) -> list[dict]:
    """Every variant, several times, on the user's recordings or on a rendered one; in the quick mode once."""
    sources = tuple(recordings) or (rendered(name),)
    return [
        {"recording": source.label, "variant": variant, "repeat": k, "shown_s": list(shown_s)}
        for source in sources
        for k in range(1 if quick else repeats)
        for variant in variants
    ]


def observations(recording: Recording, frames: int = 0) -> Iterator[tuple[int, Skin | None, HullTarget | None]]:
    """What is seen of the one person of a recording, frame by frame, in the forms that the tracker and the fit of the body take.

    Parameters
    ----------
    recording : Recording
    frames : int
        So many of the first; 0: all.
    """
    grid = person_grid(recording, VOXEL_M)
    last = recording.start + frames if frames else None
    for hull in stream_hulls(recording, grid, FrontendSettings(threads=1), last=last, on_problem=lambda line: None):
        voxels = np.argwhere(hull.strict)
        if not len(voxels):
            yield hull.index, None, None
            continue
        target = make_target(grid, voxels, np.argwhere(hull.tolerant), hull.loose & ~hull.tolerant, float(recording.room[0, 2]))
        target = None if target is None else with_rays(target, recording.rig, hull.masks)
        yield hull.index, observe_voxels(grid, recording.rig, hull.strict, voxels, hull.images, hull.masks), target


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Follow the person; landmarks, metres, and processor seconds of every frame, and some frames as pictures.

    Raises
    ------
    InputError
        When the recording does not begin in the pose of da Vinci's man.
    """
    recording = inputs.recording(parameters["recording"])
    truth = first_truth(recording)
    height = stature_m(recording)
    preset = preset_of(parameters["variant"])
    wanted = {round(second * recording.fps) for second in parameters["shown_s"]} if parameters["repeat"] == 0 else set()
    window = max(3, round(WINDOW_S * recording.fps))
    waiting, stream = [], observations(recording)
    for index, seen, target in stream:
        waiting.append((index, seen, target))
        if len(waiting) == window:
            break
    first = None if waiting[0][1] is None else find_da_vinci(waiting[0][1].points, VOXEL_M, float(recording.room[0, 2]), height)
    if first is None:
        raise InputError(f"{recording.path}: does not begin in the pose of da Vinci's man, arms and legs spread")
    # Body and first pose are the same for all variants, so that only the descent is compared.
    start = FirstPose(0, first.body, first.state)
    begun, state = begin(
        np.random.default_rng(0), preset_of("SMD"), start, [row[1] for row in waiting], [row[2] for row in waiting], height is not None
    )
    tracker = replace(begun, preset=preset)
    frames, estimates, seconds, iterations, pictures = [], [], [], [], []
    for index, seen, _ in chain(waiting, stream):
        before = time.process_time()
        state, info = track_step(rng, tracker, state, seen)
        seconds.append(time.process_time() - before)
        frames.append(index)
        iterations.append(info.iterations)
        estimates.append(landmarks(tracker.body.skeleton, state.state))
        if index - recording.start in wanted:
            pictures.append(_picture(recording, seen, estimates[-1], index))
    rows = np.searchsorted(truth.frames, frames)
    return {
        "frames": frames, "fps": recording.fps, "estimate_m": np.array(estimates), "truth_m": truth.positions[rows], "seconds": seconds,
        "iterations": np.array(iterations), "pictures": pictures,
    }  # fmt: skip


def _picture(recording: Recording, seen: Skin | None, points: np.ndarray, index: int) -> dict:
    """The largest crop of a frame, and where the landmarks fall in it."""
    crops = [] if seen is None else [(k, crop) for k, crop in enumerate(seen.crops) if crop is not None]
    if not crops:
        return {"frame": index, "image": [], "uv": []}
    camera, crop = max(crops, key=lambda pair: pair[1].image.size)
    uv = project(recording.rig[camera], points)[0] - np.array([crop.left, crop.top])
    return {"frame": index, "image": crop.image, "uv": uv}


def errors_mm(one: Cell) -> np.ndarray:
    """Errors of a cell, (n, 15), millimetres."""
    estimate, truth = (np.array(one.results[name], float).reshape(-1, len(LANDMARKS), 3) for name in ("estimate_m", "truth_m"))
    return 1000 * landmark_errors(estimate, truth)


def shown(axes, picture: dict, title: str) -> None:
    """Draw a picture of a cell: the image with the bones over it."""
    image, uv = np.array(picture["image"], np.uint8), np.array(picture["uv"], float)
    axes.set(xticks=[], yticks=[], title=title)
    axes.grid(False)
    if image.ndim != 3:
        return
    axes.imshow(image[..., ::-1])
    for start, end in BONES:
        side = {"l_": COLORS["sparse"], "r_": COLORS["particle"]}.get(end[:2], COLORS["person"])
        axes.plot(*uv[[LANDMARKS.index(start), LANDMARKS.index(end)]].T, color=side)
    axes.set(xlim=(0, image.shape[1]), ylim=(image.shape[0], 0))
