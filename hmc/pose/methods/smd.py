"""Multi-cue descent: Kehl and Van Gool's tracker, and the same in the house's company. Kehl (2006)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from hmc.pose.back_settings import BackwardSettings
from hmc.pose.legs import LegSettings, TellLegs
from hmc.pose.method import Capture, FrameRng, PoseMethod, StartPose, make_subject, other_rng
from hmc.pose.objectives.multicue import CueSettings
from hmc.pose.recovery import Recovery
from hmc.pose.starts.da_vinci import find_da_vinci
from hmc.pose.starts.settle import FirstPose, begin
from hmc.pose.starts.window import WindowStart
from hmc.pose.steps.descent.step import descended, solid_subject, with_colors
from hmc.pose.steps.descent.tracker import SmdPreset
from hmc.pose.steps.polish import polished
from hmc.pose.steps.presets import PRESETS, PosePreset
from hmc.pose.steps.proposal import as_proposed
from hmc.pose.views.person_view import PersonView
from hmc.search.meta_descent import SmdSettings

__all__ = ["SMD_PRESETS", "DaVinciStart", "smd_method"]

#: Of the random numbers with which a first pose settles.
SETTLING = 1
NEEDS = frozenset({"hulls", "skin"})


#: `kehl2006` has what the paper prints: 60 and 20 surface points and 10 contour points a limb in three views, edges from the start, n = 3,
#: at most 40 iterations, lambda = .3, mu a tenth of the first step sizes, tolerances of 2 degrees and 2 cm and half of that (sections 6.2
#: and 7), the last state as the result, no prediction, no search. Of what it does not print, these are named here: nu of Eq. 9 (`width`),
#: and first step sizes, in shares of the inverse curvature. The printed ones, 2500 to 10,000, depend on w_s and w_e, which are not printed;
#: with those here the body leaves the person (docs/multi-cue.md). `reach` and `growth` are ours: without them one step may throw the body
#: out of the room, and step sizes overflow.
#: `default` adds voxels that look for the body, and descends along axes taken from the curvature, which needs fewer iterations.
SMD_PRESETS: dict[str, SmdPreset] = {
    "default": SmdPreset(),
    "kehl2006": SmdPreset(
        cues=CueSettings(voxel_points=0, full_edges=True, width=0.5),
        descent=SmdSettings(first_step=0.5, average=3, iterations=40, reach=20.0, by_curvature=False, averaged=False),
        predict=0.0,
        rescue=None,
    ),
}


@dataclass(frozen=True)
class DaVinciStart:
    """The paper's start: the first frame of the window in which the person stands as da Vinci's man does (section 6.3).

    Parameters
    ----------
    preset : SmdPreset
    otherwise : WindowStart
        Where no frame shows that. The paper says nothing of it: this is ours.
    """

    preset: SmdPreset
    otherwise: WindowStart = field(default_factory=lambda: WindowStart(replace(PRESETS["default"], start="spectral")))

    def __call__(
        self, frame_rng: FrameRng, views: Sequence[PersonView], capture: Capture, height_m: float | None = None
    ) -> StartPose | None:
        """The body and the first pose; without da Vinci's, the waist of what is found is taken into the trunk, as the body has none."""
        for k, view in enumerate(views):
            spread = None if view.skin is None else find_da_vinci(view.skin.points, capture.voxel_size_m, capture.floor_z, height_m)
            if spread is None:
                continue
            first = FirstPose(k, spread.body, spread.state)
            seen, targets = [one.skin for one in views], [one.target for one in views]
            tracker, settled = begin(other_rng(frame_rng(k), SETTLING), self.preset, first, seen, targets, height_m is not None)
            return StartPose(make_subject(tracker.body.skeleton, capture), k, settled.state, with_colors(settled.colors))
        started = self.otherwise(frame_rng, views, capture, height_m)
        if started is None:
            return None
        state = started.state.copy()
        state[3] += 0.5 * state[8]  # half of the waist's twist: hips and shoulders are off by as much
        state[6:9] = 0.0
        return replace(started, state=state)


def smd_method(preset: SmdPreset, house: PosePreset | None = None, without_da_vinci: PosePreset | None = None) -> PoseMethod:
    """The descent as the paper has it, or with the house's start, refinement, search, recovery and legs.

    Parameters
    ----------
    preset : SmdPreset
    house : PosePreset, optional
        Whose start and refinement are used; the paper's method alone where left out.
    without_da_vinci : PosePreset, optional
        Of the paper's method alone: whose start is used where nobody stands as da Vinci's man does.
    """
    equip = partial(solid_subject, preset=preset)
    if house is None:
        start = DaVinciStart(preset) if without_da_vinci is None else DaVinciStart(preset, WindowStart(without_da_vinci))
        settings = {"descent": preset, "without_da_vinci": start.otherwise.preset}
        return PoseMethod("smd", "Kehl and Van Gool (2006)", start, as_proposed(descended()), NEEDS, equip, settings=settings)
    return PoseMethod(
        "smd",
        "Kehl and Van Gool (2006), section 6; start, refinement, search and recovery are the house's",
        start=WindowStart(house),
        step=polished(descended(), house.polish),
        needs=NEEDS,
        equip=equip,
        recover=Recovery(house),
        alternatives=TellLegs(house.polish),
        legs=LegSettings(),
        back=BackwardSettings(house.polish),
        keypoints=True,
        settings={"descent": preset, "house": house},
    )
