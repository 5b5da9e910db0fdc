"""Features of the components of hulls, with their classes, of which figure 4.2 and table 4.2 of Canton (2009) are made."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hmc.experiments.engine.experiment import Plan, Source
from hmc.experiments.engine.inputs import Inputs, once, rendered
from hmc.experiments.person_data import training_recipes
from hmc.io.door import kept_arrays
from hmc.io.results import read_centroids
from hmc.tracking.feature_table import FeatureTable, table_of_hulls
from hmc.tracking.resumable import person_grid

__all__ = ["features_of", "test_sources", "training_sources"]

_TEST_QUICK, _TEST = ("meeting_short", "train_brought_in"), ("meeting", "hug", "alike", "meeting_pass", "crossing", "meeting_moved")
_TRAIN_QUICK = ("train_seats", "train_moved_tables", "train_close")


def training_sources(plan: Plan) -> tuple[Source, ...]:
    """What classifiers learn from: the recordings on which the package's own tree was trained, or three of them."""
    return tuple(rendered(name) for name in (_TRAIN_QUICK if plan.quick else [recipe.name for recipe, _ in training_recipes()]))


def test_sources(plan: Plan) -> tuple[Source, ...]:
    """What they are tested on: other people, furniture and rigs; or the user's recordings."""
    return plan.recordings or tuple(rendered(name) for name in (_TEST_QUICK if plan.quick else _TEST))


def features_of(inputs: Inputs, label: str, voxel_m: float, hulls: tuple[str, ...] = ("tolerant",)) -> FeatureTable:
    """The components of a recording, computed once."""
    path = once(
        inputs.folder / label / f"features-{'-'.join(hulls)}-{1000 * voxel_m:g}mm.npz",
        lambda part: _write(part, inputs, label, voxel_m, hulls),
    )
    with kept_arrays(path) as data:
        return FeatureTable(data["frames"], data["features"], data["persons"], data["recordings"], *map(int, data["counts"]))


def _write(path: Path, inputs: Inputs, label: str, voxel_m: float, hulls: tuple[str, ...]) -> None:
    grid = person_grid(inputs.recording(label), voxel_m)
    table = table_of_hulls(inputs.hulls(label, voxel_m), grid, read_centroids(inputs.truth(label)), hulls)
    columns = {name: getattr(table, name) for name in ("frames", "features", "persons", "recordings")}
    with open(path, "wb") as file:
        np.savez_compressed(file, **columns, counts=np.array([table.positions, table.unassigned]))
