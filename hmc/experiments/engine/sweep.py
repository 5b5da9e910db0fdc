"""Computing the cells of experiments: what is stored is not computed again, and many processes share the rest.

joblib spreads the work over one machine: it comes with scikit-learn, so it is one dependency less than any other pool that survives a dead
worker. Its workers store each cell themselves, as soon as it is done; nothing is lost with the parent. Dask spreads it over many machines
(`hmc.experiments.engine.cluster`). Neither the number of workers nor the order in which cells are computed changes a result, because random
numbers follow from a cell's own parameters.
"""

from __future__ import annotations

import contextlib
import functools
import os
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hmc.errors import InputError
from hmc.experiments.engine.cluster import spread
from hmc.experiments.engine.experiment import Cell, Experiment, Plan, Report, Source
from hmc.experiments.engine.inputs import Inputs, rendered, source_of
from hmc.experiments.engine.library import find_experiment
from hmc.experiments.engine.selection import grid_of
from hmc.experiments.engine.store import cell_key, cell_path, cell_rng, cell_text, read_cell, write_text
from hmc.io.files import real_path
from hmc.io.provenance import code_state, machine
from hmc.plugins import add_plugins, plugin_files
from hmc.processes import end_with

__all__ = ["Outcome", "compute_cells", "plan_for", "plan_of", "report_on", "run_experiment", "stored_cells"]

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Outcome:
    """What became of an experiment.

    Attributes
    ----------
    report : Report or None
        None where cells failed.
    computed, found : int
        Cells computed in this run, and cells that were there.
    failures : tuple of str
        One text for every cell that raised: its parameters and the error.
    """

    report: Report | None
    computed: int
    found: int
    failures: tuple[str, ...] = ()


def plan_of(quick: bool = False, recordings: list[Path] | None = None) -> Plan:
    """A plan, with the user's recordings checked; a name that is no folder's may be a shipped recipe's, which is rendered.

    Raises
    ------
    InputError
        When a folder is no recording.
    """
    return Plan(quick, tuple(map(_source, recordings or [])))


def _source(given: Path) -> Source:
    if not given.exists() and len(given.parts) == 1:
        with contextlib.suppress(InputError):  # neither: the message is that of a folder
            return rendered(str(given))
    return source_of(given)


def plan_for(experiment: Experiment, plan: Plan) -> Plan:
    """The plan, without the user's recordings where the experiment is computed on none and they would change nothing."""
    bare = replace(plan, recordings=())
    return bare if plan.recordings and grid_of(experiment, bare) == grid_of(experiment, plan) else plan


def run_experiment(
    name: str,
    out: Path,
    plan: Plan | None = None,
    workers: int = 1,
    again: bool = False,
    on_progress: Progress | None = None,
    scheduler: str | None = None,
) -> Outcome:
    """Compute what is missing of an experiment's cells, and report on all.

    Parameters
    ----------
    name : str
        As for `find_experiment`.
    out : path
        Folder of cells, inputs and reports.
    plan : Plan, optional
    workers : int
        Processes.
    again : bool
        Compute stored cells anew.
    on_progress : callable, optional
        ``on_progress(done, total)``, once at the start and once a cell.
    scheduler : str, optional
        Address of a Dask scheduler whose workers compute, in place of processes of this machine.

    Returns
    -------
    Outcome

    Raises
    ------
    InputError
        When there is no such experiment, a recording is not what the experiment needs, or nothing can be written.
    """
    experiment, plan = find_experiment(name), plan or Plan()
    grid = grid_of(experiment, plan)
    missing = grid if again else [p for p, cell in zip(grid, stored_cells(experiment, out, grid), strict=True) if cell is None]
    failures = []
    done = len(grid) - len(missing)
    if on_progress:
        on_progress(done, len(grid))
    folders = {source.label: source.folder for source in plan.recordings if source.folder is not None}
    for failure in compute_cells(name, out, missing, folders, workers, scheduler):
        done += 1
        if failure:
            failures.append(failure)
        if on_progress:
            on_progress(done, len(grid))
    found = len(grid) - len(missing)
    if failures:
        return Outcome(None, len(missing) - len(failures), found, tuple(failures))
    cells = [cell for cell in stored_cells(experiment, out, grid) if cell is not None]
    if len(cells) < len(grid):
        raise InputError(f"{out}: cells vanished while the experiment ran; start it again")
    return Outcome(report_on(experiment, cells, plan), len(missing), found)


