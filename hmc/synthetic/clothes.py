"""What actors wear, and the color of every point of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.errors import InputError
from hmc.synthetic.skeleton import BONE_NAMES, PosedSkeleton

__all__ = ["PATTERNS", "Clothes", "dress"]

#: `markers` is plain, with little balls of the pattern's color on the joints (`hmc.synthetic.markers`).
PATTERNS = ("plain", "stripes", "checks", "dots", "markers")


@dataclass(frozen=True)
class Clothes:
    """What an actor wears; colors are sRGB triples in [0, 1].

    Parameters
    ----------
    shirt, trousers, skin, hair, shoes : tuple of float
    pattern : {"plain", "stripes", "checks", "dots", "markers"}
        Of the shirt.
    pattern_color : tuple of float
    sleeves, legs : {"long", "short"}
    long_hair : bool
    loose_m : float
        How far clothes stand off the body, metres.
    """

    shirt: tuple[float, float, float] = (0.16, 0.32, 0.55)
    trousers: tuple[float, float, float] = (0.25, 0.24, 0.22)
    skin: tuple[float, float, float] = (0.82, 0.62, 0.50)
    hair: tuple[float, float, float] = (0.22, 0.15, 0.10)
    shoes: tuple[float, float, float] = (0.10, 0.10, 0.11)
    pattern: str = "plain"
    pattern_color: tuple[float, float, float] = (0.85, 0.85, 0.80)
    sleeves: str = "short"
    legs: str = "long"
    long_hair: bool = False
    loose_m: float = 0.007


def dress(region: np.ndarray, vertices: np.ndarray, posed: PosedSkeleton, clothes: Clothes, rng: np.random.Generator) -> np.ndarray:
    """The color of every point of a skin: face, hair and clothes, with the folds of cloth.

    Parameters
    ----------
    region : ndarray of str, shape (n,)
        Name of the sweep that each vertex lies on, as `hmc.synthetic.physique.body_sweeps` gives it.
    vertices : ndarray, shape (n, 3)
        In the pose in which the skin is modelled, metres.
    posed : PosedSkeleton
        In that pose.
    clothes : Clothes
    rng : Generator
        Places the folds.

    Returns
    -------
    ndarray, shape (n, 3)
        Linear reflectance, BGR.
    """
    skeleton, joints = posed.skeleton, posed.joints

    def along(bone: str, below: str) -> np.ndarray:
        """Where vertices are in the frame of their side's bone, as of the left one, in lengths from it to the bone below."""
        left, right = (BONE_NAMES.index(f"{side}_{bone}") for side in "lr")
        of_left = (vertices - joints[left]) @ posed.frames[left] / skeleton.length(f"l_{below}")
        mirrored = (vertices * [1, -1, 1] - joints[right] * [1, -1, 1]) @ posed.frames[left] / skeleton.length(f"r_{below}")
        return np.where(vertices[:, 1:2] >= 0, of_left, mirrored)

    trunk_height = joints[BONE_NAMES.index("neck"), 2] - joints[0, 2]
    height = (vertices[:, 2] - joints[0, 2]) / trunk_height
    shirt = ((region == "trunk") & (height > 0.20) & (height < 0.965)) | (region == "clavicle")
    if clothes.sleeves == "long":
        shirt |= (region == "upper_arm") | (region == "forearm")
    else:
        shirt |= (region == "upper_arm") & (along("upper_arm", "forearm")[:, 1] < 0.62)
    trousers = ((region == "trunk") & (height <= 0.20)) | (region == "thigh")
    if clothes.legs == "long":
        trousers |= region == "shank"
    else:
        trousers &= (region != "thigh") | (along("thigh", "shank")[:, 2] > -0.85)
    head = vertices - joints[BONE_NAMES.index("head")]
    scalp = np.isin(region, ["head"]) & ((head[:, 2] > 0.095) | ((head[:, 0] < -0.005) & (head[:, 2] > 0.0)))
    hair = scalp | np.isin(region, ["hair", "long_hair"])
    color = np.tile(np.array(clothes.skin, float), (len(vertices), 1))
    for mask, value in (
        (shirt, clothes.shirt),
        (trousers, clothes.trousers),
        (hair, clothes.hair),
        (np.isin(region, ["foot", "toes"]), clothes.shoes),
    ):
        color[mask] = value
    color[shirt & _pattern(clothes.pattern, vertices)] = clothes.pattern_color
    color[trousers & (height > 0.165) & (height <= 0.20)] *= 0.5  # a belt
    face = (region == "head") & (head[:, 0] > 0.07)
    scale = skeleton.height_m / 1.75
    eyes = face & (np.abs(head[:, 2] - 0.040 * scale) < 0.010) & (np.abs(np.abs(vertices[:, 1]) - 0.031 * scale) < 0.014)
    mouth = face & (np.abs(head[:, 2] + 0.035 * scale) < 0.007) & (np.abs(vertices[:, 1]) < 0.024 * scale)
    color[eyes] *= 0.45
    color[mouth] *= [0.85, 0.55, 0.55]
    cloth = shirt | trousers
    folds = sum(np.sin(vertices @ rng.normal(0, 45, 3) + rng.uniform(0, 2 * np.pi)) for _ in range(6)) / 6
    linear = color[:, ::-1] ** 2.2
    return linear * np.where(cloth, 1 + 0.16 * folds, 1 + 0.04 * folds)[:, None]


def _pattern(name: str, vertices: np.ndarray) -> np.ndarray:
    if name in ("plain", "markers"):
        return np.zeros(len(vertices), bool)
    x, y, z = (np.sin(vertices[:, k] * 2 * np.pi / period) for k, period in ((0, 0.11), (1, 0.11), (2, 0.09)))
    if name == "stripes":
        return z > 0.3
    if name == "checks":
        return (x * y > 0) == (z > 0)
    if name == "dots":
        return y * z > 0.55
    raise InputError(f"pattern must be one of {', '.join(PATTERNS)}; got {name!r}")
