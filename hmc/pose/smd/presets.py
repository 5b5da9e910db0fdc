"""Named parameters of the multi-cue descent."""

from __future__ import annotations

from hmc.errors import InputError
from hmc.pose.smd.cues import CueSettings
from hmc.pose.smd.descent import SmdSettings
from hmc.pose.smd.tracker import SmdPreset

__all__ = ["SMD_PRESETS", "smd_preset"]

#: `kehl2006` has the paper's cues, counts and tolerances (section 7); `default` adds voxels that look for the
#: body, and takes more iterations.
SMD_PRESETS: dict[str, SmdPreset] = {
    "default": SmdPreset(),
    "kehl2006": SmdPreset(
        cues=CueSettings(voxel_points=0, full_edges=True, width=0.5),
        descent=SmdSettings(meta_step=0.1, iterations=40),
        tolerance_m=0.02,
        tolerance_deg=2.0,
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
