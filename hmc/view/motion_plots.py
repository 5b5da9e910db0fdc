"""Angles over time as curves, and moving stick figures, with matplotlib: for notebooks and for `hmc angles --plot`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO

import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from hmc.errors import InputError
from hmc.landmarks import BONES, landmark_index
from hmc.view.curve import draw_curve
from hmc.view.overlay import LEFT, RIGHT, person_color

__all__ = ["animate_sticks", "draw_angles"]

#: More would take minutes to draw and megabytes to show.
MOST_FRAMES = 300
_STYLES = ("-", "--", ":", "-.")
_COLUMNS = 4
#: How wide a curve is, points.
LINE = 1.4


class ShownFigure(Figure):
    """A figure that a notebook shows, whether or not pyplot is at work in it."""

    def _repr_png_(self) -> bytes:
        with BytesIO() as file:
            self.savefig(file, format="png", dpi=100)
            return file.getvalue()


def draw_angles(
    table: Mapping[str, np.ndarray], names: Sequence[str] | None = None, doubtful: Mapping[str, np.ndarray] | None = None
) -> Figure:
    """Draw angles over time: a panel an angle, left (orange) and right (blue) in one; persons differ by the style of the line.

    Parameters
    ----------
    table : mapping
        ``time_s``, ``person`` and angles in degrees (``..._deg``), shape (n,), as `hmc.motion.clinical.angle_table` has.
    names : sequence of str, optional
        These angles alone, with or without ``l_``, ``r_`` and ``_deg``; by default all that are known somewhere.
    doubtful : mapping, optional
        Of each angle which rows rest on a doubtful landmark, bool, shape (n,), as `hmc.motion.clinical.doubtful_angles` has: drawn pale.

    Raises
    ------
    InputError
        When there is no such angle.
    """
    panels = _panels(table, names)
    rows = -(-len(panels) // _COLUMNS)
    across = min(len(panels), _COLUMNS)
    figure = ShownFigure(figsize=(3.6 * across, 2.2 * rows + 0.4), layout="constrained")
    FigureCanvasAgg(figure)
    persons, some_pale = np.unique(table["person"]).tolist(), False
    for place, (title, columns) in enumerate(panels.items()):
        ax = figure.add_subplot(rows, across, place + 1)
        for k, person in enumerate(persons):
            own = table["person"] == person
            for column in columns:
                color = {"l_": _rgb(LEFT), "r_": _rgb(RIGHT)}.get(column[:2], "0.25")
                side = {"l_": "left", "r_": "right"}.get(column[:2], "")
                label = " ".join(part for part in (side, f"person {person}" if len(persons) > 1 else "") if part)
                style = _STYLES[k % len(_STYLES)]
                pale = np.zeros(own.sum(), bool) if doubtful is None else doubtful[column][own]
                curve = _broken(table["time_s"][own], table[column][own], pale)
                draw_curve(ax, *curve, label, color=color, linestyle=style, linewidth=LINE)
                some_pale |= bool(pale.any())
        ax.set_title(title, fontsize=9)
        ax.tick_params(labelsize=8)
        ax.axhline(0, color="0.8", linewidth=0.8, zorder=0)
        if place % across == 0:
            ax.set_ylabel("degrees", fontsize=8)
        if place >= len(panels) - across:
            ax.set_xlabel("s", fontsize=8)
    widest = max(figure.axes, key=lambda ax: len(ax.get_legend_handles_labels()[1]))
    if any(widest.get_legend_handles_labels()[1]):
        widest.legend(fontsize=7)
    if some_pale:
        said = "pale: rests on a landmark that is doubtful", "(its trust in joints.csv)"
        figure.supxlabel(("\n" if across == 1 else " ").join(said), fontsize=8)
    return figure


def animate_sticks(frames: np.ndarray, persons: np.ndarray, positions: np.ndarray, fps: float, step: int = 1) -> FuncAnimation:
    """Stick figures that move: left limbs orange, right limbs blue.

    Parameters
    ----------
    frames, persons : ndarray of int, shape (n,)
        Of each row.
    positions : ndarray, shape (n, 15, 3)
        Landmarks, world, metres; bones with a missing end are left out.
    fps : float
        Frames a second; they are shown as fast as that.
    step : int
        Each how many frames one is shown; more where there would be more than 300.

    Raises
    ------
    InputError
        When there is no pose, or the step is below 1.
    """
    known = np.isfinite(positions).all(axis=2)
    if step < 1:
        raise InputError(f"`step` must be 1 or more; got {step}")
    if not known.any():
        raise InputError("there is no pose to animate")
    fitted = np.unique(frames[known.any(axis=1)])
    step = max(step, -(-int(fitted[-1] - fitted[0] + 1) // MOST_FRAMES))
    shown = range(int(fitted[0]), int(fitted[-1]) + 1, step)
    figure = Figure(figsize=(5, 5))
    FigureCanvasAgg(figure)
    ax = figure.add_subplot(projection="3d")
    low, high = positions[known].min(axis=0) - 0.1, positions[known].max(axis=0) + 0.1
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]), xlabel="x (m)", ylabel="y (m)", zlabel="z (m)")
    ax.set_box_aspect(high - low)
    ends = np.array([[landmark_index(a), landmark_index(b)] for a, b in BONES])
    lines = Line3DCollection([], linewidths=2.5, capstyle="round")
    ax.add_collection3d(lines, autolim=False)

    def draw(frame: int):
        segments, colors = [], []
        for row in np.flatnonzero(frames == frame):
            for (a, b), (_, name) in zip(ends, BONES, strict=True):
                if known[row, a] and known[row, b]:
                    segments.append(positions[row, [a, b]])
                    colors.append(_rgb({"l_": LEFT, "r_": RIGHT}.get(name[:2], person_color(int(persons[row])))))
        lines.set_segments(segments)
        lines.set_color(colors)
        ax.set_title(f"frame {frame}, {frame / fps:.2f} s", fontsize=9)
        return (lines,)

    return FuncAnimation(figure, draw, frames=shown, init_func=lambda: (lines,), interval=1000 * step / fps)


def _panels(table: Mapping[str, np.ndarray], names: Sequence[str] | None) -> dict[str, list[str]]:
    """Title of each panel, and the columns in it."""
    panels: dict[str, list[str]] = {}
    for column in (name for name in table if name.endswith("_deg")):
        joint = column.removesuffix("_deg")
        joint = joint[2:] if joint[:2] in ("l_", "r_") else joint
        called = {column, column.removesuffix("_deg"), joint, f"{joint}_deg"}
        if called & set(names) if names is not None else np.isfinite(table[column]).any():
            panels.setdefault(joint.replace("_", " "), []).append(column)
    for name in names or ():
        columns = {column.removesuffix("_deg") for column in table if column.endswith("_deg")}
        if name.removesuffix("_deg") not in columns | {column[2:] for column in columns if column[:2] in ("l_", "r_")}:
            raise InputError(f"no angle {name!r}; there are {', '.join(sorted(columns))}")
    if not panels:
        raise InputError("no angle is known in any frame")
    return panels


def _broken(times: np.ndarray, values: np.ndarray, pale: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The curve and what of it is pale, broken where it goes through 180 degrees."""
    jumps = np.flatnonzero(np.abs(np.diff(values)) > 180) + 1
    return np.insert(times, jumps, np.nan), np.insert(values, jumps, np.nan), np.insert(pale, jumps, False)


def _rgb(bgr: tuple[int, int, int]) -> tuple[float, float, float]:
    blue, green, red = bgr
    return red / 255, green / 255, blue / 255
