"""How unlike each camera is to the others by how many frames later it is taken: before and after."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hmc.check.sync.find import TOLD, Synchrony
from hmc.io.files import write_figure

__all__ = ["save_sync_picture"]

COLUMNS = 4


def save_sync_picture(path: str | Path, names: Sequence[str], found: Synchrony, title: str = "") -> None:
    """Write the picture.

    Parameters
    ----------
    path : str or Path
        Any format matplotlib writes, by its suffix.
    names : sequence of str
        Of the cameras.
    found : Synchrony
    title : str

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    from matplotlib.figure import Figure

    columns = min(COLUMNS, len(names))
    rows = -(-len(names) // columns)
    picture = Figure(figsize=(3.6 * columns, 2.6 * rows + 0.6), layout="constrained")
    axes = picture.subplots(rows, columns, squeeze=False, sharey=True).ravel()
    reach = found.curves_before.shape[1] // 2
    shifts = np.arange(-reach, reach + 1)
    for ax, name, one, before, after in zip(axes, names, found.cameras, found.curves_before, found.curves_after, strict=False):
        ax.plot(shifts, 1 - before, color="0.6", label="others as they are now")
        ax.plot(shifts, 1 - after, color="tab:blue", label="others as found")
        ax.axvline(0, color="0.6", linewidth=0.8)
        if one.status in TOLD:
            ax.axvline(one.course.shift, color="tab:red", linewidth=0.8, label="found")
        ax.set(title=f"{name}: {one.status}", xlabel="taken so many frames later", ylabel="agreement")
    for ax in axes[len(names) :]:
        ax.set_axis_off()
    axes[0].legend(fontsize=7)
    picture.suptitle(title)
    write_figure(path, picture, dpi=80)
