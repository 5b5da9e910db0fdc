"""Studies of poses as data frames: runs, their scores by group with intervals, and the ways in which figures draw them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from hmc.experiments.by_action import pose_scores
from hmc.experiments.engine.experiment import Cell, Table
from hmc.experiments.engine.style import COLORS
from hmc.experiments.five_actions import action_title
from hmc.experiments.pose_intervals import score_interval

__all__ = ["BAR_COLORS", "action_bars", "change_of", "draw_lines", "draw_maps", "recording_bars", "runs_of", "score_table", "table_of"]

BAR_COLORS = (COLORS["particle"], COLORS["sparse"], COLORS["person"], COLORS["other"], COLORS["naive"])


def runs_of(cells: Sequence[Cell]) -> pd.DataFrame:
    """A row a run: its parameters, its ``action`` as the thesis calls it, and under ``run`` the cell."""
    frame = pd.DataFrame([dict(one.parameters) for one in cells])
    return frame.assign(action=[action_title(one.parameters["recording"]) for one in cells], run=list(cells))


def change_of(one: Cell, changes: Mapping[str, Mapping[str, Any]]) -> str:
    """The most specific of some changes, by name, that a cell has: the one of the most parameters among those whose values are all its."""
    fitting = [name for name, changed in changes.items() if all(one.parameters.get(key) == value for key, value in changed.items())]
    return max(fitting, key=lambda name: len(changes[name]))


def score_table(runs: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Scores of groups of runs.

    Parameters
    ----------
    runs : DataFrame
        As from `runs_of`.
    by : sequence of str
        Columns that make the groups, in whose order these come.

    Returns
    -------
    DataFrame
        A row a group: its keys, mean error, MMTP and MMTA at 100 mm, the ends of MMTA's interval over clips and seeds, how many runs
        and clips there are, and frames a second of the filter alone where cells say its seconds.
    """
    rows = []
    for key, own in runs.groupby(list(by), sort=False, dropna=False):
        cells = list(own.run)
        scores, mmta = pose_scores(cells), score_interval(cells, "MMTA_percent")
        row: dict[str, Any] = dict(zip(by, key, strict=True)) | {name: scores[name] for name in ("mean_mm", "MMTP_mm", "MMTA_percent")}
        row |= {"MMTA_low_percent": mmta.low, "MMTA_high_percent": mmta.high, "runs": len(own), "clips": own.recording.nunique()}
        seconds = [one.results["filter_s_per_frame"] for one in cells if "filter_s_per_frame" in one.results]
        if seconds:
            row["filter_frames_per_s"] = 1 / max(float(np.mean(seconds)), 1e-9)
        rows.append(row)
    return pd.DataFrame(rows)


def table_of(name: str, caption: str, frame: pd.DataFrame) -> Table:
    """A data frame as a table of a report."""
    return Table(name, caption, [{str(key): value for key, value in row.items()} for row in frame.to_dict("records")])


def recording_bars(labels: Sequence[str], values: Mapping[str, np.ndarray], xlabel: str) -> Figure:
    """A group of bars a recording, one bar a variant; from above in the order in which they are given.

    Parameters
    ----------
    labels : sequence of str
        Recordings, with their digests.
    values : mapping of str to ndarray, shape (n_labels,)
        By variant.
    xlabel : str
    """
    height, places = 0.8 / len(values), np.arange(len(labels))
    figure, axes = plt.subplots(figsize=(7, 0.12 * len(labels) * (len(values) + 2) + 1))
    for k, (name, value) in enumerate(values.items()):
        axes.barh(places + (k + 0.5) * height - 0.4, value, 0.9 * height, label=name)
    axes.set(yticks=places, yticklabels=[label.rpartition("@")[0] for label in labels], xlabel=xlabel)
    axes.invert_yaxis()
    figure.legend(loc="outside right upper", fontsize=7)
    return figure


