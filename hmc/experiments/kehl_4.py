"""Figure 4: color edges against Canny's on grey images, where shadows fall.

Source: Kehl (2006), section 4.2, which shows one image. Here both detectors' thresholds are varied, and clutter is compared at equal
recall: recall is the share of the true outline with an edge within 2 pixels, clutter what lies 4 to 60 pixels from the person and is not
in the empty room at the same threshold: shadows and noise, not the room's own edges. Only the outline is known, so edges within it are not
judged. Clips by three people.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import matplotlib.pyplot as plt
import numpy as np

from hmc.camera.color_edges import ColorEdgeSettings, color_edges
from hmc.errors import InputError
from hmc.experiments.drill_clips import clip_names
from hmc.experiments.engine.experiment import Cell, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs, rendered
from hmc.experiments.engine.intervals import decide, difference, interval
from hmc.experiments.engine.style import COLORS
from hmc.io.recording import Recording, background_frames, iterate_frames

__all__ = ["EXPERIMENT"]

SETTINGS = ColorEdgeSettings()
THRESHOLDS = {"color": np.geomspace(0.01, 0.4, 14), "grey": np.geomspace(8, 400, 14)}
RECALLS = (0.9, 0.95, 0.99)
NEAR_PX, CLEAR_PX, AROUND_PX = 2, 4, 60
#: Of the rig.
CAMERAS = 5
TITLES = {"color": "color edges", "grey": "Canny, grey"}


def grid(plan: Plan) -> list[dict]:
    """One cell a clip and camera; quick: one clip."""
    sources = plan.recordings or tuple(rendered(name) for name in clip_names("kick_turn")[: 1 if plan.quick else None])
    return [{"recording": source.label, "camera": c, "images": 4 if plan.quick else 8} for source in sources for c in range(CAMERAS)]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Hits on the outline and clutter of both detectors at every threshold, over one camera's images with true silhouettes.

    Raises
    ------
    InputError
        When the recording has no true silhouettes, or no images of the empty room.
    """
    recording = inputs.recording(parameters["recording"])
    hits = {name: np.zeros(len(values)) for name, values in THRESHOLDS.items()}
    clutter = {name: np.zeros(len(values)) for name, values in THRESHOLDS.items()}
    total, count, example = 0, 0, None
    room = _room_edges(recording, parameters["camera"])
    for image, truth in _images(recording, parameters["camera"], parameters["images"]):
        outline = truth & ~cv2.erode(truth.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
        away, around = (~cv2.dilate(truth.astype(np.uint8), _disc(px)).astype(bool) for px in (CLEAR_PX, AROUND_PX))
        judged = away & ~around  # where the person's shadow falls
        total += outline.sum()
        count += 1
        for name in THRESHOLDS:
            for k, edges in enumerate(_edges(name, image)):
                near = cv2.dilate(edges.astype(np.uint8), _disc(NEAR_PX)).astype(bool)
                hits[name][k] += (outline & near).sum()
                clutter[name][k] += (edges & judged & ~room[name][k]).sum()
        if example is None:
            rows, columns = np.nonzero(cv2.dilate(truth.astype(np.uint8), _disc(AROUND_PX // 2)))
            example = {"image": image, "box": [int(rows.min()), int(rows.max()), int(columns.min()), int(columns.max())]}
    if not count:
        raise InputError(f"{recording.path}: has no truth/silhouettes; this experiment judges edges by them")
    return {"hits": hits, "outline_px": int(total), "clutter_px": clutter, "images": count, "example": example}


def _room_edges(recording: Recording, camera: int) -> dict[str, list[np.ndarray]]:
    """Where the empty room has edges at every threshold, and `CLEAR_PX` around."""
    image = next(background_frames(recording, camera, 1), None)
    if image is None:
        raise InputError(f"{recording.path}: has no images of the empty room; this experiment leaves its edges out of account")
    return {name: [cv2.dilate(edges.astype(np.uint8), _disc(CLEAR_PX)) > 0 for edges in _edges(name, image)] for name in THRESHOLDS}


def _images(recording: Recording, camera: int, most: int):
    """Images of a camera with their true silhouettes."""
    found, folder = 0, recording.path / "truth" / "silhouettes" / recording.rig[camera].name
    for frame in iterate_frames(recording):
        image, path = frame.images[camera], folder / f"{frame.index:06d}.png"
        picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) if image is not None and path.is_file() else None
        if picture is not None and np.count_nonzero(picture) > 500:
            found += 1
            yield image, picture > 0
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
    figure, panels = plt.subplots(1, 4, figsize=(12, 3.6), width_ratios=(1.6, 1, 1, 1))
    clips = [str(one.parameters["recording"]) for one in cells]
    images = np.array([float(one.results["images"]) for one in cells])
    outline = sum(one.results["outline_px"] for one in cells)
    rows, at, strictest = [], {}, {}
    for name, color in (("color", COLORS["sparse"]), ("grey", COLORS["naive"])):
        hits, clutter = (np.array([one.results[what][name] for one in cells], float) for what in ("hits", "clutter_px"))
        recall = hits.sum(axis=0) / outline
        panels[0].plot(recall, clutter.sum(axis=0) / images.sum(), "o-", color=color, label=TITLES[name])
        order = np.argsort(recall)
        for want in RECALLS:
            # One threshold for all cells, by the recall of all: where it is not reached there is nothing to compare.
            threshold = float(np.interp(want, recall[order], THRESHOLDS[name][order], right=np.nan))
            sums = np.array([np.interp(threshold, THRESHOLDS[name], one) for one in clutter])
            at[name, want] = sums, images
            strictest[name] = threshold  # recalls rise
            found = interval(clips, sums, images)
            rows.append({
                "edges": TITLES[name], "recall": want, "clutter_px_an_image": found.value, "low": found.low, "high": found.high,
                "threshold": threshold, "images": int(images.sum()),
            })  # fmt: skip
    panels[0].set(xlabel="recall of the outline", ylabel="clutter around the person, pixels an image", xlim=(0.85, 1.0))
    panels[0].set_yscale("symlog", linthresh=1)
    panels[0].set_ylim(bottom=-0.1)
    panels[0].legend()
    _draw(panels[1:], cells[0].results["example"], strictest)
    gains = {want: difference(clips, at["grey", want], at["color", want]) for want in RECALLS}
    detail = ", ".join(f"{gain} pixels less at recall {want}" for want, gain in gains.items())
    claims = (decide("color edges leave less clutter at equal recall", list(gains.values()), detail),)
    caption = "Edges around a person: clutter at equal recall of the outline. The paper shows one image: Kehl, Figure 4."
    return Report((Table("kehl-4", caption, rows),), {"kehl-4": figure}, claims)


def _draw(panels, example: dict | None, thresholds: dict[str, float]) -> None:
    """An image, and both detectors' edges at the highest recall."""
    if example is None:
        return
    image, (top, bottom, left, right) = np.array(example["image"], np.uint8), example["box"]
    drawn = [("image", image[..., ::-1])]
    for name, title in TITLES.items():
        if np.isfinite(thresholds[name]):
            nearest = int(np.abs(np.log(THRESHOLDS[name] / thresholds[name])).argmin())
            drawn.append((f"{title}, recall {RECALLS[-1]}", np.repeat(255 * ~_edges(name, image)[nearest][..., None], 3, axis=2)))
    for panel, (title, picture) in zip(panels, drawn, strict=False):
        panel.imshow(picture[top:bottom, left:right].astype(np.uint8))
        panel.set(xticks=[], yticks=[], title=title)
        panel.grid(False)


EXPERIMENT = Experiment("kehl-4", "color edges against grey ones", "Kehl, Figure 4", grid, cell, report, version=2)