def report_on(experiment: Experiment, cells: Sequence[Cell], plan: Plan) -> Report:
    """An experiment's report on the cells of a plan.

    Raises
    ------
    InputError
        When cells are left out by the plan without which there is no report.
    """
    try:
        return experiment.report(cells, plan)
    except Exception as error:  # what a report needs of the other cells shows in any way
        if isinstance(error, InputError) or not plan.changed:
            raise
        raise InputError(
            f"{experiment.id}: the cells are computed and kept, but its report needs what was left out ({type(error).__name__} {error})"
        ) from error


def stored_cells(experiment: Experiment, out: Path, grid: list[dict[str, Any]]) -> list[Cell | None]:
    """The stored cells of a grid, in its order; None for one that is not computed yet."""
    return [read_cell(cell_path(out, experiment, cell_key(experiment, parameters))) for parameters in grid]


def compute_cells(
    name: str, out: Path, missing: list[dict[str, Any]], folders: Mapping[str, Path], workers: int = 1, scheduler: str | None = None
) -> Iterator[str]:
    """Compute and store cells, in any order; yields an empty string for each, or what went wrong. Arguments as `run_experiment`.

    Raises
    ------
    InputError
        What a cell raised that concerns the user: the rest would meet the same.
    """
    if scheduler is not None:
        name = os.path.realpath(name) if name.endswith(".py") else name  # workers have folders of their own
        yield from spread(
            functools.partial(_compute_cell, name, _Shared(real_path(out), dict(folders), plugin_files())), missing, scheduler
        )
        return
    task = functools.partial(_compute_and_store, name, _Shared(out, dict(folders), plugin_files()))
    if workers <= 1 or len(missing) <= 1:
        yield from map(task, missing)
        return
    task = functools.partial(_work, os.getpid(), task)
    from joblib import Parallel, delayed

    yield from Parallel(n_jobs=workers, batch_size=1, pre_dispatch="2*n_jobs", return_as="generator_unordered")(
        delayed(task)(parameters) for parameters in missing
    )


def _work(parent: int, task: Callable[[dict[str, Any]], str], parameters: dict[str, Any]) -> str:
    """A task in a worker."""
    end_with(parent)
    return task(parameters)


@dataclass(frozen=True)
class _Shared:
    """What is the same for all cells of a run: its folder, the user's recordings, and the files of strangers' methods."""

    out: Path
    folders: dict[str, Path]
    plugins: tuple[str, ...]


def _compute_and_store(name: str, shared: _Shared, parameters: dict[str, Any]) -> str:
    path, text, failure = _compute_cell(name, shared, parameters)
    if text:
        write_text(path, text)
    return failure


def _compute_cell(name: str, shared: _Shared, parameters: dict[str, Any]) -> tuple[Path, str, str]:
    """A cell's file, its text, and what went wrong; the last two exclude each other."""
    import cv2
    from threadpoolctl import threadpool_limits

    # One thread each: the processes share the cores, and sums do not depend on how threads divide them.
    cv2.setNumThreads(1)
    add_plugins(shared.plugins)  # a worker may be older than they are, or on another machine
    experiment = find_experiment(name)
    key = cell_key(experiment, parameters)
    path = cell_path(shared.out, experiment, key)
    try:
        begun = time.perf_counter()
        with threadpool_limits(1):
            results = experiment.cell(parameters, Inputs(shared.out / "inputs", shared.folders), cell_rng(key))
        made = code_state() | {"machine": machine(), "seconds": round(time.perf_counter() - begun, 1)}
        return path, cell_text(parameters, results, made), ""
    except InputError:
        raise
    except Exception:
        # One cell that fails must not cost a night's sweep: it is told at the end and is missing until the next run.
        return path, "", f"{experiment.id} {parameters}\n{traceback.format_exc()}"
