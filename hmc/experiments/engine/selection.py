"""Grids as the user asks for them: other seeds, frames, cameras and actions than an experiment has by itself."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from hmc.errors import InputError
from hmc.experiments.engine.experiment import Experiment, Plan
from hmc.experiments.engine.store import digest

__all__ = ["REPEAT", "changed_plan", "grid_of", "read_settings"]

#: The parameter that numbers the seeds of a cell.
REPEAT = "repeat"


def read_settings(pairs: Iterable[str]) -> tuple[tuple[str, Any], ...]:
    """Parameters and values from texts such as ``layers=6``, ``annealing=strong``, ``gone_s=[2.0, 3.5]``; values are TOML, or plain words.

    Raises
    ------
    InputError
        When a text is no pair.
    """
    found = []
    for pair in pairs:
        name, equal, text = pair.partition("=")
        if not (name.strip() and equal and text.strip()):
            raise InputError(f"{pair}: write a parameter and its value, as layers=6")
        try:
            value = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            value = text.strip()
        found.append((name.strip(), value))
    return tuple(found)


def changed_plan(
    plan: Plan,
    seeds: int | None = None,
    actions: Sequence[str] = (),
    settings: Iterable[tuple[str, Any] | None] = (),
    kept: Iterable[tuple[str, Any]] = (),
) -> Plan:
    """A plan with other seeds, actions and parameters, or fewer cells; what is None is left as the experiment has it."""
    others = tuple(pair for pair in settings if pair is not None)
    return replace(plan, seeds=seeds, actions=tuple(actions), settings=others, kept=tuple(kept))


def grid_of(experiment: Experiment, plan: Plan) -> list[dict[str, Any]]:
    """The grid of an experiment under a plan; no two cells are equal.

    Parameters
    ----------
    experiment : Experiment
    plan : Plan

    Raises
    ------
    InputError
        When the experiment has no such parameter or value, no cell with such an action, or no seeds.
    """
    grid = experiment.grid(plan)
    if plan.actions:
        grid = _of_actions(experiment, grid, plan.actions)
    for name, values in plan.kept:
        grid = _of_values(experiment, grid, name, values if isinstance(values, list) else [values])
    for name, value in plan.settings:
        _values_of(experiment, grid, name)
        grid = _once(cell | {name: value} if name in cell else cell for cell in grid)
    if plan.seeds is not None:
        if not any(REPEAT in cell for cell in grid):
            raise InputError(f"{experiment.id} draws nothing at random from seed to seed; leave --seeds out")
        grid = _with_seeds(grid, plan.seeds)
    return grid


def _with_seeds(grid: list[dict[str, Any]], n: int) -> list[dict[str, Any]]:
    """So many seeds of every cell that draws: the first that the grid has of it, which need not be 0, and then others."""
    seeds: dict[str, list[int]] = {}
    for cell in grid:
        if REPEAT in cell:
            seeds.setdefault(digest(cell | {REPEAT: 0}), []).append(cell[REPEAT])
    for own in seeds.values():
        own += [seed for seed in range(len(own) + n) if seed not in own]
    return _once(
        one
        for cell in grid
        for one in ([cell | {REPEAT: seed} for seed in seeds[digest(cell | {REPEAT: 0})][:n]] if REPEAT in cell else [cell])
    )


def _values_of(experiment: Experiment, grid: list[dict[str, Any]], name: str) -> list[Any]:
    """The values that cells have of a parameter, which some must have."""
    values = [cell[name] for cell in grid if name in cell]
    if not values:
        raise InputError(
            f"{experiment.id} has no parameter {name!r}; its cells have {', '.join(dict.fromkeys(k for c in grid for k in c))}"
        )
    return values


def _of_values(experiment: Experiment, grid: list[dict[str, Any]], name: str, values: list[Any]) -> list[dict[str, Any]]:
    """The cells that have one of the values, each of which there must be; those without the parameter stay."""
    own = _values_of(experiment, grid, name)
    for value in values:
        if value not in own:
            raise InputError(f"{experiment.id} has no cell with {name} = {value!r}; there are {', '.join(dict.fromkeys(map(str, own)))}")
    return [cell for cell in grid if name not in cell or cell[name] in values]


def _of_actions(experiment: Experiment, grid: list[dict[str, Any]], actions: Sequence[str]) -> list[dict[str, Any]]:
    """The cells on recordings that are called by one of the actions, alone or with more after an underscore."""
    names = {cell["recording"]: cell["recording"].rpartition("@")[0] for cell in grid if "recording" in cell}
    if not names:
        raise InputError(f"{experiment.id} is computed on no recording; leave --actions out")
    for action in actions:
        if not any(f"{name}_".startswith(f"{action}_") for name in names.values()):
            raise InputError(
                f"{experiment.id} has no recording of the action {action!r}; there are {', '.join(dict.fromkeys(names.values()))}"
            )
    kept = {label for label, name in names.items() if any(f"{name}_".startswith(f"{action}_") for action in actions)}
    return [cell for cell in grid if cell.get("recording") in kept]


def _once(cells: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Cells in their order, each once: those that would have one name are one."""
    found: list[dict[str, Any]] = []
    seen = set()
    for cell in cells:
        key = digest(cell)
        if key not in seen:
            seen.add(key)
            found.append(cell)
    return found
