"""What trust in each landmark rests on, as a table beside the poses: who wonders why a landmark is doubtful finds it there."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from hmc.io.files import atomic_write
from hmc.io.results import PoseTable

__all__ = ["EVIDENCE", "write_evidence"]

#: Numbers of the table after `views`, and their digits; the last, the same for all landmarks of a pose, is what the method minimised.
EVIDENCE = {"shown": 4, "denied": 4, "bare_m": 4, "passes_apart_m": 4, "cost_m2": 8}


def write_evidence(path: str | Path, poses: PoseTable, evidence: Mapping[str, np.ndarray]) -> None:
    """Write a row for each landmark of each pose, sorted by frame, then person.

    Parameters
    ----------
    path : str or Path
    poses : PoseTable
        With views.
    evidence : mapping of str to ndarray, shape (n, 15)
        By the names of `EVIDENCE`; an empty cell where it is NaN.
    """
    columns = [(evidence[name], digits) for name, digits in EVIDENCE.items()]
    with atomic_write(path) as file:
        file.write(",".join(("frame", "person", "joint", "views", *EVIDENCE)) + "\n")
        for row in np.lexsort([poses.persons, poses.frames]):
            if poses.views is None or not np.isfinite(poses.positions[row]).any():
                continue
            cells = [[f"{value:.{digits}f}" if np.isfinite(value) else "" for value in values[row]] for values, digits in columns]
            file.writelines(
                f"{poses.frames[row]},{poses.persons[row]},{name},{views:.0f},{','.join(own)}\n"
                for name, views, *own in zip(poses.names, poses.views[row], *cells, strict=True)
            )
