"""What a tracker is: everything that the command line, the journal and the experiments ask of one.

A tracker of your own is a settings class, a function and one record; it needs no change to any file of the package::

    @dataclass(frozen=True)
    class StillSettings:
        following: FollowingSettings = FollowingSettings()

    def step(rng, state, frame, observation, settings):
        def stand_still(state, predicted, observation):
            places = np.array([track.position for track in state.tracks]).reshape(-1, 3)
            return FilterEstimate(places, np.ones(len(places), bool))

        return advance(state, frame, observation, settings.following, stand_still)

    register(TrackerMethod("still", "", "persons stay where they are", step, {"default": StillSettings()}))
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hmc.errors import InputError
from hmc.tracking.blobs import Observation
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.state import TrackerInfo, TrackerState

__all__ = ["Step", "Tracker", "TrackerMethod"]

#: ``step(rng, state, frame, observation, settings)`` returns the state after the frame and what was found; of a frame that tells nothing
#: the observation is None.
Step = Callable[[np.random.Generator, TrackerState, int, Observation | None, Any], tuple[TrackerState, TrackerInfo]]


@dataclass(frozen=True)
class TrackerMethod:
    """A way to follow people.

    Attributes
    ----------
    name : str
        As on the command line.
    source : str
        Author, year and section.
    summary : str
        One line of help.
    step : callable
        ``step(rng, state, frame, observation, settings)``; most leave association, birth and death to `hmc.tracking.following.advance`.
        What they remember is in the state: `PersonMemory.arrays` of each person, `TrackerState.arrays` of the frame.
    presets : mapping of str to settings
        With "default". Frozen dataclasses with a field ``following``, a `FollowingSettings`.
    label : str
        In tables and figures; the name where left out.
    uses_colors : bool
        Whether it can use colors. The settings' field ``color`` says whether it does.
    particles : str or None
        The settings' field that holds the number of particles or samples a person; None where there are none.
    """

    name: str
    source: str
    summary: str
    step: Step
    presets: Mapping[str, Any]
    label: str = ""
    uses_colors: bool = False
    particles: str | None = None

    def tracker(self, settings: Any = None) -> Tracker:
        """The tracker with these settings; with those of the preset "default" where left out."""
        return Tracker(self, self.presets["default"] if settings is None else settings)

    def settings(self, preset: str = "default", *, color: bool | None = None, particles: int | None = None) -> Any:
        """The settings of a preset, with colors switched on or off and another number of particles where said.

        Raises
        ------
        InputError
            When there is no such preset, or no use for colors or particles.
        """
        if preset not in self.presets:
            raise InputError(f"the tracker `{self.name}` has no preset `{preset}`; choose one of {', '.join(self.presets)}")
        settings = self.presets[preset]
        if color and not self.uses_colors:
            raise InputError(f"the tracker `{self.name}` does not use colors; choose another tracker, or leave the option out")
        if particles is not None and self.particles is None:
            raise InputError(f"the tracker `{self.name}` has no particles; choose another tracker, or leave the option out")
        if self.uses_colors and color is not None:
            settings = replace(settings, color=color)
        return settings if particles is None or self.particles is None else replace(settings, **{self.particles: particles})


@dataclass(frozen=True)
class Tracker:
    """A method with its settings: a step from state to state.

    Attributes
    ----------
    method : TrackerMethod
    settings : dataclass
        One of the method's.
    """

    method: TrackerMethod
    settings: Any

    @property
    def name(self) -> str:
        """The method's name."""
        return self.method.name

    @property
    def color(self) -> bool:
        """Whether the observations' views must hold the images."""
        return self.method.uses_colors and bool(self.settings.color)

    @property
    def following(self) -> FollowingSettings:
        """What every tracker is told of people and their voxels."""
        return self.settings.following

    def step(
        self, rng: np.random.Generator, state: TrackerState, frame: int, observation: Observation | None
    ) -> tuple[TrackerState, TrackerInfo]:
        """The state after a frame, and what was found in it."""
        return self.method.step(rng, state, frame, observation, self.settings)
