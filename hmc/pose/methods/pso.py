"""Spectral skeletons and particle swarms: Hsiao's system, and the same in the house's company. Hsiao (2008)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hmc.body.spin_skeleton import model_of_body, skeleton_landmarks, thesis_body
from hmc.pose.legs import LegSettings, TellLegs
from hmc.pose.method import Capture, FrameRng, PoseMethod, StartPose
from hmc.pose.recovery import Recovery
from hmc.pose.spectral.reading import BodyReading
from hmc.pose.starts.spectral import body_state
from hmc.pose.starts.window import WindowStart, estimate_height
from hmc.pose.steps.polish import polished
from hmc.pose.steps.presets import PosePreset
from hmc.pose.steps.proposal import as_proposed
from hmc.pose.steps.swarm.step import SwarmPreset, read_view, swarm_memory, swarm_subject, swarmed, swarmed_near
from hmc.pose.steps.swarm.temporal import RestartSettings, SwarmSettings, swarm_step
from hmc.pose.views.person_view import PersonView

__all__ = ["SWARM_PRESETS", "ReadingStart", "pso_method"]

#: Frames of the first window in which a start is tried.
ANCHORS = 3
NEEDS = frozenset({"hulls", "voxels"})

#: `hsiao2008` has limits as printed, curves alone, and a start tried beside every frame's fit; in `default` the voxels count too.
SWARM_PRESETS: dict[str, SwarmPreset] = {
    "default": SwarmPreset(),
    "hsiao2008": SwarmPreset(swarm=SwarmSettings(restart=RestartSettings(always=True), voxels=False), thesis=True),
}


@dataclass(frozen=True)
class ReadingStart:
    """The thesis's start: the frame of the window whose curves show most, and the skeleton fitted to them (section 3.2.2.2).

    Parameters
    ----------
    preset : SwarmPreset
    """

    preset: SwarmPreset

    def __call__(
        self, frame_rng: FrameRng, views: Sequence[PersonView], capture: Capture, height_m: float | None = None
    ) -> StartPose | None:
        """The thesis's body and the pose in the frame that shows most; None where no frame can be read."""
        height_m = height_m or estimate_height([view.target for view in views], capture.floor_z)
        body = thesis_body(height_m)
        model = model_of_body(body, self.preset.thesis)
        readings = [read_view(view, height_m, self.preset.reading) for view in views]
        scores = [2 * r.segmentation.whole + 0.2 * len(r.curves) if r is not None and r.status == "read" else -1.0 for r in readings]
        feet = np.concatenate([np.zeros((0, 3)), *(r.feet for r in readings if r is not None)])
        # A frame can be misread and look whole: of those that show most, the one whose pose costs least.
        found = []
        for k in np.argsort(-np.array(scores), kind="stable")[:ANCHORS].tolist():
            opening: BodyReading | None = readings[k]
            if opening is None or scores[k] <= 0:
                continue
            # At the start, the feet of the whole window say which way the person faces.
            opening = replace(opening, feet=feet)
            swarm, info = swarm_step(frame_rng(k), model, None, opening, capture.fps, views[k].velocity, self.preset.swarm)
            if swarm is not None:
                found.append((info.cost_m, k, swarm))
        if not found:
            return None
        _, anchor, best = min(found, key=lambda one: one[0])
        state = body_state(body, skeleton_landmarks(model, best.state))
        return StartPose(swarm_subject(body, capture, self.preset), anchor, state, swarm_memory(best))


def pso_method(preset: SwarmPreset, house: PosePreset | None = None) -> PoseMethod:
    """Swarms as the thesis has them, or with the house's start, body, refinement, search, recovery and legs.

    Parameters
    ----------
    preset : SwarmPreset
    house : PosePreset, optional
        Whose start and refinement are used; the thesis's method alone where left out.
    """
    equip = partial(swarm_subject, preset=preset)
    if house is None:
        return PoseMethod(
            "pso",
            "Hsiao (2008)",
            ReadingStart(preset),
            as_proposed(swarmed(preset)),
            NEEDS,
            equip,
            limits=thesis_body(1.7).limits,
            window_s=preset.window_s,
            settings={"swarm": preset},
        )
    return PoseMethod(
        "pso",
        "Hsiao (2008), chapter 3; start, body, refinement, search and recovery are the house's",
        start=WindowStart(house),
        step=polished(swarmed_near(preset), house.polish),
        needs=NEEDS,
        equip=equip,
        recover=Recovery(house),
        alternatives=TellLegs(house.polish),
        legs=LegSettings(),
        settings={"swarm": preset, "house": house},
    )
