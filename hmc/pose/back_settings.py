"""What the second pass does (`hmc.pose.backward`)."""

from __future__ import annotations

from dataclasses import dataclass, field

from hmc.body.dimensions import FitBodySettings
from hmc.pose.anew import AnewSettings
from hmc.pose.part_colors import ColorSettings
from hmc.pose.steps.polish import PolishSettings
from hmc.pose.turned import TurnedSettings

__all__ = ["BackwardSettings"]


@dataclass(frozen=True)
class BackwardSettings:
    """What the second pass does.

    Parameters
    ----------
    polish : PolishSettings
        How poses are refined and lost limbs looked for.
    fit_body : FitBodySettings or None
        How the body is fitted anew; None: it stays.
    body_frames : int
        Frames to which it is fitted, at most.
    hidden_places, own_rays, standing_feet : bool
        False, to see what each is for: nothing is learnt of what furniture hides; rays that another's pose covers ask all the same; feet
        that stand are not held to the floor.
    anew : AnewSettings or None
        Where a pose is looked for anew (`hmc.pose.anew`); None: nowhere.
    turned : TurnedSettings or None
        When somebody was followed the wrong way round (`hmc.pose.turned`); None: never.
    colors : ColorSettings or None
        Which limbs are looked for by the colors of the person's parts (`hmc.pose.limb_colors`); None: none.
    smooth_s : float or None
        The time over which the poses are smoothed in the end, seconds (`hmc.motion.smoothing.local_polynomial`); None: they are not.
    """

    polish: PolishSettings
    fit_body: FitBodySettings | None = field(default_factory=FitBodySettings)
    body_frames: int = 20
    hidden_places: bool = True
    own_rays: bool = True
    standing_feet: bool = True
    anew: AnewSettings | None = field(default_factory=AnewSettings)
    turned: TurnedSettings | None = field(default_factory=TurnedSettings)
    colors: ColorSettings | None = field(default_factory=ColorSettings)
    smooth_s: float | None = 0.2
