"""One table for all persons, as CSV or Parquet: a row a person and frame, units in the columns' names, empty where there is nothing."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from hmc.errors import InputError
from hmc.io.files import atomic_write, sibling

__all__ = ["write_csv", "write_parquet"]


def write_csv(path: str | Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns of one length as CSV: six decimals, an empty cell for NaN.

    Parameters
    ----------
    path : path
    columns : mapping
        Name to ndarray, shape (n,); whole numbers or floats.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    with atomic_write(path) as file:
        file.write(",".join(columns) + "\n")
        for row in zip(*(column.tolist() for column in columns.values()), strict=True):
            file.write(",".join("" if cell != cell else f"{cell:.6f}" if isinstance(cell, float) else str(cell) for cell in row) + "\n")


def write_parquet(path: str | Path, columns: Mapping[str, np.ndarray], about: Mapping[str, str]) -> None:
    """Write columns of one length as Parquet, NaN as null, through pyarrow.

    Parameters
    ----------
    path : path
    columns : mapping
        As for `write_csv`.
    about : mapping
        Kept in the file: units, axes.

    Raises
    ------
    InputError
        When pyarrow is not installed, or the file cannot be written.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise InputError("Parquet needs pyarrow, which is in the extra `biomech`; install it with that, or write CSV") from None
    table = pa.table({name: pa.array(column, from_pandas=True) for name, column in columns.items()})
    with sibling(path) as temporary:
        pq.write_table(table.replace_schema_metadata(dict(about)), str(temporary))
