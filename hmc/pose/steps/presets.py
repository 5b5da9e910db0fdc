"""Named settings of the annealed pose filter, each with its source."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from hmc.body.dimensions import FitBodySettings
from hmc.body.joints import DOF_NAMES
from hmc.body.scalable_models import MODEL_1, MODEL_2, PRINTED_1, PRINTED_2, UNITIVE_PIECES, Inclusive
from hmc.errors import InputError
from hmc.pose.method import Capture
from hmc.pose.objectives.keypoints import KeypointSettings
from hmc.pose.objectives.symmetric import SymmetricSettings
from hmc.pose.steps.hidden.limbs import LimbSettings
from hmc.pose.steps.limb_search import SearchSettings
from hmc.pose.steps.polish import PolishSettings
from hmc.pose.steps.refine import RefineSettings
from hmc.pose.steps.sparing import SparingSettings
from hmc.search.filters import AnnealedSettings
from hmc.search.structural import StructuralSettings

__all__ = ["PRESETS", "PosePreset", "drift", "drift_of"]

# Half of the largest variation expected in a thirtieth of a second: metres for the translations, radians for the angles.
_DRIFT = {
    "root_tx": 0.05, "root_ty": 0.05, "root_tz": 0.04, "root_rz": 0.14, "root_ry": 0.10, "root_rx": 0.08,
    "torso": 0.08, "spine": 0.04, "girdle": 0.06, "neck": 0.10, "shoulder": 0.30, "elbow": 0.35, "hip": 0.20, "knee": 0.28, "ankle": 0.06,
}  # fmt: skip


def drift(fps: float) -> np.ndarray:
    """P0, the first layer's deviations: half of the largest variation expected in one frame (Canton 2009, section 3.2.2).

    Parameters
    ----------
    fps : float
        Frames a second; below 30 the variation grows in proportion, up to threefold.

    Returns
    -------
    ndarray, shape (37,)
        Metres and radians.
    """
    scale = float(np.clip(30.0 / fps, 0.5, 3.0))
    values = []
    for name in DOF_NAMES:
        key = next(key for key in _DRIFT if key in name) if name not in _DRIFT else name
        values.append(_DRIFT[key])
    return scale * np.array(values)


def drift_of(capture: Capture) -> np.ndarray:
    """P0 of a recording: its own, or that of everyday motion at its frame rate; shape (37,)."""
    return drift(capture.fps) if capture.drift is None else capture.drift


@dataclass(frozen=True)
class PosePreset:
    """Everything that decides how poses are estimated.

    Parameters
    ----------
    name : str
    source : str
        Where the numbers come from.
    body : {"default", "stiff", "canton"}
        Proportions and joint limits (`hmc.body.proportions`); stiff: the default with a trunk that does not bend.
    likelihood : {"symmetric", "factorised", "global"}
        The symmetric cost, or the four scores of Canton (2009), section 6.5.
    annealed : AnnealedSettings
    drift_scale : float
        Factor on `drift`.
    motion : {"none", "smooth", "both"}
        Where a frame's particles start: where the last frame's were; moved on as in the frame before; or half and half (Canton, section
        3.1.2.2).
    coarse_samples, hull_points : int
        Points of the body's surface, and rays and points of the hull's, in the symmetric cost, for the particles.
    surface_samples, fine_hull_points : int
        The same in the refinement.
    hull : {"tolerant", "strict"}
        The voxels that the four scores read.
    density : float
        Spacing of the flesh table over the voxel size (Canton, Eq. 6.26), for the four scores.
    symmetric : SymmetricSettings
    refine : RefineSettings or None
        Local refinement of each frame's estimate.
    search : SearchSettings or None
        Search for a limb that got lost.
    sparing : SparingSettings or None
        When a frame is as expected and needs no particles; None: all frames have some. Of the annealed filter of one body only.
    keypoints : KeypointSettings
        What a detector's keypoints weigh, where there are any.
    fit_body : FitBodySettings or None
        Fit the person's dimensions over the first frames.
    start : {"hypotheses", "spectral", "neutral"}
        Several starts with a left-right test, from typical poses or from the voxels' skeleton (`hmc.pose.starts.spectral`), or the thesis's
        neutral pose with the heading of the walk.
    models : tuple of Inclusive
        Hierarchies for structural annealing in place of `annealed`; of two, each frame has the one that suits the last pose. None by
        default.
    structural : StructuralSettings
        Where there are `models`.
    limbs : LimbSettings or None
        Limbs that the data does not show are left out and looked for.
    hierarchies : tuple of two Inclusive
        The `models` "1" and "2" of methods that have such (`hmc.pose.methods.scalable`).
    hidden_limbs : LimbSettings
        The `limbs` of methods that leave some out.
    """

    name: str
    source: str
    body: Literal["default", "stiff", "canton"] = "default"
    likelihood: Literal["symmetric", "factorised", "global"] = "symmetric"
    annealed: AnnealedSettings = field(default_factory=AnnealedSettings)
    drift_scale: float = 1.0
    motion: Literal["none", "smooth", "both"] = "none"
    coarse_samples: int = 350
    hull_points: int = 250
    surface_samples: int = 350
    fine_hull_points: int = 600
    hull: Literal["tolerant", "strict"] = "tolerant"
    density: float = 1.0
    symmetric: SymmetricSettings = field(default_factory=SymmetricSettings)
    refine: RefineSettings | None = None
    search: SearchSettings | None = None
    sparing: SparingSettings | None = None
    keypoints: KeypointSettings = field(default_factory=KeypointSettings)
    fit_body: FitBodySettings | None = None
    start: Literal["hypotheses", "spectral", "neutral"] = "neutral"
    models: tuple[Inclusive, ...] = ()
    structural: StructuralSettings = field(default_factory=StructuralSettings)
    limbs: LimbSettings | None = None
    hierarchies: tuple[Inclusive, Inclusive] = (MODEL_1, MODEL_2)
    hidden_limbs: LimbSettings = field(default_factory=LimbSettings)

    def __post_init__(self) -> None:
        if self.refine is None and (
            self.search is not None or self.sparing is not None or self.fit_body is not None or self.start != "neutral"
        ):
            raise InputError(f"preset '{self.name}': search, sparing, fit_body and several starts need `refine`")
        if self.search is not None and self.search.far_m > self.symmetric.cap_m:
            raise InputError(f"preset '{self.name}': `search.far_m` must not exceed `symmetric.cap_m`, beyond which no distance is known")
        if self.refine is not None and self.likelihood != "symmetric":
            raise InputError(f"preset '{self.name}': `refine` needs the symmetric likelihood")

    @property
    def polish(self) -> PolishSettings:
        """How its estimates are refined."""
        return PolishSettings(self.symmetric, self.fine_hull_points, self.refine or RefineSettings(), self.search, self.keypoints)


#: Strong annealing leaves particles close together whatever the data: the spread says nothing of a tracked limb.
_HIDDEN_LIMBS = LimbSettings(
    UNITIVE_PIECES,
    lost_spread_deg=0.0,
    lost_occupancy=0.4,
    lost_strict=0.7,
    lost_closeness=0.45,
    lost_inside=0.5,
    found_spread_deg=8.0,
    found_occupancy=0.7,
    found_strict=0.4,
    lost_frames=3,
    found_frames=3,
)

PRESETS: dict[str, PosePreset] = {
    "canton2009": PosePreset(
        name="canton2009",
        source="Canton (2009), 3.2.2, 6.3 to 6.7 and 7.3 to 7.5: Tables 6.1 and 6.2, 6 layers of 600 particles, survival rate .5, neutral "
        "start; 300, 500 and 300 particles in models of rising detail (Eq. 7.29); limbs lost at 15 degrees and .05, found at 5 and .7",
        body="canton",
        likelihood="factorised",
        annealed=AnnealedSettings(layers=6, particles=600, survival_rate=0.5, spread="survival"),
        # "Some tolerance is permitted" (2.2.4), of no number.
        hull="strict",
        structural=StructuralSettings(gamma=50.0, assigned=(6, 10, 6), layers=2, inner=0.5, structural=0.8, survival_rate=0.5),
        hierarchies=(PRINTED_1, PRINTED_2),
        hidden_limbs=LimbSettings(lost_spread_deg=15.0, lost_occupancy=0.05, found_spread_deg=5.0, found_occupancy=0.7),
    ),
    "default": PosePreset(
        name="default",
        source="found on rendered recordings (docs/accuracy.md): symmetric cost, strong selection, refinement, limb search, fitted body",
        annealed=AnnealedSettings(layers=4, particles=120, survival_rate=0.04, spread=0.6),
        drift_scale=0.7,
        motion="both",
        refine=RefineSettings(),
        search=SearchSettings(),
        sparing=SparingSettings(),
        fit_body=FitBodySettings(),
        start="hypotheses",
        structural=StructuralSettings(gamma=11.0, layers=2, inner=0.6, survival_rate=0.3, by_limb=True),
        hidden_limbs=_HIDDEN_LIMBS,
    ),
}
