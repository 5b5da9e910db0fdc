"""What the voxels of one frame say of a body: parts, the curves that can be trusted, and where the feet point."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hmc.pose.spectral.segmentation import LimbSegmentationSettings, Segmentation, segment_body
from hmc.pose.spectral.skeleton import SkeletonSettings, equally_spaced, extract_skeletons
from hmc.pose.spectral.volume import BodyVolume, observe_volume

__all__ = ["BodyReading", "ReadingSettings", "cut_foot", "read_body", "read_parts"]


@dataclass(frozen=True)
class ReadingSettings:
    """How a frame is read.

    Parameters
    ----------
    segmentation : LimbSegmentationSettings
    skeleton : SkeletonSettings
    foot_share : float
        Length of a foot, over the stature, that is cut off the end of a leg's curve.
    longest_limb : float
        A limb's curve that is longer than this, over the stature, is that of two limbs.
    least_limb : float
        A limb's curve that is shorter than this, over the stature, says too little.
    least_curves : int
        Fewer curves, that of the trunk among them, are no body.
    named : bool
        Whether only curves with a name count for that.
    """

    segmentation: LimbSegmentationSettings = field(default_factory=LimbSegmentationSettings)
    skeleton: SkeletonSettings = field(default_factory=SkeletonSettings)
    foot_share: float = 0.085
    longest_limb: float = 0.75
    least_limb: float = 0.1
    least_curves: int = 3
    named: bool = True


@dataclass(frozen=True)
class BodyReading:
    """A frame as it was read.

    Parameters
    ----------
    segmentation : Segmentation
    curves : dict of str to ndarray, shape (nodes, 3)
        Of the parts that can be trusted, metres; limbs begin at the trunk. ``other_1`` and so on are of branches without a name.
    foot_m : float
        So much of the end of a leg's curve is the foot.
    feet : ndarray, shape (k, 3)
        From heel to toe, of each foot that was seen, metres.
    left_out : tuple of str
        Parts with a curve that is not to be trusted, and why.
    status : str
        ``"read"``, or why not.
    volume : BodyVolume or None
        The voxels; None where they are too few for a body.
    """

    segmentation: Segmentation
    curves: dict[str, np.ndarray]
    foot_m: float
    feet: np.ndarray
    left_out: tuple[str, ...]
    status: str
    volume: BodyVolume | None = None


def read_body(
    voxels: np.ndarray,
    points: np.ndarray,
    voxel_size_m: float,
    height_m: float,
    settings: ReadingSettings | None = None,
    votes: tuple[np.ndarray, np.ndarray] | None = None,
) -> BodyReading:
    """Segment a person's voxels and draw the curves.

    Parameters
    ----------
    voxels : ndarray of int, shape (n, 3)
    points : ndarray, shape (n, 3)
        Their centres, world, metres.
    voxel_size_m : float
    height_m : float
        Stature.
    settings : ReadingSettings, optional
    votes : (votes, voters), optional
        As for `hmc.pose.spectral.segmentation.segment_body`.

    Returns
    -------
    BodyReading
    """
    settings = settings or ReadingSettings()
    segmentation = segment_body(voxels, points, voxel_size_m, settings.segmentation, votes)
    return read_parts(segmentation, voxels, points, voxel_size_m, height_m, settings)


def read_parts(
    segmentation: Segmentation, voxels: np.ndarray, points: np.ndarray, voxel_size_m: float, height_m: float, settings: ReadingSettings
) -> BodyReading:
    """Draw the curves of a person's voxels whose parts are known.

    Parameters
    ----------
    segmentation : Segmentation
    voxels, points, voxel_size_m, height_m, settings
        As for `read_body`.

    Returns
    -------
    BodyReading
    """
    if segmentation.status != "segmented":
        return BodyReading(segmentation, {}, 0.0, np.zeros((0, 3)), (), segmentation.status)
    # Voxels that are apart from the body are not the person's.
    body = np.isfinite(segmentation.places).all(1)
    volume = observe_volume(voxels[body], points[body], voxel_size_m)
    found = extract_skeletons(segmentation, points, settings.skeleton)
    twice = {one.partition(" and ")[0] for one in segmentation.touching if one.endswith(" and trunk")}
    curves, left_out = {}, []
    for part, curve in found.items():
        length = float(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()) / height_m
        if part[:3] in ("arm", "leg", "oth") and "trunk" in found:
            if part in twice:
                # Its hand is at the trunk: it begins at the end that is on the limb's own side of the trunk.
                curve = _from_base(curve, found["trunk"], part)
            why = "is too long for one limb" if length > settings.longest_limb else "is too short" if length < settings.least_limb else ""
            if why:
                left_out.append(f"{part} {why}")
                continue
        curves[part] = curve
    foot_m = settings.foot_share * height_m
    feet = [cut_foot(curve, foot_m)[1] for part, curve in curves.items() if part[:3] == "leg"]
    named = [part for part in curves if part[:3] != "oth" or not settings.named]
    status = "read"
    if "trunk" not in curves:
        status = "no trunk found"
    elif len(named) < settings.least_curves:
        status = f"only {', '.join(named)} found"
    return BodyReading(segmentation, curves, foot_m, np.array(feet).reshape(-1, 3), tuple(left_out), status, volume)


def _from_base(curve: np.ndarray, trunk: np.ndarray, part: str) -> np.ndarray:
    """A limb's curve that begins at the end nearer to the upper end of the trunk, for a leg to the lower one."""
    end = trunk[-1] if part[:3] == "arm" else trunk[0]
    return curve if np.linalg.norm(curve[0] - end) <= np.linalg.norm(curve[-1] - end) else curve[::-1]


def cut_foot(curve: np.ndarray, foot_m: float) -> tuple[np.ndarray, np.ndarray]:
    """A leg's curve up to the ankle, with as many nodes, and the vector from there to its end.

    Parameters
    ----------
    curve : ndarray, shape (n, 3)
        The end at the trunk first, metres.
    foot_m : float
        Length of the foot along the curve.

    Returns
    -------
    curve : ndarray, shape (n, 3)
    foot : ndarray, shape (3,)
    """
    length = float(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum())
    cut = equally_spaced(curve, len(curve), 0.0, max(length - foot_m, 0.0))
    return cut, curve[-1] - cut[-1]
