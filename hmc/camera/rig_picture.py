"""One picture of a rig: the cameras and the room from above, and a frame of each view with the room's floor drawn in.

What is wrong with a calibration shows here at once: a floor that does not lie on the floor, a camera that looks away.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np

from hmc.camera.coverage import in_view
from hmc.camera.model import Camera, Rig, backproject, project

__all__ = ["draw_rig", "draw_view", "rig_figure"]

#: Points along a drawn line; enough that a distorted one looks curved.
LINE_POINTS = 60
#: Below the title of a picture stand so many lines of so many letters, at most; of one sentence so many.
MOST_LINES, MOST_LETTERS, LINES_EACH = 6, 150, 3
#: Color of a floor that people stand on and that is not the room's.
FLOOR_COLOR = "lime"
#: Width of a bold letter, and where a camera's name may stand above its place, first choice first; points.
LETTER_POINTS, OFFSETS_POINTS = 7.0, (7.0, -19.0, 22.0, -34.0, 37.0)


def draw_rig(rig: Rig, room: np.ndarray, ax=None):
    """Draw cameras and room from above, over the number of cameras that see each place at 1 m height.

    Parameters
    ----------
    rig : Rig
    room : ndarray, shape (2, 3)
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes
    """
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    ax = Figure(figsize=(7, 7)).add_subplot() if ax is None else ax
    corners = np.vstack([rig.centres[:, :2], room[:, :2]])
    margin = 0.12 * float(np.ptp(corners, axis=0).max()) + 0.3
    low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    axes = [np.linspace(low[i], high[i], 160) for i in range(2)]
    places = np.stack(np.meshgrid(*axes, [room[0, 2] + 1.0], indexing="xy"), axis=-1)[..., 0, :]
    seen = np.sum([in_view(camera, places) for camera in rig], axis=0)
    picture = ax.imshow(
        seen, origin="lower", extent=(low[0], high[0], low[1], high[1]), cmap="Greys", vmin=0, vmax=1.6 * len(rig), interpolation="nearest"
    )
    bar = ax.figure.colorbar(picture, ax=ax, shrink=0.7, boundaries=np.arange(len(rig) + 2) - 0.5, ticks=range(len(rig) + 1))
    bar.set_label("cameras that see a place, 1 m above the floor")
    (x0, y0), (x1, y1) = room[:, :2]
    ax.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, color="tab:red", linewidth=2, label="room"))
    length = 0.5 * float(np.ptp(corners, axis=0).max())
    point_m = float(np.ptp([low, high], axis=0).max()) / (min(ax.bbox.width, ax.bbox.height) * 72 / ax.figure.dpi)
    taken: list[np.ndarray] = []
    for index, camera in enumerate(rig):
        color = f"C{index % 10}"
        x, y, z = camera.centre
        cone = view_cone(camera, length, room[0, 2])
        ax.add_collection(PolyCollection([cone], facecolor=color, alpha=0.08), autolim=False)  # `fill` looks at each of its points
        ax.plot(*cone.T, color=color, linewidth=0.8)
        ax.plot(x, y, "o", color=color, markersize=8)
        side = 1 if x < corners[:, 0].mean() else -1
        name = f"{camera.name} ({z:.1f} m)"
        above = _free_offset(name, np.array([x, y]), side, point_m, taken)
        where = {"xytext": (7 * side, above), "textcoords": "offset points", "ha": "left" if side > 0 else "right"}
        box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1.5}
        ax.annotate(name, (x, y), color=color, weight="bold", bbox=box, **where)
    ax.plot(0, 0, "k+", markersize=12, label="origin")
    for axis, (x, y) in (("x", (1, 0)), ("y", (0, 1))):
        ax.annotate("", (x, y), (0, 0), arrowprops={"arrowstyle": "->", "color": "black"})
        ax.annotate(axis, (x, y), xytext=(4, 4), textcoords="offset points", fontsize=9)
    ax.set(
        xlim=(low[0], high[0]),
        ylim=(low[1], high[1]),
        xlabel="x (m)",
        ylabel="y (m)",
        aspect="equal",
        title="rig from above (camera heights in brackets)",
    )
    ax.legend(loc="lower right")
    return ax


def view_cone(camera: Camera, length: float, floor: float = 0.0) -> np.ndarray:
    """Where a camera looks, seen from above: the hull of its place and of what it sees of the floor, cut at a distance.

    Parameters
    ----------
    camera : Camera
    length : float
        Metres from the camera at which the cone is cut.
    floor : float
        Height of the floor, metres.

    Returns
    -------
    ndarray, shape (n, 2)
        Outline, first and last point the same.
    """
    from scipy.spatial import ConvexHull

    width, height = camera.size
    u, v = np.meshgrid(np.linspace(0, width - 1, LINE_POINTS), np.linspace(0, height - 1, LINE_POINTS))
    rays = backproject(camera, np.stack([u, v], axis=-1).reshape(-1, 2))
    across = np.maximum(np.linalg.norm(rays[:, :2], axis=1), 1e-9)
    fall = np.where(rays[:, 2] < -1e-9, rays[:, 2], np.nan)
    distance = np.fmin((floor - camera.centre[2]) / fall * across, length).clip(0)
    points = camera.centre[:2] + np.vstack([rays[:, :2] * (distance / across)[:, None], 1e-3 * np.eye(2), -1e-3 * np.eye(2)])
    outline = points[ConvexHull(points).vertices]
    return np.vstack([outline, outline[:1]])


def _free_offset(name: str, place: np.ndarray, side: int, point_m: float, taken: list[np.ndarray]) -> float:
    """How many points above a camera its name stands so that it covers none of `taken`, which grows by it; by usual widths of letters."""
    width, height = LETTER_POINTS * np.array([len(name) * point_m, 2 * point_m])
    for above in OFFSETS_POINTS:
        low = place + [7 * side * point_m - (width if side < 0 else 0), above * point_m]
        box = np.array([low, low + [width, height]])
        if not any((box[0] < other[1]).all() and (other[0] < box[1]).all() for other in taken):
            break
    taken.append(box)
    return above


def draw_view(camera: Camera, room: np.ndarray, image: np.ndarray | None, ax=None, floor: np.ndarray | None = None):
    """Draw one image with the room's floor (a line a metre) and its upright edges.

    Parameters
    ----------
    camera : Camera
    room : ndarray, shape (2, 3)
    image : ndarray, shape (h, w, 3), uint8 BGR, or None
    ax : matplotlib Axes, optional
    floor : ndarray, shape (n, 2, 3), optional
        Lines of another floor, both ends of each.

    Returns
    -------
    matplotlib Axes
    """
    from matplotlib.figure import Figure

    ax = Figure(figsize=(5, 4)).add_subplot() if ax is None else ax
    width, height = camera.size
    if image is None:
        ax.text(width / 2, height / 2, "no image", ha="center", va="center", color="grey")
    else:
        ax.imshow(image[..., ::-1])
    low, high = room
    for axis in range(2):
        start, stop = low.copy(), np.array([*high[:2], low[2]])
        for value in np.unique([low[axis], *np.arange(np.ceil(low[axis]), high[axis]), high[axis]]):
            start[axis] = stop[axis] = value
            edge = value in (low[axis], high[axis])
            _draw_line(ax, camera, start, stop, "tab:red" if edge else "gold", 1.6 if edge else 0.6)
    for x in (low[0], high[0]):
        for y in (low[1], high[1]):
            _draw_line(ax, camera, np.array([x, y, low[2]]), np.array([x, y, high[2]]), "tab:red", 0.6)
    for start, stop in () if floor is None else floor:
        _draw_line(ax, camera, start, stop, FLOOR_COLOR, 0.9)
    ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xticks=[], yticks=[], aspect="equal")
    ax.set_title(f"{camera.name}, {width} x {height}", fontsize=9)
    return ax


def _draw_line(ax, camera: Camera, start: np.ndarray, stop: np.ndarray, color: str, width: float) -> None:
    uv, valid = project(camera, start + np.linspace(0, 1, LINE_POINTS)[:, None] * (stop - start))
    ax.plot(*np.where(valid[:, None], uv, np.nan).T, color=color, linewidth=width)


def rig_figure(rig: Rig, room: np.ndarray, images: Sequence[np.ndarray | None], title: str = "", floor: np.ndarray | None = None):
    """The picture of a rig: `draw_rig` on the left, `draw_view` of each camera on the right.

    Parameters
    ----------
    rig : Rig
    room : ndarray, shape (2, 3)
    images : sequence of ndarray or None
        One a camera.
    title : str
        Its first line is the title; what follows stands below it, cut short where it is too long or too much.
    floor : ndarray, shape (n, 2, 3), optional
        As of `draw_view`; a legend says what it is.

    Returns
    -------
    matplotlib Figure
    """
    from matplotlib.figure import Figure

    aspect = max(camera.size[1] / camera.size[0] for camera in rig)
    # As many columns as make the views about as high as the plan beside them.
    columns = min(range(1, len(rig) + 1), key=lambda n: abs(np.ceil(len(rig) / n) * 3.2 * aspect - 7))
    rows = int(np.ceil(len(rig) / columns))
    height = max(7.0, rows * 3.2 * aspect + 1)
    figure = Figure(figsize=(8 + 3.4 * columns, height), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=(8, 3.4 * columns), squeeze=False)[0]
    draw_rig(rig, room, left.add_subplot())
    for index, (camera, image) in enumerate(zip(rig, images, strict=True)):
        draw_view(camera, room, image, right.add_subplot(rows, columns, index + 1), floor)
    if floor is not None:
        from matplotlib.lines import Line2D

        right.legend(handles=[Line2D([], [], color=FLOOR_COLOR, label="the floor on which people stand")], loc="outside lower right")
    first, *others = title.split("\n")
    below = [part for line in others for part in textwrap.wrap(line, MOST_LETTERS, max_lines=LINES_EACH, placeholder=" ...")]
    figure.suptitle("\n".join([first, *below[:MOST_LINES]]))
    return figure
