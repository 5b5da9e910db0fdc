"""How far the body model alone pulls poses off: refined from the true pose on the true silhouettes, with variants of its flesh. Ours.

Nothing is segmented, searched or tracked: a body of the person's true joint lengths takes the true pose by inverse kinematics, and is then
refined as the preset `default` refines. What moves a landmark away from its true place is that our flesh is not the person's; before that,
what keeps the start off it is that our joints are not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hmc.body.inverse import fit_landmarks
from hmc.body.joints import default_limits
from hmc.body.kinematics import landmarks
from hmc.body.model import BodyModel
from hmc.body.proportions import DEFAULT_LENGTHS, SOLE, default_body, make_body, stature
from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.experiments.engine.intervals import decide, difference
from hmc.experiments.markerless_runs import FRONTEND, VOXEL_M, opened
from hmc.experiments.study import recording_bars
from hmc.experiments.truth import all_truth, standing_state
from hmc.io.masks import MaskStep
from hmc.io.recording import Recording
from hmc.io.results import TrackTable
from hmc.io.true_silhouettes import true_silhouettes
from hmc.landmarks import LANDMARKS, landmark_index
from hmc.pose.method import Capture, make_subject
from hmc.pose.steps.polish import fine_objective
from hmc.pose.steps.presets import PRESETS
from hmc.pose.steps.refine import refine
from hmc.pose.views.person_view import views_of
from hmc.tracking.resumable import person_grid
from hmc.voxels.hulls import stream_hulls

__all__ = ["AS_IT_IS", "EXPERIMENT", "FLAT", "MIDDLE", "NEITHER", "STIFF", "VARIANTS", "true_lengths"]

CLIPS = ("crossing", "close_white", "jog", "pale", "dance", "close_queue", "throw_catch", "gesture")
QUICK_CLIPS, QUICK_FRAMES = 3, 61
#: The sole's axis at which the flesh of feet ends at the floor, over stature.
FLOOR_SOLE = 0.024
AS_IT_IS, NEITHER, MIDDLE, STIFF, FLAT = "as it is", "neither", "joints in the middle", "a stiff trunk", "stiff ankles"
_HAIR, _MIDDLE = ("hair",), tuple(name for name in DEFAULT_LENGTHS if "_flesh_" in name)
#: Which of the body's lengths are 0, where the soles of its flesh are, and which joints are held.
VARIANTS: dict[str, tuple[tuple[str, ...], float, tuple[str, ...]]] = {
    AS_IT_IS: ((), SOLE, ()),
    "no hair": (_HAIR, SOLE, ()),
    "feet to the floor": ((), FLOOR_SOLE, ()),
    NEITHER: (_HAIR, FLOOR_SOLE, ()),
    MIDDLE: (_MIDDLE, SOLE, ()),
    STIFF: (("lumbar", "collar"), SOLE, ()),
    FLAT: ((), SOLE, ("r_ankle", "l_ankle")),
}
#: A pose that our joints cannot take tells of them and not of the flesh: one that starts farther off is left out, metres.
MOST_START_M = 0.06
#: Hair and soles are to help on so many of the recordings, and what is left may lift or lower bodies by so much.
LEAST_HELPED, MOST_UP_MM = 0.75, 10.0
#: The bones of limbs, and the landmarks between which they lie.
_BONES_OF = {
    "arms": {"upper_arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist")},
    "legs": {"thigh": ("hip", "knee"), "shank": ("knee", "ankle")},
}
_POLISH = PRESETS["default"].polish


def grid(plan: Plan) -> list[dict]:
    """A cell a recording and variant; of no cameras and frames are all."""
    sources = plan.recordings or tuple(rendered(name) for name in CLIPS[: QUICK_CLIPS if plan.quick else None])
    chosen = {"cameras": 0, "frames": QUICK_FRAMES if plan.quick else 0}
    return [{"recording": source.label, "body": body} | chosen for source in sources for body in VARIANTS]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """From where landmarks should be to where they are, (n, 15, 3), metres in the world: at the start, and refined.

    Raises
    ------
    InputError
        When the recording has no true joints, or nobody in these frames whose silhouettes are true and whose pose the body can take.
    """
    recording = opened(inputs, parameters["recording"], parameters["cameras"])
    truth, voxels = all_truth(recording), person_grid(recording, VOXEL_M)
    truth = truth.where(np.isfinite(truth.positions[:, landmark_index("pelvis")]).all(axis=1))
    capture = Capture(recording.fps, VOXEL_M, recording.room, recording.rig)
    people = {
        person: make_subject(_body(truth.of(person).positions, *VARIANTS[parameters["body"]]), capture)
        for person in np.unique(truth.persons).tolist()
    }
    before, after = [], []
    for hull in stream_hulls(recording, voxels, FRONTEND, masks=_true_masks(recording, parameters["frames"])):
        own = truth.where(truth.frames == hull.index)
        views = views_of(recording, voxels, TrackTable(own.frames, own.persons, own.positions[:, landmark_index("pelvis")]), hull)
        for person, points in zip(own.persons.tolist(), own.positions, strict=True):
            subject, target = people[person], views[person].target
            start, _ = fit_landmarks(subject.body, points, standing_state(subject.body, points))
            off = landmarks(subject.body, start) - points
            if target is None or np.nanmean(np.linalg.norm(off, axis=1)) > MOST_START_M:
                continue
            # The same rays and points of the hull for all variants, which the cell's own generator would draw anew.
            drawn = np.random.default_rng([person, hull.index])
            end, _ = refine(fine_objective(drawn, subject, views[person], _POLISH), start, _POLISH.refine)
            before.append(off)
            after.append(landmarks(subject.body, end) - points)
    if not after:
        raise InputError(f"{recording.path}: has nobody with truth/silhouettes in these frames whose true pose the body can take")
    return {"start_off_m": np.array(before), "off_m": np.array(after)}


def _true_masks(recording: Recording, frames: int) -> Iterator[MaskStep]:
    nothing = (None,) * len(recording.rig)
    for frame in range(recording.start, recording.start + min(frames or recording.n_frames, recording.n_frames)):
        masks = true_silhouettes(recording, frame)
        if masks is not None:
            yield MaskStep(frame, nothing, masks, nothing)


def true_lengths(points: np.ndarray) -> dict[str, float]:
    """The dimensions of a body that a person's landmarks show, metres, and its asymmetries.

    Parameters
    ----------
    points : ndarray, shape (n, 15, 3)
        World, metres; medians over the frames are taken.
    """

    def apart(one: str, other: str) -> float:
        return float(np.nanmedian(np.linalg.norm(points[:, landmark_index(one)] - points[:, landmark_index(other)], axis=1)))

    head = DEFAULT_LENGTHS["head"]
    lengths = {
        "trunk": apart("pelvis", "neck"),
        # The crown is before the line of neck and head, along which the head is measured.
        "head": apart("neck", "head_top") * head / float(np.hypot(head, DEFAULT_LENGTHS["head_forward"])),
        "shoulder_half_width": apart("l_shoulder", "r_shoulder") / 2,
        "hip_half_width": apart("l_hip", "r_hip") / 2,
    }
    for kind, bones in _BONES_OF.items():
        sides = np.array([[apart(f"{side}_{one}", f"{side}_{other}") for one, other in bones.values()] for side in "lr"])
        lengths |= dict(zip(bones, sides.mean(axis=0).tolist(), strict=True))
        left, right = sides.sum(axis=1).tolist()
        lengths[f"{kind}_longer_left"] = 2 * (left - right) / (left + right)
    return lengths


def _body(points: np.ndarray, without: tuple[str, ...], sole: float, held: tuple[str, ...]) -> BodyModel:
    """The body of the joint lengths that a person's landmarks (n, 15, 3) have; what they do not tell is as usual for the stature."""
    lengths = true_lengths(points)
    dimensions = default_body(stature(DEFAULT_LENGTHS | lengths)).dimensions | lengths
    return make_body(dimensions | dict.fromkeys(without, 0.0), default_limits(held), sole)


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """How far landmarks are pulled off, and how far up, by recording and variant."""
    rows, off = [], {}
    for one in cells:
        name, body = one.parameters["recording"].rpartition("@")[0], one.parameters["body"]
        start, end = (1000 * np.array(one.results[key], float).reshape(-1, len(LANDMARKS), 3) for key in ("start_off_m", "off_m"))
        off[one.parameters["recording"], body] = end
        rows.append(
            {
                "recording": name,
                "body": body,
                "poses": len(end),
                "start_mm": _mean(start),
                "mean_mm": _mean(end),
                "up_mm": _up(end, LANDMARKS),
                "ankles_up_mm": _up(end, ("l_ankle", "r_ankle")),
                "crown_up_mm": _up(end, ("head_top",)),
            }
        )
    labels = list(dict.fromkeys(label for label, _ in off))
    caption = (
        "Mean distance of landmarks from their true places at the start, by inverse kinematics, and refined on the true silhouettes; "
        "the median upward shift of the refined ones, of all, of ankles and of the crown."
    )
    means = {body: np.array([_mean(off[label, body]) for label in labels]) for body in VARIANTS}
    figure = recording_bars(labels, means, "landmarks from their true places, mean, mm")
    up = np.array([_up(off[label, AS_IT_IS], LANDMARKS) for label in labels])
    return Report((Table("body-bias", caption, rows),), {"body-bias": figure}, _claims(labels, means, up))