def draw_lines(axes: Axes, table: pd.DataFrame, x: str, y: str, by: str, **labels: str) -> None:
    """A line a value of `by`, with error bars where `y` is MMTA; `labels` are of the axes."""
    for name, own in table.groupby(by, sort=False):
        if y == "MMTA_percent":
            # One run has no interval: its bar would be without an end.
            ends = np.abs([own[y] - own.MMTA_low_percent, own.MMTA_high_percent - own[y]])
            axes.errorbar(own[x], own[y], np.where(np.isfinite(ends), ends, 0), marker="o", capsize=2, label=str(name))
            axes.set_ylim(0, 105)
        else:
            axes.plot(own[x], own[y], "o-", label=str(name))
    axes.set(**labels)


def draw_maps(panels: Sequence[tuple[str, pd.DataFrame]], columns: int, rows: str = "layers", across: str = "particles") -> Figure:
    """MMTA in color and in numbers, a panel a title and table.

    Parameters
    ----------
    panels : sequence of (title, table)
    columns : int
        Panels side by side.
    rows, across : str
        What each panel has upwards and to the right.
    """
    lines = -(-len(panels) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(2.8 * columns, 2.6 * lines), sharex=True, sharey=True, squeeze=False)
    for ax, (title, table) in zip(axes.flat, panels, strict=False):
        values = table.pivot_table(index=rows, columns=across, values="MMTA_percent")
        ax.imshow(values, origin="lower", vmin=0, vmax=100, aspect="auto", cmap="viridis")
        ax.grid(False)
        ax.set_xticks(range(values.shape[1]), [f"{value:g}" for value in values.columns])
        ax.set_yticks(range(values.shape[0]), [f"{value:g}" for value in values.index])
        for (i, j), value in np.ndenumerate(values.to_numpy()):
            ax.text(j, i, f"{value:.0f}", ha="center", va="center", color="white" if value < 60 else "black", fontsize=8)
        ax.set(title=title, xlabel=across, ylabel=rows)
    figure.colorbar(ScalarMappable(Normalize(0, 100), "viridis"), ax=axes, label="MMTA (%)")
    return figure


def action_bars(rows: Sequence[Mapping[str, Any]], methods: Sequence[str], papers: Mapping[str, Mapping[str, Sequence[float]]]) -> Figure:
    """Mean error, MMTP and MMTA of every action, methods side by side, each with the paper's own figure as a black mark.

    Parameters
    ----------
    rows : sequence of mapping
        As of `hmc.experiments.by_action.action_rows`.
    methods : sequence of str
    papers : mapping of method to mapping of action to figures
        In the order of `hmc.experiments.by_action.COLUMNS`; methods that the paper lacks are left out.
    """
    shown = [row for row in rows if row["recording"] == "all"]
    actions = list(dict.fromkeys(row["action"] for row in shown))
    figure, panels = plt.subplots(1, 3, figsize=(11, 3.4))
    width, places = 0.8 / len(methods), np.arange(len(actions))
    scores = (("mean_mm", 0, "mean error (mm)"), ("MMTP_mm", 2, "MMTP (mm)"), ("MMTA_percent", 3, "MMTA at 100 mm (%)"))
    for axes, (column, place, label) in zip(panels, scores, strict=True):
        for k, method in enumerate(methods):
            found = {row["action"]: row[column] for row in shown if row["method"] == method}
            values = [found.get(action, np.nan) for action in actions]
            axes.bar(places + k * width, values, width, label=method, color=BAR_COLORS[k % len(BAR_COLORS)])
            paper = [papers.get(method, {}).get(action, [np.nan] * 4)[place] for action in actions]
            axes.plot(places + k * width, paper, "_", color="black", markersize=110 * width / len(actions) + 4, markeredgewidth=2)
        axes.set_xticks(places + width * (len(methods) - 1) / 2, actions, rotation=30, ha="right")
        axes.set_ylabel(label)
    if any(papers.get(method) for method in methods):
        panels[0].plot([], [], "_", color="black", markersize=8, markeredgewidth=2, label="the paper")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
