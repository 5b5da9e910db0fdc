"""Figure 4: color edges against Canny's on grey images, where shadows fall.

Source: Kehl (2006), section 4.2, which shows one image. Here both detectors' thresholds are varied, and clutter is compared at equal
recall: recall is the share of the true outline with an edge within 2 pixels, clutter what lies 4 to 60 pixels from the person and is not
in the empty room at the same threshold: shadows and noise, not the room's own edges. Only the outline is known, so edges within it are not
judged. Takes about 3 minutes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import matplotlib.pyplot as plt
import numpy as np

from hmc.camera.color_edges import ColorEdgeSettings, color_edges
from hmc.errors import InputError
from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.experiments.engine.style import COLORS
from hmc.io.recording import Recording, background_frames, iterate_frames

__all__ = ["EXPERIMENT"]

SETTINGS = ColorEdgeSettings()
THRESHOLDS = {"color": np.geomspace(0.01, 0.4, 14), "grey": np.geomspace(8, 400, 14)}
RECALLS = (0.9, 0.95, 0.99)
NEAR_PX, CLEAR_PX, AROUND_PX = 2, 4, 60
TITLES = {"color": "color edges", "grey": "Canny, grey"}


def grid(plan: Plan) -> list[dict]:
    """One cell a recording."""
    sources = plan.recordings or (rendered("kick_turn"),)
    return [{"recording": source.label, "images": 20 if plan.quick else 40} for source in sources]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Recall and clutter of both detectors at every threshold, over images with true silhouettes.

    Raises
    ------
    InputError
        When the recording has no true silhouettes, or no images of the empty room.
    """
    recording = inputs.recording(parameters["recording"])
    hits = {name: np.zeros(len(values)) for name, values in THRESHOLDS.items()}
    clutter = {name: np.zeros(len(values)) for name, values in THRESHOLDS.items()}
    total, count, example = 0, 0, None
    rooms = {c: _room_edges(recording, c) for c in range(len(recording.rig))}
    for c, image, truth in _images(recording, parameters["images"]):
        outline = truth & ~cv2.erode(truth.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
        away, around = (~cv2.dilate(truth.astype(np.uint8), _disc(px)).astype(bool) for px in (CLEAR_PX, AROUND_PX))
        judged = away & ~around  # where the person's shadow falls
        total += outline.sum()
        count += 1
        for name in THRESHOLDS:
            for k, edges in enumerate(_edges(name, image)):
                near = cv2.dilate(edges.astype(np.uint8), _disc(NEAR_PX)).astype(bool)
                hits[name][k] += (outline & near).sum()
                clutter[name][k] += (edges & judged & ~rooms[c][name][k]).sum()
        if example is None:
            rows, columns = np.nonzero(cv2.dilate(truth.astype(np.uint8), _disc(AROUND_PX // 2)))
            example = {"image": image, "box": [int(rows.min()), int(rows.max()), int(columns.min()), int(columns.max())]}
    if not count:
        raise InputError(f"{recording.path}: has no truth/silhouettes; this experiment judges edges by them")
    recall = {name: value / total for name, value in hits.items()}
    return {"recall": recall, "clutter_px": {name: value / count for name, value in clutter.items()}, "images": count, "example": example}


def _room_edges(recording: Recording, camera: int) -> dict[str, list[np.ndarray]]:
    """Where the empty room has edges at every threshold, and `CLEAR_PX` around."""
    image = next(background_frames(recording, camera, 1), None)
    if image is None:
        raise InputError(f"{recording.path}: has no images of the empty room; this experiment leaves its edges out of account")
    return {name: [cv2.dilate(edges.astype(np.uint8), _disc(CLEAR_PX)) > 0 for edges in _edges(name, image)] for name in THRESHOLDS}


def _images(recording: Recording, most: int):
    """Images with their cameras and true silhouettes."""
    found = 0
    for frame in iterate_frames(recording):
        for c, (camera, image) in enumerate(zip(recording.rig, frame.images, strict=True)):
            path = recording.path / "truth" / "silhouettes" / camera.name / f"{frame.index:06d}.png"
            if image is None or found >= most or not path.is_file():
                continue
            picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
            if picture is None:
                continue
            truth = picture > 0
            if np.count_nonzero(truth) > 500:
                found += 1
                yield c, image, truth
        if found >= most:
            return


def _edges(name: str, image: np.ndarray) -> list[np.ndarray]:
    """One detector's edges at every threshold."""
    if name == "color":
        strength = color_edges(image, replace(SETTINGS, threshold=float(THRESHOLDS[name][0]))).strength
        return [strength >= threshold for threshold in THRESHOLDS[name]]
    grey = cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), (0, 0), SETTINGS.sigma_px)
    return [cv2.Canny(grey, 0.4 * threshold, threshold) > 0 for threshold in THRESHOLDS[name]]


def _disc(radius: int) -> np.ndarray:
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """Clutter over recall, at equal recall, and one image."""
    one = cells[0].results
    figure, panels = plt.subplots(1, 4, figsize=(12, 3.6), width_ratios=(1.6, 1, 1, 1))
    rows, at = [], {}
    for name, color in (("color", COLORS["sparse"]), ("grey", COLORS["naive"])):
        recall, clutter = np.array(one["recall"][name], float), np.array(one["clutter_px"][name], float)
        panels[0].plot(recall, clutter, "o-", color=color, label=TITLES[name])
        order = np.argsort(recall)
        at[name] = [float(np.interp(want, recall[order], clutter[order], right=np.nan)) for want in RECALLS]
        thresholds = [float(np.interp(want, recall[order], THRESHOLDS[name][order])) for want in RECALLS]
        rows += [
            {"edges": TITLES[name], "recall": want, "clutter_px_an_image": value, "threshold": threshold, "images": one["images"]}
            for want, value, threshold in zip(RECALLS, at[name], thresholds, strict=True)
        ]
    panels[0].set(xlabel="recall of the outline", ylabel="clutter around the person, pixels an image", xlim=(0.85, 1.0))
    panels[0].set_yscale("symlog", linthresh=1)
    panels[0].set_ylim(bottom=-0.1)
    panels[0].legend()
    image, (top, bottom, left, right) = np.array(one["example"]["image"], np.uint8), one["example"]["box"]
    drawn = [("image", image[..., ::-1])]
    for name in THRESHOLDS:
        wanted = next(row["threshold"] for row in rows if row["edges"] == TITLES[name] and row["recall"] == RECALLS[-1])
        nearest = int(np.abs(np.log(THRESHOLDS[name] / wanted)).argmin())
        drawn.append((f"{TITLES[name]}, recall {RECALLS[-1]}", np.repeat(255 * ~_edges(name, image)[nearest][..., None], 3, axis=2)))
    for panel, (title, picture) in zip(panels[1:], drawn, strict=True):
        panel.imshow(picture[top:bottom, left:right].astype(np.uint8))
        panel.set(xticks=[], yticks=[], title=title)
        panel.grid(False)
    pairs = list(zip(RECALLS, at["color"], at["grey"], strict=True))
    detail = ", ".join(f"{color:.1f} and {grey:.1f} pixels at recall {want}" for want, color, grey in pairs)
    claims = (Claim("color edges leave less clutter at equal recall", all(color < grey for _, color, grey in pairs), detail),)
    caption = "Edges around a person: clutter at equal recall of the outline. The paper shows one image: Kehl, Figure 4."
    return Report((Table("kehl-4", caption, rows),), {"kehl-4": figure}, claims)


EXPERIMENT = Experiment("kehl-4", "color edges against grey ones", "Kehl, Figure 4", grid, cell, report)
