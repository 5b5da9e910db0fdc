"""The registry of trackers: the command line, resumed runs and experiments take names and presets from here only.

>>> tracker = make_tracker("sparse", color=True, particles=400)
>>> tracker.name, tracker.settings.samples
('sparse', 400)
"""

from __future__ import annotations

from hmc.errors import InputError
from hmc.plugins import load_plugins
from hmc.tracking import naive, particle, sparse
from hmc.tracking.method import Tracker, TrackerMethod

__all__ = ["BUILT_IN", "DEFAULT", "TRACKERS", "Tracker", "TrackerMethod", "make_tracker", "register_tracker"]

#: By name, in the order of Canton's tables.
TRACKERS: dict[str, TrackerMethod] = {method.name: method for method in (naive.METHOD, sparse.METHOD, particle.METHOD)}
#: Of these, the ones that come with the package.
BUILT_IN = frozenset(TRACKERS)
DEFAULT = "sparse"


def register_tracker(method: TrackerMethod) -> None:
    """Add a tracker under its name: from then on it is used by that name from Python, the command line and the experiments.

    One that was added under the same name before is replaced.

    Parameters
    ----------
    method : TrackerMethod

    Raises
    ------
    InputError
        When the package has a tracker of this name, or when it has no preset "default".

    Examples
    --------
    >>> import hmc
    >>> from dataclasses import replace
    >>> hmc.register_tracker(replace(hmc.TRACKERS["naive"], name="centroids", summary="what fills the last place"))
    >>> hmc.TRACKERS.pop("centroids").summary
    'what fills the last place'
    """
    if method.name in BUILT_IN:
        raise InputError(f"there is a tracker named {method.name!r} already; choose another name")
    if "default" not in method.presets:
        raise InputError(f"the tracker `{method.name}` has no preset `default`; give it one")
    TRACKERS[method.name] = method


def make_tracker(name: str = DEFAULT, *, color: bool | None = None, particles: int | None = None, preset: str = "default") -> Tracker:
    """A tracker with the parameters of a preset.

    Parameters
    ----------
    name : str
        One of `TRACKERS`.
    color : bool, optional
        Whether colors count. By default they do where the tracker uses them.
    particles : int, optional
        Particles or samples a person, in place of the preset's.
    preset : str
        One of the tracker's. "canton2009" is as the thesis prints it; "alike" is for people who are dressed alike: where they meet, each
        is expected to go on as before.

    Raises
    ------
    InputError
        When there is no such tracker or preset, or when it has no use for colors or particles.
    """
    load_plugins()
    if name not in TRACKERS:
        raise InputError(f"there is no tracker `{name}`; choose one of {', '.join(TRACKERS)}")
    method = TRACKERS[name]
    return method.tracker(method.settings(preset, color=color, particles=particles))
