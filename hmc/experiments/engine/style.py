"""One look for all figures of the experiments."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib

__all__ = ["COLORS", "house_style"]

#: Colors by what is drawn, the same in every figure; the orange and the blue are those of left and right limbs.
COLORS = {"naive": "0.45", "particle": "#3ca0ff", "sparse": "#ff8c28", "paper": "0.15", "person": "tab:green", "other": "tab:red"}

_STYLE: dict[Any, Any] = {
    "figure.constrained_layout.use": True,
    "figure.dpi": 100,
    "savefig.dpi": 150,
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.5,
    "lines.markersize": 4,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "pdf.fonttype": 42,
    "svg.hashsalt": "hmc",
}


@contextmanager
def house_style() -> Iterator[None]:
    """Draw in this look, and without a screen."""
    backend = matplotlib.get_backend()
    matplotlib.use("Agg")
    try:
        with matplotlib.rc_context(_STYLE):
            yield
    finally:
        matplotlib.use(backend)
