"""The trackers by name: each a step from state to state, with everything that it needs bound to it.

>>> tracker = make_tracker("sparse", color=True, particles=400)
>>> tracker.name, tracker.settings.samples
('sparse', 400)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hmc.errors import InputError
from hmc.tracking import naive, particle, sparse
from hmc.tracking.association import FollowingSettings
from hmc.tracking.blobs import Observation
from hmc.tracking.following import StepInfo, TrackerState

__all__ = ["PRESETS", "TRACKERS", "Settings", "Tracker", "make_tracker", "tracker_of"]

TRACKERS = ("naive", "particle", "sparse")
PRESETS = ("default", "canton2009", "alike")

Settings = FollowingSettings | particle.ParticleSettings | sparse.SparseSettings
Step = Callable[[np.random.Generator, TrackerState, int, Observation | None], tuple[TrackerState, StepInfo]]


@dataclass(frozen=True)
class Tracker:
    """One of the trackers; `hmc.tracking.following.init` and `finish` serve them all.

    Attributes
    ----------
    name : str
        One of `TRACKERS`.
    settings : FollowingSettings, ParticleSettings or SparseSettings
    step : callable
        ``step(rng, state, frame, observation)`` returns the state after the frame and what was found.
    """

    name: str
    settings: Settings
    step: Step

    @property
    def color(self) -> bool:
        """Whether the observations' views must hold the images."""
        return not isinstance(self.settings, FollowingSettings) and self.settings.color

    @property
    def following(self) -> FollowingSettings:
        """What every tracker needs to know of people and their voxels."""
        return self.settings if isinstance(self.settings, FollowingSettings) else self.settings.following


def make_tracker(name: str = "sparse", *, color: bool | None = None, particles: int | None = None, preset: str = "default") -> Tracker:
    """A tracker with the parameters of a preset.

    Parameters
    ----------
    name : {"naive", "particle", "sparse"}
    color : bool, optional
        Whether colours count; the naive tracker has no use for them. By default they do where they can.
    particles : int, optional
        Particles or samples a person, in place of the preset's.
    preset : {"default", "canton2009", "alike"}
        "canton2009" is as the thesis prints it. "alike" is for people who are dressed alike: where they meet, each is expected to go
        on as before.

    Raises
    ------
    InputError
        When there is no such tracker or preset, or when it has no use for colours or particles.
    """
    if preset not in PRESETS:
        raise InputError(f"there is no tracking preset `{preset}`; choose one of {', '.join(PRESETS)}")
    following = _following(preset)
    if name == "naive":
        if color or particles is not None:
            raise InputError("the naive tracker uses neither colours nor particles; choose the tracker `particle` or `sparse`")
        return tracker_of(following)
    if name == "particle":
        ellipsoids = particle.ParticleSettings(color=color is not False, following=following)
        if preset == "canton2009":
            ellipsoids = replace(ellipsoids, drift=0.0, sharpness=1.0)
        return tracker_of(ellipsoids if particles is None else replace(ellipsoids, particles=particles))
    if name == "sparse":
        samples = sparse.SparseSettings(color=color is not False, following=following)
        if preset == "canton2009":
            samples = replace(samples, drift=0.0, scouts=0.0, solid=False)
        return tracker_of(samples if particles is None else replace(samples, samples=particles))
    raise InputError(f"there is no tracker `{name}`; choose one of {', '.join(TRACKERS)}")


def tracker_of(settings: Settings) -> Tracker:
    """The tracker whose parameters these are."""
    if isinstance(settings, sparse.SparseSettings):
        return Tracker("sparse", settings, lambda rng, state, frame, seen: sparse.step(rng, state, frame, seen, settings))
    if isinstance(settings, particle.ParticleSettings):
        return Tracker("particle", settings, lambda rng, state, frame, seen: particle.step(rng, state, frame, seen, settings))
    return Tracker("naive", settings, lambda rng, state, frame, seen: naive.step(state, frame, seen, settings))


def _following(preset: str) -> FollowingSettings:
    if preset == "canton2009":
        return FollowingSettings(exclusion="remove")
    if preset == "alike":
        return FollowingSettings(filter_gain=0.5)
    return FollowingSettings()