def _claims(labels: Sequence[str], means: dict[str, np.ndarray], up: np.ndarray) -> tuple[Claim, ...]:
    worst = int(np.argmax(np.abs(up)))
    return (
        _nearer("hair and soles together bring", labels, means, NEITHER),
        _nearer("joints beside the middle of their flesh bring", labels, means, MIDDLE),
        _nearer("a spine that bends and shoulder girdles bring", labels, means, STIFF),
        _nearer("ankles that bend bring", labels, means, FLAT),
        Claim(
            f"with hair and soles bodies are lifted or lowered by less than {MOST_UP_MM:g} mm on each recording",
            bool(abs(up[worst]) < MOST_UP_MM),
            f"most on {labels[worst].rpartition('@')[0]}, {up[worst]:+.1f} mm",
        ),
    )


def _nearer(what: str, labels: Sequence[str], means: dict[str, np.ndarray], without: str) -> Claim:
    n, one_each = len(labels), np.ones(len(labels))
    helped = int((means[AS_IT_IS] < means[without]).sum())
    nearer = difference(labels, (means[without], one_each), (means[AS_IT_IS], one_each))
    return decide(
        f"{what} landmarks nearer: on {LEAST_HELPED:.0%} of the recordings or more, and on their mean",
        nearer,
        f"on {helped} of {n}; on the mean by {nearer} mm",
        helped >= LEAST_HELPED * n,
    )


def _mean(off: np.ndarray) -> float:
    return float(np.nanmean(np.linalg.norm(off, axis=2)))


def _up(off: np.ndarray, names: Sequence[str]) -> float:
    return float(np.nanmedian(off[:, [landmark_index(name) for name in names], 2]))


EXPERIMENT = Experiment("body-bias", "how far the body alone pulls poses off", "ours", grid, cell, report)
