"""A curve over time that is pale where it is doubtful: the same in all plots."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["PALE", "draw_curve"]

#: How opaque a doubtful stretch of a curve is.
PALE = 0.35
#: Curves lie over their pale stretches, whoever's they are.
_BELOW, _ABOVE = 2.0, 2.1


def draw_curve(ax: Axes, times: np.ndarray, values: np.ndarray, pale: np.ndarray | None = None, label: str = "", **style) -> None:
    """Draw a curve, of which what leads to and from doubtful values is pale.

    Parameters
    ----------
    ax : matplotlib axes
    times, values : ndarray, shape (n,)
        NaN breaks the curve.
    pale : ndarray of bool, shape (n,), optional
        Which values are doubtful.
    label : str
        For a legend, which shows it as it is where nothing is doubtful.
    **style
        As ``ax.plot`` has it: ``color``, ``linestyle``, ``linewidth``.
    """
    sure = values
    if pale is not None and pale.any():
        ax.plot(times, values, alpha=PALE, zorder=_BELOW, **style)
        sure = np.where(pale, np.nan, values)
    ax.plot(times, sure, label=label or None, zorder=_ABOVE, **style)
