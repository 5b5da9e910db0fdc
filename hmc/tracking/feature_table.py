"""Features and classes of all blobs of a recording with truth: what a person classifier learns from.

Source: Canton (2009), section 4.2.3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from hmc.errors import InputError
from hmc.io.recording import Recording
from hmc.io.results import TrackTable, read_centroids
from hmc.tracking.blobs import observe
from hmc.tracking.features import FEATURES, assign_components, feature_matrix
from hmc.tracking.resumable import person_grid
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import FrontendSettings, HullStep, stream_hulls

__all__ = ["FeatureTable", "feature_table", "join_tables", "table_of_hulls"]


@dataclass(frozen=True)
class FeatureTable:
    """Components of many frames, one row each.

    Attributes
    ----------
    frames : ndarray of int, shape (n,)
        Absolute frame numbers.
    features : ndarray, shape (n, 6)
        Columns as in `FEATURES`.
    persons : ndarray of int, shape (n,)
        True positions that were assigned to the component: 0 for no person, 2 where two people form one component.
    recordings : ndarray of int, shape (n,)
        Which of the recordings a row is from.
    positions, unassigned : int
        True positions, and those that got no component.
    """

    frames: np.ndarray
    features: np.ndarray
    persons: np.ndarray
    recordings: np.ndarray
    positions: int
    unassigned: int

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def is_person(self) -> np.ndarray:
        """The class of each component, shape (n,) bool."""
        return self.persons > 0


def feature_table(
    recording: Recording,
    voxel_size_m: float = 0.05,
    frontend: FrontendSettings | None = None,
    *,
    hulls: Sequence[str] = ("tolerant",),
    every: int = 1,
    on_problem: Callable[[str], None] | None = None,
) -> FeatureTable:
    """Features and classes of all components of a recording with truth.

    Parameters
    ----------
    recording : Recording
        With ``truth/centroids.csv``.
    voxel_size_m : float
    frontend : FrontendSettings, optional
    hulls : sequence of {"tolerant", "strict"}
        What the components are of. The trackers see the tolerant hull, and take apart the strict one where people stand close.
    every : int
        Take every so manieth frame.
    on_problem : callable, optional
        Called with one line for everything that was survived.

    Returns
    -------
    FeatureTable

    Raises
    ------
    InputError
        When the recording has no truth, or an argument is not one of the above.
    """
    if every < 1:
        raise InputError(f"`every` must be a whole number, 1 or more; got {every}")
    path = recording.path / "truth" / "centroids.csv"
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; blobs can be told to be people only in a recording with truth")
    truth = read_centroids(path)
    grid = person_grid(recording, voxel_size_m)
    steps = stream_hulls(recording, grid, frontend, on_problem=on_problem)
    return table_of_hulls((step for step in steps if (step.index - recording.start) % every == 0), grid, truth, hulls)


def table_of_hulls(steps: Iterable[HullStep], grid: VoxelGrid, truth: TrackTable, hulls: Sequence[str] = ("tolerant",)) -> FeatureTable:
    """As `feature_table`, of hulls that are at hand.

    Parameters
    ----------
    steps : iterable of HullStep
        Frames that are not usable are passed over.
    grid : VoxelGrid
        Of the hulls.
    truth : TrackTable
        True centroids.
    hulls : sequence of {"tolerant", "strict"}

    Returns
    -------
    FeatureTable

    Raises
    ------
    InputError
        When `hulls` names something else.
    """
    if not hulls or not set(hulls) <= {"tolerant", "strict"}:
        raise InputError(f"`hulls` must name 'tolerant', 'strict' or both; got {hulls!r}")
    frames, features, persons = [np.zeros(0, int)], [np.zeros((0, len(FEATURES)))], [np.zeros(0, int)]
    positions = unassigned = 0
    for step in steps:
        if not step.usable:
            continue
        people = truth.positions[truth.frames == step.index]
        for hull in hulls:
            observation = observe(grid, getattr(step, hull))
            assigned = assign_components(observation, people)
            frames.append(np.full(len(observation.blobs), step.index))
            features.append(feature_matrix(observation.blobs))
            persons.append(np.bincount(assigned[assigned >= 0], minlength=len(observation.blobs)))
            positions += len(assigned)
            unassigned += int(np.count_nonzero(assigned < 0))
    found = np.concatenate(frames)
    return FeatureTable(found, np.concatenate(features), np.concatenate(persons), np.zeros(len(found), int), positions, unassigned)


def join_tables(tables: Sequence[FeatureTable]) -> FeatureTable:
    """Tables of several recordings as one; their recordings are numbered on.

    Raises
    ------
    InputError
        When there is none.
    """
    if not tables:
        raise InputError("no table of features to join; give one recording with truth at least")
    offsets = np.cumsum([0, *(int(table.recordings.max(initial=0)) + 1 for table in tables)])
    return FeatureTable(
        np.concatenate([table.frames for table in tables]),
        np.concatenate([table.features for table in tables]),
        np.concatenate([table.persons for table in tables]),
        np.concatenate([table.recordings + offset for table, offset in zip(tables, offsets, strict=False)]),
        sum(table.positions for table in tables),
        sum(table.unassigned for table in tables),
    )
