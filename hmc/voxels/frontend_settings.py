"""Parameters of the chain from images to hulls."""

from __future__ import annotations

from dataclasses import dataclass, field

from hmc.camera.segmentation import SegmentationSettings
from hmc.errors import InputError

__all__ = ["FrontendSettings"]

SOURCES = ("auto", "silhouettes", "background", "median")


@dataclass(frozen=True)
class FrontendSettings:
    """Parameters of the chain from images to hulls.

    Attributes
    ----------
    segmentation : SegmentationSettings
    source : {"auto", "silhouettes", "background", "median"}
        Where the silhouettes come from; a source other than "auto" must be there.
    background_frames : int
        At most this many frames of the empty scene are learnt from.
    median_frames, median_span_s : int, float
        Images of which the median is taken, and the time, around the selection, over which they are spread, seconds.
    ask_floor : bool
        Whether pixels that may be a shadow are told by how dark the other cameras see the floor behind (`hmc.voxels.floor_light`).
    complete : bool
        Whether cameras decide one another's doubtful pixels (`hmc.voxels.completion`).
    cut_shadows : bool
        Whether shadows on the floor, on which cameras agree, leave the silhouettes (`hmc.voxels.floor_shadows`).
    tolerance : int
        Cameras that may miss a voxel of the tolerant hull. Used where four cameras or more have a silhouette; with fewer, the tolerant
        hull is the strict one.
    outside : {"ignore", "carve", "keep"}
        What a camera says of a voxel that it does not see (`hmc.voxels.carving`).
    min_views : int, optional
        Cameras that must see a voxel (`hmc.voxels.carving.carve`).
    threads : int
        Threads over which cameras are spread; 0: as many as there are processors. The result does not depend on it.
    exclude : bool
        Whether silhouettes of a camera are left out while it does not fit the others (`hmc.voxels.watch`); else it is only told.
    """

    segmentation: SegmentationSettings = field(default_factory=SegmentationSettings)
    source: str = "auto"
    background_frames: int = 200
    median_frames: int = 20
    median_span_s: float = 60.0
    ask_floor: bool = True
    complete: bool = True
    cut_shadows: bool = True
    tolerance: int = 1
    outside: str = "ignore"
    min_views: int | None = None
    threads: int = 0
    exclude: bool = True

    def __post_init__(self) -> None:
        if self.source not in SOURCES:
            raise InputError(f"`source` must be one of {', '.join(SOURCES)}; got {self.source!r}")
