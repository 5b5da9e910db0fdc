"""The experiments by their ids."""

from __future__ import annotations

import difflib
import importlib
import importlib.util
from pathlib import Path
from types import ModuleType

from hmc.errors import InputError
from hmc.experiments.engine.experiment import Experiment

__all__ = ["EXPERIMENTS", "find_experiment"]

#: Every experiment's id and its module in this package.
EXPERIMENTS = {
    "fig-2.4": "fig_2_4",
    "fig-3.3": "fig_3_3",
    "fig-3.5": "fig_3_5",
    "fig-4.2": "fig_4_2",
    "table-4.2": "table_4_2",
    "fig-4.4": "fig_4_4",
    "fig-4.7": "fig_4_7",
    "fig-4.9": "fig_4_9",
    "table-4.3": "table_4_3",
    "table-4.4": "table_4_4",
    "fig-4.12": "fig_4_12",
    "fig-4.13": "fig_4_13",
    "fig-4.14": "fig_4_14",
    "why-behind": "why_behind",
    "why-lost": "why_lost",
    "why-slow": "why_slow",
    "why-hulls": "why_hulls",
    "fig-5.3": "fig_5_3",
    "fig-5.4": "fig_5_4",
    "fig-5.5": "fig_5_5",
    "fig-5.6": "fig_5_6",
    "fig-5.7": "fig_5_7",
    "fig-6.11": "fig_6_11",
    "fig-6.13": "fig_6_13",
    "table-6.3": "table_6_3",
    "fig-6.16": "fig_6_16",
    "fig-6.17": "fig_6_17",
    "fig-6.18": "fig_6_18",
    "table-6.4": "table_6_4",
    "fig-6.19": "fig_6_19",
    "fig-7.8": "fig_7_8",
    "fig-7.13": "fig_7_13",
    "table-7.1": "table_7_1",
    "fig-7.15": "fig_7_15",
    "table-8.1": "table_8_1",
    "fig-8.1": "fig_8_1",
    "missing-data": "missing_data",
    "repairs": "repairs",
    "body-bias": "body_bias",
    "whole-chain": "whole_chain",
    "ablation": "ablation",
    "cues": "cues",
    "trust": "trust",
    "what-each-adds": "what_each_adds",
    "lost-arm": "lost_arm",
    "over-time": "over_time",
    "all-methods": "all_methods",
    "fig-B.1": "fig_b_1",
    "hsiao-3.8": "hsiao_3_8",
    "hsiao-3.15": "hsiao_3_15",
    "hsiao-3.16": "hsiao_3_16",
    "hsiao-4": "hsiao_4",
    "hsiao-pso": "hsiao_pso",
    "why-hsiao": "why_hsiao",
    "kehl-1": "kehl_1",
    "kehl-4": "kehl_4",
    "kehl-9": "kehl_9",
    "kehl-11": "kehl_11",
    "kehl-13": "kehl_13",
    "kehl-14": "kehl_14",
    "kehl-17": "kehl_17",
}


def find_experiment(name: str) -> Experiment:
    """An experiment by its id, or from a Python file of the user's, which is run.

    Parameters
    ----------
    name : str
        A key of `EXPERIMENTS`, or the path of a file ``*.py`` with an `EXPERIMENT`.

    Raises
    ------
    InputError
        When there is no such experiment; the nearest id is named.
    """
    if name.endswith(".py"):
        module = _module_of(Path(name))
    elif name in EXPERIMENTS:
        module = importlib.import_module(f"hmc.experiments.{EXPERIMENTS[name]}")
    else:
        near = difflib.get_close_matches(name, EXPERIMENTS, 1, cutoff=0.5)
        hint = f"did you mean {near[0]}?" if near else f"they are {', '.join(EXPERIMENTS)}"
        raise InputError(f"there is no experiment {name!r}; {hint}")
    experiment = getattr(module, "EXPERIMENT", None)
    if not isinstance(experiment, Experiment):
        raise InputError(f"{name}: has no EXPERIMENT of the kind hmc.experiments.Experiment")
    return experiment


def _module_of(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"_experiment_{path.stem}", path)
    if not path.is_file() or spec is None or spec.loader is None:
        raise InputError(f"{path}: there is no such file")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
