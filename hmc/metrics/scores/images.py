"""Scores of poses in images: the landmarks' positions in pixels, camera by camera (Canton 2009, section 5.3.1: the metrics in R^2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from hmc.camera.model import Rig, project
from hmc.errors import InputError
from hmc.io.results import PoseTable
from hmc.io.tables import integer_column, read_columns
from hmc.landmarks import LANDMARKS
from hmc.metrics.landmarks import landmark_errors
from hmc.metrics.persons import match_persons
from hmc.metrics.scores.poses import known_thresholds, score_rows

__all__ = ["THRESHOLDS_PX", "ImageEvaluation", "ImageTable", "evaluate_images", "image_landmarks", "read_image_landmarks"]

#: Largest errors at which a landmark counts as matched, pixels.
THRESHOLDS_PX = (10.0, 5.0)
#: An estimate farther off than this share of an image's width, on the mean over landmarks, does not stand for a person.
GATE_SHARE = 0.3
COLUMNS = ("frame", "camera", "person", "joint", "u", "v")


@dataclass(frozen=True)
class ImageTable:
    """Landmarks in images, one row a frame, camera and person.

    Parameters
    ----------
    frames, persons : ndarray of int, shape (n,)
    cameras : ndarray of int, shape (n,)
        Places in the rig.
    positions : ndarray, shape (n, 15, 2)
        Pixels as the images have them (with the lens's distortion); NaN where missing.
    """

    frames: np.ndarray
    cameras: np.ndarray
    persons: np.ndarray
    positions: np.ndarray

    def where(self, chosen: np.ndarray) -> ImageTable:
        """The chosen rows: a mask, shape (n,), or row numbers."""
        return ImageTable(self.frames[chosen], self.cameras[chosen], self.persons[chosen], self.positions[chosen])


@dataclass(frozen=True)
class ImageEvaluation:
    """Scores in images.

    Attributes
    ----------
    groups : mapping of str to (estimate, truth)
        By camera, pixels, shape (n, 15, 2) each: a row a true person and frame; NaN where missing.
    rows : tuple of dict
        The table, a row a landmark and ``overall``, for all cameras and for each.
    summary : dict
        The overall scores.
    thresholds_px : tuple of float
        Of MMTP and MMTA, pixels.
    """

    groups: Mapping[str, tuple[np.ndarray, np.ndarray]]
    rows: tuple[dict, ...]
    summary: dict
    thresholds_px: tuple[float, ...]


def read_image_landmarks(path: str | Path, cameras: Sequence[str]) -> ImageTable:
    """Read a table `frame, camera, person, joint, u, v`, one row a landmark that was marked in an image by hand.

    Parameters
    ----------
    path : path
    cameras : sequence of str
        Names of all cameras, in the rig's order.

    Returns
    -------
    ImageTable
        Sorted by frame, camera and person; a landmark without a row is missing (NaN).

    Raises
    ------
    InputError
        When the file or a column is missing, a value is no number, a camera or landmark is unknown, or a landmark is given twice.
    """
    path = Path(path)
    columns, lines = read_columns(path, COLUMNS)
    frames, persons = (integer_column(path, name, columns[name], lines) for name in ("frame", "person"))
    where = _places(path, "camera", columns["camera"], lines, cameras)
    joints = _places(path, "landmark", columns["joint"], lines, LANDMARKS)
    try:
        uv = np.array([columns["u"], columns["v"]], float).T.reshape(-1, 2)
    except ValueError as error:
        raise InputError(f"{path}: `u` and `v` must be numbers of pixels ({error}); leave out what was not marked") from None
    keys, rows = np.unique(np.stack([frames, where, persons], axis=1), axis=0, return_inverse=True)
    cells = rows.ravel() * len(LANDMARKS) + joints
    _, first = np.unique(cells, return_index=True)
    if len(first) < len(cells):
        row = int(np.setdiff1d(np.arange(len(cells)), first)[0])
        raise InputError(f"{path}, line {lines[row]}: this frame, camera, person and joint stand there twice")
    positions = np.full((len(keys) * len(LANDMARKS), 2), np.nan)
    positions[cells] = uv
    return ImageTable(keys[:, 0], keys[:, 1], keys[:, 2], positions.reshape(len(keys), len(LANDMARKS), 2))


def image_landmarks(poses: PoseTable, rig: Rig, inside: bool = False) -> ImageTable:
    """The landmarks of poses in all images of a rig, whether hidden or not.

    Parameters
    ----------
    poses : PoseTable
    rig : Rig
    inside : bool
        Leave out what lies outside the image; what is behind a camera is missing in any case.
    """
    uv, valid = project(rig, poses.positions)
    if inside:
        sizes = np.array([camera.size for camera in rig])[:, None, None]
        valid &= ((uv > -0.5) & (uv < sizes - 0.5)).all(axis=-1)
    uv = np.where(valid[..., None], uv, np.nan).reshape(-1, len(LANDMARKS), 2)
    n = len(rig)
    return ImageTable(np.tile(poses.frames, n), np.repeat(np.arange(n), len(poses.frames)), np.tile(poses.persons, n), uv)


def evaluate_images(
    estimate: ImageTable, truth: ImageTable, rig: Rig, thresholds_px: Sequence[float | Literal["auto"]] = THRESHOLDS_PX
) -> ImageEvaluation:
    """Score landmarks in images against true ones, persons matched once over all frames and cameras.

    Parameters
    ----------
    estimate, truth : ImageTable
    rig : Rig
    thresholds_px : sequence of float or "auto"
        Thresholds of MMTP and MMTA, pixels; ``"auto"`` for those that the errors suggest.

    Raises
    ------
    InputError
        When the truth is empty, or a threshold cannot be chosen.
    """
    if not np.isfinite(truth.positions).any():
        raise InputError("the truth has no landmark in these images; nothing can be scored")
    own, true = (table.frames * len(rig) + table.cameras for table in (estimate, truth))
    gate = GATE_SHARE * max(camera.size[0] for camera in rig)
    names = match_persons(true, truth.persons, truth.positions, own, estimate.persons, estimate.positions, gate)
    found = np.full(truth.positions.shape, np.nan)
    rows = {(int(image), int(person)): row for row, (image, person) in enumerate(zip(true, truth.persons, strict=True))}
    for k in np.flatnonzero(np.isin(estimate.persons, list(names))):
        row = rows.get((int(own[k]), names[int(estimate.persons[k])]))
        if row is not None:
            found[row] = estimate.positions[k]
    groups = {}
    for place, name in enumerate(rig.names):
        chosen = truth.cameras == place
        if chosen.any():
            groups[name] = found[chosen], truth.positions[chosen]
    errors = {"all": landmark_errors(found, truth.positions)} | {name: landmark_errors(*both) for name, both in groups.items()}
    thresholds, chosen_px = known_thresholds(errors["all"], thresholds_px, "px")
    table = tuple({"camera": name} | row for name, own in errors.items() for row in score_rows(own, thresholds, "px"))
    summary = {key: value for key, value in table[len(LANDMARKS)].items() if key not in ("camera", "landmark")} | chosen_px
    return ImageEvaluation(groups, table, summary, thresholds)


def _places(path: Path, what: str, cells: Sequence[str], lines: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """Where names stand among the known ones, (n,)."""
    known = {name: place for place, name in enumerate(names)}
    for cell, line in zip(cells, lines, strict=True):
        if cell.strip() not in known:
            raise InputError(f"{path}, line {line}: no {what} named {cell!r}; they are {', '.join(names)}")
    return np.array([known[cell.strip()] for cell in cells], int)
