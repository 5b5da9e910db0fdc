"""Named parameters of the multi-cue descent."""

from __future__ import annotations

from hmc.errors import InputError
from hmc.pose.objectives.multicue import CueSettings
from hmc.pose.steps.descent.tracker import SmdPreset
from hmc.search.meta_descent import SmdSettings

__all__ = ["SMD_PRESETS", "smd_preset"]

#: `kehl2006` has the paper's cues, counts and tolerances (section 7); `default` adds voxels that look for the body, and descends along
#: axes taken from the curvature, which needs fewer iterations.
SMD_PRESETS: dict[str, SmdPreset] = {
    "default": SmdPreset(),
    "kehl2006": SmdPreset(
        cues=CueSettings(voxel_points=0, full_edges=True, width=0.5),
        descent=SmdSettings(first_step=0.5, average=3, iterations=40, reach=20.0, by_curvature=False, averaged=False),
        predict=0.0,
        rescue=None,
    ),
}


def smd_preset(name: str) -> SmdPreset:
    """A preset by its name.

    Raises
    ------
    InputError
        When there is none of that name.
    """
    if name not in SMD_PRESETS:
        raise InputError(f"--preset {name}: of the method smd there are {', '.join(SMD_PRESETS)}")
    return SMD_PRESETS[name]
