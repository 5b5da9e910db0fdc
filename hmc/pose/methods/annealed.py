"""The annealed particle filters: apf, and with scalable body models shbm-apf, ddm-apf and shbm-ddm-apf. Canton (2009), chapters 3, 6, 7."""

from __future__ import annotations

from functools import partial

from hmc.body.joints import canton_limits, default_limits, stiff_limits
from hmc.pose.back_settings import BackwardSettings
from hmc.pose.legs import LegSettings, TellLegs
from hmc.pose.method import PoseMethod
from hmc.pose.recovery import Recovery
from hmc.pose.starts.window import WindowStart
from hmc.pose.steps.annealed import annealed, annealed_subject
from hmc.pose.steps.hidden.step import with_hidden_limbs
from hmc.pose.steps.polish import polished
from hmc.pose.steps.presets import PosePreset
from hmc.pose.steps.proposal import as_proposed
from hmc.pose.steps.sparing import sparing
from hmc.pose.steps.structured import structured

__all__ = ["annealed_method", "annealed_pose_step"]


def annealed_pose_step(preset: PosePreset):
    """One frame by a preset: annealed, of one body or of models of rising detail; refined; at once where a frame is as expected;
    without the limbs that nothing shows.

    Parameters
    ----------
    preset : PosePreset

    Returns
    -------
    callable
        `hmc.pose.method.PoseStep`.
    """
    propose = structured(preset) if preset.models else annealed(preset)
    if preset.refine is None:
        step = as_proposed(propose)
    elif preset.sparing is None:
        step = polished(propose, preset.polish)
    else:
        step = sparing(propose, preset.polish, preset.sparing)
    return step if preset.limbs is None else with_hidden_limbs(step, preset.limbs, preset.hull)


def annealed_method(preset: PosePreset, name: str = "apf") -> PoseMethod:
    """The method of a preset; a preset that refines also recovers lost poses and tells the legs.

    Parameters
    ----------
    preset : PosePreset
    name : str
    """
    refines = preset.refine is not None
    return PoseMethod(
        name,
        preset.source,
        start=WindowStart(preset),
        step=annealed_pose_step(preset),
        equip=partial(annealed_subject, preset=preset),
        recover=Recovery(preset) if refines else None,
        alternatives=TellLegs(preset.polish) if refines else None,
        legs=LegSettings() if refines else None,
        back=BackwardSettings(preset.polish, preset.fit_body) if refines and preset.limbs is None else None,
        keypoints=refines,
        limits={"default": default_limits, "stiff": stiff_limits, "canton": canton_limits}[preset.body](),
        settings=preset,
    )
