"""What the multi-cue descent proposes in a frame. Kehl (2006), section 6.4; the waist, which the paper's body has not, stays as it was."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hmc.body.model import BodyModel
from hmc.pose.method import Capture, Subject, Tracked, make_subject
from hmc.pose.objectives.color_cue import ColorModel
from hmc.pose.steps.descent.tracker import SmdPreset, TrackState, make_tracker, track_step
from hmc.pose.steps.proposal import Proposal, Propose
from hmc.pose.views.person_view import PersonView

__all__ = ["colors_of", "descended", "solid_subject", "with_colors"]

#: The body of superellipsoids among a subject's extras.
_SOLID = "solid"


def solid_subject(body: BodyModel, capture: Capture, preset: SmdPreset) -> Subject:
    """A subject with a body of superellipsoids.

    Parameters
    ----------
    body : BodyModel
    capture : Capture
    preset : SmdPreset
    """
    return replace(make_subject(body, capture), extras={_SOLID: make_tracker(body, preset)})


def descended() -> Propose:
    """Stochastic Meta Descent on all cues from where the last frame's motion leads; it remembers the patches' colors.

    Returns
    -------
    callable
        `Propose`, of subjects as from `solid_subject`.
    """

    def propose(rng: np.random.Generator, tracked: Tracked, view: PersonView) -> Proposal:
        before = TrackState(tracked.state, tracked.velocity, colors_of(tracked.memory))
        after, info = track_step(rng, tracked.subject.extras[_SOLID], before, view.skin)
        # Of all iterations' samples, as many evaluations as there were iterations.
        return Proposal(after.state, after.state, info.value, int(info.iterations.sum()), with_colors(after.colors), info.status)

    return propose


def colors_of(memory: Mapping[str, np.ndarray]) -> ColorModel | None:
    """The patches' colors in a memory, if any."""
    return ColorModel(memory["color_mean"], memory["color_deviation"]) if "color_mean" in memory else None


def with_colors(colors: ColorModel | None) -> dict[str, np.ndarray]:
    """The patches' colors as entries of a memory."""
    return {} if colors is None else {"color_mean": colors.mean, "color_deviation": colors.deviation}
