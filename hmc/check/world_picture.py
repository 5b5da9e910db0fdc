"""A rig before and after a change of its world: cameras and people from two sides, and the floor in the cameras' images."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hmc.camera.coverage import estimate_room
from hmc.camera.model import Rig
from hmc.camera.rig_picture import draw_view
from hmc.camera.world import World, in_world
from hmc.check.upright import Figure
from hmc.io.files import write_figure

__all__ = ["save_world_picture"]

#: Points of people's hulls that are drawn, at most.
DRAWN = 4000
#: Cameras whose images are shown, at most.
SHOWN = 4


def save_world_picture(
    path: str | Path, rig: Rig, world: World, figures: Sequence[Figure], images: Sequence[np.ndarray | None], title: str = ""
) -> None:
    """Write the picture.

    Parameters
    ----------
    path : str or Path
        Any format matplotlib writes, by its suffix.
    rig : Rig
        As the calibration has it.
    world : World
        The change.
    figures : sequence of Figure
        People's hulls, in the calibration's coordinates.
    images : sequence of ndarray or None
        One a camera.
    title : str

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    from matplotlib.figure import Figure as Picture

    points = np.concatenate([one.points for one in figures]) if figures else np.zeros((0, 3))
    points = points[:: max(1, len(points) // DRAWN)]
    new_rig = in_world(rig, world)
    picture = Picture(figsize=(14, 13), layout="constrained")
    rows = picture.subfigures(3, 1, squeeze=False)[:, 0]
    for part, (what, cameras, people) in zip(
        rows,
        (("before: as the calibration has it", rig, points), ("after: metres, z up, floor at 0", new_rig, world.points(points))),
        strict=False,
    ):
        part.suptitle(what, x=0.02, ha="left", weight="bold")
        for ax, (across, up) in zip(part.subplots(1, 3), ((0, 2), (1, 2), (0, 1)), strict=True):
            _draw_side(ax, cameras, people, across, up)
    shown = [c for c, image in enumerate(images) if image is not None][:SHOWN]
    room = estimate_room(new_rig)
    rows[2].suptitle("the floor after, a line a metre", x=0.02, ha="left", weight="bold")
    for ax, c in zip(np.atleast_1d(rows[2].subplots(1, max(1, len(shown)))), shown, strict=False):
        draw_view(new_rig[c], room, images[c], ax)
    picture.suptitle(title)
    write_figure(path, picture, dpi=80)


def _draw_side(ax, rig: Rig, people: np.ndarray, across: int, up: int) -> None:
    """Cameras, the way they look, people and axes, along the third axis."""
    size = float(np.ptp(rig.centres, axis=0).max()) or 1.0
    ax.scatter(people[:, across], people[:, up], s=1, color="0.45", label="people's hulls")
    for index, camera in enumerate(rig):
        ends = np.stack([camera.centre, camera.centre + 0.12 * size * camera.rotation[2]])
        ax.plot(ends[:, across], ends[:, up], color=f"C{index % 10}", linewidth=1)
        ax.plot(*camera.centre[[across, up]], "o", color=f"C{index % 10}", label=camera.name)
    ax.plot(0, 0, "k+", markersize=10, label="origin")
    if up == 2:
        ax.axhline(0, color="tab:red", linewidth=1, label="z = 0")
    ax.set(xlabel="xyz"[across], ylabel="xyz"[up], aspect="equal")
    ax.set_adjustable("datalim")
    if (across, up) == (0, 2):
        ax.legend(fontsize=7, loc="upper left", bbox_to_anchor=(-0.45, 1.0))
