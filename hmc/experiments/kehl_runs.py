"""One person followed by multi-cue descent through a rendered recording: what the experiments of Kehl (2006), section 7, share.

The recordings are rendered after the paper's descriptions, for its own are not public (`hmc.experiments.drill_clips`): five cameras (four
in corners, one overhead), 15 frames a second, 640 x 480 pixels, as many frames as the paper has; each begins in the pose of da Vinci's
man. Only the tracker is timed: hulls and colors are made before.
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
from hmc.experiments.engine.experiment import Cell, Claim, Parameters, Plan, Results
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.experiments.engine.intervals import Interval, decide
from hmc.experiments.engine.ratios import Parts, ratio_gain, ratio_interval
from hmc.experiments.engine.selection import REPEAT
from hmc.experiments.engine.style import COLORS
from hmc.experiments.truth import estimates, first_truth, stature_m
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

__all__ = [
    "FAMILY", "FOLLOWED_MM", "QUARTER", "REPEATS", "TOLERANCES", "VARIANTS", "VERSION", "VOXEL_M",
    "cell", "cell_grid", "error_interval", "errors_mm", "following", "joint_gain",
    "lm_name", "nearer", "observations", "of_variant", "preset_of", "seconds_gain", "shown",
]  # fmt: skip

FAMILY, VERSION = "kehl", 2
#: Runs of every clip and variant.
REPEATS = 3
#: Who is nearer than this on the mean over joints and frames, with the interval's upper end, is followed and not lost, millimetres.
FOLLOWED_MM = 100.0
VOXEL_M = 0.03
#: How long the person is watched before the body is fitted, seconds.
WINDOW_S = 1.5
_SURFACE: dict = {"edge_weight": 0.0, "colors": None}
#: The descent along the parameters themselves, with the settings found best for that.
ALONG_PARAMETERS = SmdSettings(first_step=0.5, meta_step=3e-4, iterations=25, by_curvature=False, averaged=False)


def lm_name(times: int, tolerance: float) -> str:
    """What Levenberg-Marquardt with so many times the points and this tolerance is called."""
    return f"LM{f', {times} times the points' if times > 1 else ''}, stop at {tolerance:g}"


#: Relative changes at which Levenberg-Marquardt stops: which of them is the best is found on a clip apart (`kehl_13`).
TOLERANCES = (1e-2, 1e-3, 1e-4)
_NOTHING: dict = {}
_PRINTED: dict = {"name": "kehl2006"}
#: Within the range of tolerances of section 6.2, .1 to 2, but not section 7's: tells what stopping early costs.
QUARTER = "SMD, as printed, a quarter of the tolerance"
#: Variants by name: what differs from the preset, in the cues and elsewhere. "As printed" is `kehl2006`, the others `default`.
VARIANTS: dict[str, tuple[dict, dict]] = {
    "SMD": ({}, {}),
    "SMD, as printed": ({}, _PRINTED),
    QUARTER: ({}, _PRINTED | {"tolerance_m": 0.005, "tolerance_deg": 0.5}),
    "deterministic": ({}, {"optimiser": "deterministic"}),
    "deterministic, as printed": ({}, _PRINTED | {"optimiser": "deterministic"}),
    "SMD along the parameters": ({}, {"descent": ALONG_PARAMETERS, "tolerance_m": 0.005, "tolerance_deg": 0.5}),
    "surface": (_SURFACE, {}),
    "surface, edges": ({"colors": None}, {}),
    "surface, color": ({"edge_weight": 0.0}, {}),
    "surface, as printed": (_SURFACE, _PRINTED),
    "surface, edges, as printed": ({"colors": None}, _PRINTED),
} | {
    f"{lm_name(times, tolerance)}{ending}": ({}, more | {"optimiser": "lm", "times": times, "levenberg": LmSettings(tolerance=tolerance)})
    for ending, more in zip(("", ", as printed"), (_NOTHING, _PRINTED), strict=True)
    for times in (1, 5)
    for tolerance in TOLERANCES
}  # fmt: skip


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


def cell_grid(plan: Plan, clips: Sequence[str], variants: Sequence[str], shown_s: Sequence[float] = ()) -> list[dict]:
    """Every variant, several times, on the user's recordings or on some clips; in the quick mode on the first clip, 45 frames of it."""
    sources = plan.recordings or tuple(rendered(name) for name in clips[: 1 if plan.quick else None])
    return [
        {
            "recording": source.label, "variant": variant, REPEAT: k, "shown_s": list(shown_s) if k == 0 else [],
            "frames": 45 if plan.quick else 0,
        }
        for source in sources
        for k in range(REPEATS)
        for variant in variants
    ]  # fmt: skip


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
    wanted = {round(second * recording.fps) for second in parameters["shown_s"]}
    window = max(3, round(WINDOW_S * recording.fps))
    waiting, stream = [], observations(recording, parameters["frames"])
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
    return 1000 * landmark_errors(*estimates(one))


def of_variant(cells: Sequence[Cell], variant: str) -> list[Cell]:
    """The cells of a variant, by clip and run."""
    own = [one for one in cells if one.parameters["variant"] == variant]
    return sorted(own, key=lambda one: (str(one.parameters["recording"]), int(one.parameters[REPEAT])))


def error_interval(cells: Sequence[Cell], joints: Sequence[int] = (), last: float = 1.0) -> Interval:
    """Mean joint error of some cells over clips and runs, millimetres.

    Parameters
    ----------
    cells : sequence of Cell
    joints : sequence of int
        Of `LANDMARKS`; all where empty.
    last : float
        Of each run the last so large a share of the frames.
    """
    return ratio_interval(cells, _errors(joints, last))


def joint_gain(better: Sequence[Cell], worse: Sequence[Cell], joints: Sequence[int] = ()) -> Interval:
    """By how many millimetres the first group is nearer than the second, on the same clips and runs."""
    return ratio_gain(worse, better, _errors(joints))


def nearer(text: str, better: Sequence[Cell], worse: Sequence[Cell], joints: Sequence[int]) -> Claim:
    """The claim that people are followed in the first group, and that it is nearer in some joints than the second."""
    gain = joint_gain(better, worse, joints)
    detail = f"{error_interval(better, joints)} mm for {error_interval(worse, joints)}: nearer by {gain}"
    return decide(text, (gain, following(better)), detail)


def seconds_gain(faster: Sequence[Cell], slower: Sequence[Cell]) -> Interval:
    """By how many milliseconds a frame the first group is quicker than the second."""
    return ratio_gain(slower, faster, _milliseconds)


def following(cells: Sequence[Cell], last: float = 1.0) -> Interval:
    """By how much the error is below `FOLLOWED_MM`: people are followed where all of it is. Nothing is claimed of who is lost."""
    return error_interval(cells, last=last).under(FOLLOWED_MM)


def _errors(joints: Sequence[int] = (), last: float = 1.0) -> Parts:
    """Sum of a run's errors and how many."""

    def parts(one: Cell) -> tuple[float, float]:
        errors = errors_mm(one)
        errors = errors[-max(1, round(last * len(errors))) :, list(joints) or slice(None)]
        return float(errors.sum()), float(errors.size)

    return parts


def _milliseconds(one: Cell) -> tuple[float, float]:
    seconds = np.asarray(one.results["seconds"], float)
    return 1000 * float(seconds.sum()), float(seconds.size)


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
