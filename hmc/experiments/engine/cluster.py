"""Cells over many machines, by Dask: a scheduler hands them to its workers, and what a dead worker had is handed to another.

Workers need no folder in common with each other nor with the one who asks: a cell's results travel back as text, and the one who asks
stores them. What cells share (rendered recordings, hulls) each machine makes for itself; with a common file system it is made once for all.
Files that the user names, recordings and experiments of their own, must lie at the same place everywhere.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hmc.errors import InputError
from hmc.experiments.engine.store import write_text

__all__ = ["CONNECT_S", "spread"]

#: How long a scheduler may take to answer, seconds.
CONNECT_S = 20.0
Compute = Callable[[dict[str, Any]], tuple[Path, str, str]]


def spread(compute: Compute, missing: Sequence[Mapping[str, Any]], scheduler: str) -> Iterator[str]:
    """Have cells computed by the workers of a Dask scheduler, and store them here as they come.

    Parameters
    ----------
    compute : callable
        ``compute(parameters)`` on a worker: where the cell goes, its text, or what went wrong (then the text is empty).
    missing : sequence of mapping
        Parameters of the cells.
    scheduler : str
        Its address, as ``tcp://10.0.0.1:8786``.

    Yields
    ------
    str
        Empty for a stored cell, or what went wrong; in any order.

    Raises
    ------
    InputError
        When Dask is not installed, the scheduler does not answer, or a cell raised it.
    """
    try:
        from distributed import Client, as_completed
        from distributed.scheduler import KilledWorker
    except ImportError as error:
        raise InputError("--scheduler needs Dask: pip install 'dask[distributed]'") from error
    try:
        with warnings.catch_warnings():
            # Dask warns of other versions of packages on the workers, among them those that no cell uses.
            warnings.simplefilter("ignore")
            client = Client(scheduler, timeout=CONNECT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f"--scheduler {scheduler}: no Dask scheduler answers there; start one with `dask scheduler`") from error
    with client:
        # Not pure: `--again` computes anew what the scheduler may still know.
        futures = client.map(compute, [dict(parameters) for parameters in missing], pure=False)
        cell_of = {future.key: parameters for future, parameters in zip(futures, missing, strict=True)}
        for future in as_completed(futures, loop=client.loop):
            try:
                path, text, failure = future.result()
            except KilledWorker as error:
                yield f"{cell_of[future.key]}\nevery worker that began this cell died: {error}"
                continue
            if text:
                write_text(path, text)
            yield failure
            future.release()
