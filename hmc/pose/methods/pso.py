"""Spectral skeletons and particle swarms: Hsiao's system, and the same in the house's company. Hsiao (2008)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hmc.body.spin_skeleton import model_of_body, skeleton_landmarks, thesis_body
from hmc.pose.back_settings import BackwardSettings
from hmc.pose.legs import LegSettings, TellLegs
from hmc.pose.method import Capture, FrameRng, PoseMethod, StartPose
from hmc.pose.recovery import Recovery
from hmc.pose.spectral.reading import ReadingSettings
from hmc.pose.spectral.segmentation import printed_segmentation
from hmc.pose.spectral.skeleton import SkeletonSettings
from hmc.pose.starts.spectral import body_state
from hmc.pose.starts.stature import estimate_height
from hmc.pose.starts.window import WindowStart
from hmc.pose.steps.polish import polished
from hmc.pose.steps.presets import PosePreset
from hmc.pose.steps.proposal import as_proposed
from hmc.pose.steps.swarm.fit import FitSettings
from hmc.pose.steps.swarm.step import Read, SwarmPreset, read_view, swarm_memory, swarm_subject, swarmed, swarmed_near
from hmc.pose.steps.swarm.temporal import RestartSettings, SwarmSettings, swarm_step
from hmc.pose.views.person_view import PersonView
from hmc.search.swarm import PsoSettings

__all__ = ["SWARM_PRESETS", "ReadingStart", "pso_method"]

NEEDS = frozenset({"hulls", "voxels"})

#: The thesis's system as printed. What it does not print has our value: lengths of the body (average people's, by stature: Table 3-1
#: names them), t1 to t3, particles and iterations of every stage, how far the temporal constraint reaches, and by how much the start of a
#: frame must fit better to take the place of the pose that is followed ("some threshold", 3.2.2.5).
PRINTED = SwarmPreset(
    reading=ReadingSettings(
        segmentation=printed_segmentation(),  # 3.1.4.2
        skeleton=SkeletonSettings(trunk_trim=0.0, trunk_along_axis=False),  # 3.1.5.2: of every part the first eigenvector
        longest_limb=np.inf,  # no curve is left out for its length,
        least_limb=0.0,
        least_curves=2,  # and the trunk's and any other are a body
        named=False,
    ),
    swarm=SwarmSettings(
        fit=FitSettings(swarm=PsoSettings(anywhere=True), limbs_stay=False),  # the pseudo code of 3.2.2.2; 3.2.2.4
        spin_weight=0.0,  # Eq. 3-27 is all that is minimised
        last_weight=0.0,
        rest_weight=0.0,
        facing_m=0.0,
        named=False,  # 3.2.2.1: the one-to-one assignment decides which curve is which part
        restart=RestartSettings(always=True, alone=True, backwards=-np.inf, lost_m=np.inf),  # Figure 3-22
        voxels=False,
    ),
    thesis=True,  # Tables 3-2 and 3-4
)
SWARM_PRESETS: dict[str, SwarmPreset] = {"default": SwarmPreset(), "hsiao2008": PRINTED}


@dataclass(frozen=True)
class ReadingStart:
    """The thesis's start: the skeleton fitted to the curves of a frame alone (section 3.2.2.2), of the first that can be read.

    Parameters
    ----------
    preset : SwarmPreset
    read : callable, optional
        In place of `hmc.pose.steps.swarm.step.read_view` by the preset.
    """

    preset: SwarmPreset
    read: Read | None = None

    def __call__(
        self, frame_rng: FrameRng, views: Sequence[PersonView], capture: Capture, height_m: float | None = None
    ) -> StartPose | None:
        """The thesis's body and the pose in that frame; None where no frame can be read."""
        height_m = height_m or estimate_height([view.target for view in views], capture.floor_z)
        body = thesis_body(height_m)
        model = model_of_body(body, self.preset.thesis)
        read = self.read or partial(read_view, settings=self.preset.reading)
        for k, view in enumerate(views):
            reading = read(view, height_m)
            if reading is None:
                continue
            swarm, _ = swarm_step(frame_rng(k), model, None, reading, capture.fps, view.velocity, self.preset.swarm)
            if swarm is not None:
                state = body_state(body, skeleton_landmarks(model, swarm.state))
                return StartPose(swarm_subject(body, capture, self.preset), k, state, swarm_memory(swarm))
        return None


def pso_method(preset: SwarmPreset, house: PosePreset | None = None, read: Read | None = None) -> PoseMethod:
    """Swarms as the thesis has them, or with the house's start, body, refinement, search, recovery and legs.

    Parameters
    ----------
    preset : SwarmPreset
    house : PosePreset, optional
        Whose start and refinement are used; the thesis's method alone where left out.
    read : callable, optional
        Of the thesis's method alone: what is read in a person's voxels, in place of what the preset says.
    """
    equip = partial(swarm_subject, preset=preset)
    if house is None:
        return PoseMethod(
            "pso",
            "Hsiao (2008)",
            ReadingStart(preset, read),
            as_proposed(swarmed(preset, read)),
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
        keypoints=True,
        legs=LegSettings(),
        back=BackwardSettings(house.polish),
        settings={"swarm": preset, "house": house},
    )
