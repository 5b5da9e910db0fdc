"""Table 4.2: seven person / no-person classifiers, on the same features and the same split.

Source: Canton (2009), section 4.2.3. Trained and tested on rendered recordings with other people, furniture and rigs; the thesis used the
development and the evaluation part of CLEAR 2007.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from hmc.experiments.engine.experiment import Cell, Experiment, Parameters, Plan, Report, Results, Table
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.intervals import Interval, decide, difference
from hmc.experiments.person_features import features_of, test_sources, training_sources
from hmc.tracking.classifiers import CLASSIFIERS, detection_scores, fit_classifier, frame_groups
from hmc.tracking.feature_table import FeatureTable, join_tables

__all__ = ["EXPERIMENT"]

#: Precision, recall and F-measure, by the names of `hmc.tracking.classifiers.CLASSIFIERS`.
PAPER = {
    "gaussian": (0.0179, 0.9011, 0.0351),
    "neural-network": (0.0179, 0.9013, 0.0351),
    "k-means": (0.2429, 0.8992, 0.3825),
    "pca": (0.2884, 0.9090, 0.4379),
    "parzen": (0.9568, 0.8137, 0.8795),
    "mixture-12": (0.9267, 0.8697, 0.8973),
    "decision-tree": (0.9844, 0.9920, 0.9882),
}
VOXEL_M = 0.05
HULLS = ("tolerant", "strict")


#: Runs of those that draw random numbers: a neural network's F scatters by .002, more than lies between the best two.
RUNS, RUNS_QUICK = 8, 2
DRAWING = ("neural-network", "k-means", "mixture-12", "decision-tree")


def grid(plan: Plan) -> list[dict]:
    """One cell a classifier and run."""
    train, test = ([source.label for source in some(plan)] for some in (training_sources, test_sources))
    runs = RUNS_QUICK if plan.quick else RUNS
    return [
        {"classifier": name, "run": run, "train": train, "test": test, "voxel_m": VOXEL_M}
        for name in CLASSIFIERS
        for run in range(runs if name in DRAWING else 1)
    ]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Train on some recordings and score on others."""
    train, test = (_table(inputs, parameters[part], parameters["voxel_m"]) for part in ("train", "test"))
    groups = frame_groups(train.frames, train.recordings)
    verdict = fit_classifier(parameters["classifier"], train.features, train.is_person, groups, rng)
    said = verdict(test.features)
    scores = detection_scores(test.is_person, said)
    counts = {f"{part}_{label}": int((table.is_person == wanted).sum())
              for part, table in (("train", train), ("test", test)) for label, wanted in (("people", True), ("others", False))}  # fmt: skip
    return asdict(scores) | counts | {"by_recording": _counts(test, said)}


def _counts(table: FeatureTable, verdict: np.ndarray) -> list[list[int]]:
    """Of every recording twice the people found, and that plus what was missed and what was taken for one: F is their ratio."""
    found = []
    for recording in np.unique(table.recordings):
        own = table.recordings == recording
        true, said = table.is_person[own], np.asarray(verdict, bool)[own]
        found.append([int(2 * (true & said).sum()), int(true.sum() + said.sum())])
    return found


def _table(inputs: Inputs, labels: Sequence[str], voxel_m: float) -> FeatureTable:
    return join_tables([features_of(inputs, label, voxel_m, HULLS) for label in labels])


def report(cells: Sequence[Cell], plan: Plan) -> Report:
    """The table with the paper's figures."""
    rows = []
    for name in dict.fromkeys(one.parameters["classifier"] for one in cells):
        runs = [one.results for one in cells if one.parameters["classifier"] == name]
        row: dict = {"method": name}
        for column, key, paper in zip(("precision", "recall", "F"), ("precision", "recall", "f_measure"), PAPER[name], strict=True):
            row |= {column: float(np.mean([run[key] for run in runs])), f"{column}_paper": paper}
        rows.append(row | {"runs": len(runs), "F_deviation": float(np.std([run["f_measure"] for run in runs]))})
    order = sorted(rows, key=lambda row: -np.nan_to_num(row["F"]))
    tree = next(row for row in rows if row["method"] == "decision-tree")
    others = [row["method"] for row in order if row["method"] != "decision-tree"]
    gains = {name: _gain("decision-tree", name, cells) for name in others}
    claim = decide(
        "the decision tree has the best F",
        list(gains.values()),
        f"F {tree['F']:.3f}; ahead of " + ", ".join(f"{name} by {100 * gain.value:.1f} [{100 * gain.low:.1f}, {100 * gain.high:.1f}] %"
                                                    for name, gain in gains.items()),
    )  # fmt: skip
    counts = cells[0].results
    caption = (
        f"Person classifiers trained on {counts['train_people']} components with people and {counts['train_others']} without, tested on "
        f"{counts['test_people']} and {counts['test_others']} of other recordings; means of several "
        "runs for those that draw random numbers. The paper's (Canton, Table 4.2) on CLEAR 2007."
    )
    return Report(
        (Table("table-4.2", caption, rows),),
        {},
        (claim,),
    )


def _gain(first: str, second: str, cells: Sequence[Cell]) -> Interval:
    """By how much F is larger, over the recordings tested on and runs; one that draws nothing is compared with every run of the other."""
    counts = [[np.array(one.results["by_recording"]) for one in cells if one.parameters["classifier"] == name] for name in (first, second)]
    runs = max(map(len, counts))
    one, other = (np.concatenate([part[k % len(part)] for k in range(runs)]) for part in counts)
    clips = [str(place) for _ in range(runs) for place in range(len(counts[0][0]))]
    return difference(clips, (one[:, 0], one[:, 1]), (other[:, 0], other[:, 1]))


EXPERIMENT = Experiment("table-4.2", "seven person classifiers: precision, recall, F", "Canton, Table 4.2", grid, cell, report, version=2)
