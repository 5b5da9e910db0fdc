"""The papers' tables and figures, computed again: one module an experiment, `python -m hmc.experiments list | run ID... | status`."""

from hmc.experiments.engine.experiment import Cell, Claim, Experiment, Plan, Report, Source, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.library import EXPERIMENTS, find_experiment
from hmc.experiments.engine.sweep import Outcome, plan_of, run_experiment

__all__ = [
    "EXPERIMENTS", "Cell", "Claim", "Experiment", "Inputs", "Outcome", "Plan", "Report", "Source", "Table", "find_experiment", "plan_of",
    "run_experiment",
]  # fmt: skip
