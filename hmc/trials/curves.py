"""Curves of a trial over time, as one drawing: speed, knees, elbows, cost. Knees and elbows are pale where a landmark is doubtful."""

from __future__ import annotations

import io
from collections.abc import Mapping
from itertools import cycle
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from hmc.landmarks import landmark_index
from hmc.trials.quality import TrialResult
from hmc.view.curve import draw_curve

__all__ = ["curves_svg", "flexion", "speed"]

#: Time over which speeds are averaged, seconds.
SMOOTH_S = 0.2
#: Points of a curve, at most.
MOST_POINTS = 600
LEFT, RIGHT = "#e07b00", "#2276d2"
JOINTS = {
    "knees": (("l_hip", "l_knee", "l_ankle"), ("r_hip", "r_knee", "r_ankle")),
    "elbows": (("l_shoulder", "l_elbow", "l_wrist"), ("r_shoulder", "r_elbow", "r_wrist")),
}
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "hmc",
    "font.size": 9,
    "font.family": "sans-serif",
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.fontsize": 8,
}


def speed(positions: np.ndarray, frames: np.ndarray, fps: float) -> np.ndarray:
    """How fast a point moves, averaged over `SMOOTH_S`.

    Parameters
    ----------
    positions : ndarray, shape (n, 3)
        Metres.
    frames : ndarray of int, shape (n,)
        Rising.
    fps : float

    Returns
    -------
    ndarray, shape (n,)
        Metres a second; NaN of a single frame.
    """
    if len(frames) < 2:
        return np.full(len(frames), np.nan)
    velocities = uniform_filter1d(np.gradient(positions, frames / fps, axis=0), max(1, round(SMOOTH_S * fps)), axis=0, mode="nearest")
    return np.linalg.norm(velocities, axis=1)


def flexion(positions: np.ndarray, joint: tuple[str, str, str]) -> np.ndarray:
    """How far a joint is bent, degrees, 0 where it is straight: (n, 15, 3) landmarks to (n,)."""
    before, at, after = (positions[:, landmark_index(name)] for name in joint)
    one, other = at - before, after - at
    along = (one * other).sum(axis=1) / (np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1))
    return np.rad2deg(np.arccos(np.clip(along, -1, 1)))


def curves_svg(result: TrialResult) -> str:
    """The drawing as SVG text, the same for the same result."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(7.2, 6.4), layout="constrained")
        axes = figure.subplots(4, sharex=True)
        dashes = cycle(["-", "--", ":", "-."])
        several = result.n_persons > 1
        for person, dash in zip(np.unique(result.poses.persons), dashes, strict=False):
            poses, tracks, rows = result.poses.of(person), result.tracks.of(person), result.states.persons == person
            doubtful = np.zeros(poses.positions.shape[:2], bool) if poses.doubtful is None else poses.doubtful
            whose = f"person {person}" if several else ""
            own = {"color": "#333333", "linestyle": dash, "label": whose}
            _curve(axes[0], tracks.frames, speed(tracks.positions, tracks.frames, result.fps), result.fps, own)
            for axis, sides in zip(axes[1:3], JOINTS.values(), strict=True):
                for joint, color, side in zip(sides, (LEFT, RIGHT), ("left", "right"), strict=True):
                    label = f"{side}, {whose}" if several else side
                    pale = np.asarray(doubtful[:, [landmark_index(name) for name in joint]].any(axis=1))
                    bent, style = flexion(poses.positions, joint), {"color": color, "linestyle": dash, "label": label}
                    _curve(axis, poses.frames, bent, result.fps, style, pale)
            if result.states.costs is not None:
                _curve(axes[3], result.states.frames[rows], result.states.costs[rows], result.fps, own)
        names = ("centroid, m/s", "knees bent, deg", "elbows bent, deg", "cost")
        for axis, name in zip(axes, names, strict=True):
            axis.set_ylabel(name)
            axis.axhline(0, linewidth=0)  # so that the margin above is a share of all that is shown
            axis.set_ylim(bottom=0)
            if axis.get_legend_handles_labels()[1]:
                axis.legend(loc="lower right", bbox_to_anchor=(1, 0.98), ncols=4, borderaxespad=0)
        axes[-1].ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
        axes[-1].set_xlabel("time, s")
        figure.align_ylabels()
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    return text.getvalue()


def _curve(axis, frames: np.ndarray, values: np.ndarray, fps: float, style: Mapping[str, str], pale: np.ndarray | None = None) -> None:
    """A curve with gaps where frames are missing."""
    if not len(frames):
        return
    whole, doubtful = np.full(np.ptp(frames) + 1, np.nan), np.zeros(np.ptp(frames) + 1, bool)
    whole[frames - frames.min()] = values
    if pale is not None:
        doubtful[frames - frames.min()] = pale
    at = np.arange(0, len(whole), max(1, -(-len(whole) // MOST_POINTS)))
    draw_curve(axis, (at + frames.min()) / fps, whole[at], np.logical_or.reduceat(doubtful, at), **style)
