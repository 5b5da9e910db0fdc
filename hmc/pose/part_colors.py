"""The colors of a person's parts, learnt from poses, and what they say for and against other poses.

Silhouettes do not tell an arm before the trunk from one behind it, nor a forearm from the thigh that it hangs beside. Colors do, where
clothes and skin differ: each camera has, for each kind of part of a person, how much likelier a color is there than on the person as a
whole, and a pose is borne out by the sum of the logarithms over the patches of its silhouettes. Left and right have the same colors. Ours.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from hmc.body.flesh import beyond_wrist, flesh_points, place_points
from hmc.body.kinematics import segment_transforms
from hmc.body.limbs import CHAIN_OF_PART
from hmc.body.model import PARTS, BodyModel
from hmc.camera.model import Camera, Rig
from hmc.pose.views.color_patches import N_BINS, OUTSIDE, PATCH_M, STEPS, patch_bins, patch_of_pixel, patch_shape, patch_side
from hmc.voxels.carving import pixel_of_voxel

__all__ = [
    "ColorSettings",
    "FrameColors",
    "PartColors",
    "Shown",
    "Skin",
    "count_colors",
    "frame_colors",
    "gains",
    "learn_part_colors",
    "no_counts",
    "patch_sides",
    "shown",
    "skin_of",
]

#: Kinds of parts that have colors of their own.
KINDS = ("head", "torso", "upper_arm", "forearm", "hand", "thigh", "shank")
#: In their place, skin that is another person's.
ANOTHER = -1
#: A camera has to have seen a kind of part in so many patches, or it says nothing of it.
LEAST_PATCHES = 60
#: Light and shade move colors by about so many bins.
SMOOTHING = 0.7
#: Share of a part's colors that may be any: what has never been seen there is not impossible.
ANY_SHARE = 0.05
#: A patch says no more than this for or against a part, nats: patches beside one another are of one surface.
MOST_NATS = 3.0


@dataclass(frozen=True)
class ColorSettings:
    """When colors are asked where a limb is, and what they weigh.

    Parameters
    ----------
    worst : float
        A limb is asked for in stretches of doubt (`hmc.landmarks.TRUSTED`) in which one of its joints is trusted less than this.
    learn_frames : int
        Frames of the run from which colors are learnt, at most.
    own_share, least_nats, least_patches : float, float, int
        A doubtful limb is looked for where its patches say less for it than this share of what its colors usually say. Where that is less
        than so many nats a patch, or so few patches are seen, colors tell nothing of it.
    draws, about, best : int
        Poses drawn of any kind; poses a round about the best; how many count as these.
    spreads : tuple of float
        How far about them, radians, round by round.
    weight_m2 : float
        Square metres of cost that one nat a camera outweighs.
    hand_cap_m : float
        How far outside the hull a hand counts at most, metres (`SymmetricSettings`): where colors tell where it is, silhouettes that lost
        it are not asked.
    margin_m2 : float
        What a new pose of a limb has to be cheaper by, square metres: of many that are drawn one is always a little better.
    step_weight : float
        What the squared way of a limb's joints from one frame to the next costs, at 30 frames a second: square metres a square metre.
    kept : int
        Poses of a limb, beside the one that it had, through which a path is looked for.
    apart_m : float
        How far these are from one another.
    """

    worst: float = 0.7
    learn_frames: int = 24
    own_share: float = 1.2
    least_nats: float = 0.2
    least_patches: int = 12
    draws: int = 200
    about: int = 60
    best: int = 10
    spreads: tuple[float, ...] = (0.4, 0.2, 0.1, 0.05)
    weight_m2: float = 5e-6
    hand_cap_m: float = 0.005
    margin_m2: float = 2e-5
    step_weight: float = 2e-3
    kept: int = 4
    apart_m: float = 0.03


@dataclass(frozen=True)
class Skin:
    """A body's surface, points a patch apart.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Segment's frame, metres.
    segment, kind, chain : ndarray of int, shape (n,)
        The segment that carries each, the place of its part's kind in `KINDS`, and its chain (`hmc.body.limbs.CHAIN_OF_PART`).
    """

    points: np.ndarray
    segment: np.ndarray
    kind: np.ndarray
    chain: np.ndarray

    def where(self, chosen: np.ndarray) -> Skin:
        """The chosen points: a mask, shape (n,)."""
        return Skin(self.points[chosen], self.segment[chosen], self.kind[chosen], self.chain[chosen])

    def placed(self, body: BodyModel, states: np.ndarray) -> np.ndarray:
        """The points in the world, metres, shape (..., n, 3), in poses of shape (..., 37)."""
        return place_points(*segment_transforms(body, states), self.points, self.segment)

    def of_another(self) -> Skin:
        """The same as another person's: it hides what is behind it, and its colors are not asked."""
        nobody = np.full(len(self.kind), ANOTHER)
        return Skin(self.points, self.segment, nobody, nobody)


@dataclass(frozen=True)
class FrameColors:
    """One frame's silhouettes, patch by patch, of those cameras that have both image and silhouette, by number.

    Parameters
    ----------
    sides : mapping of int to int
        Of patches, pixels.
    bins : mapping of int to ndarray of int16
        As from `hmc.pose.views.color_patches.patch_bins`.
    """

    sides: Mapping[int, int]
    bins: Mapping[int, np.ndarray]


@dataclass(frozen=True)
class Shown:
    """What one camera shows of people: patches, and the nearest skin in each.

    Parameters
    ----------
    patch : ndarray of int, shape (n,)
        Flat, rising.
    depth : ndarray, shape (n,)
        Along the camera's axis, metres.
    kind, chain : ndarray of int, shape (n,)
        Of the skin, as in `Skin`.
    point : ndarray of int, shape (n,)
        Which point of its person's skin it is.
    """

    patch: np.ndarray
    depth: np.ndarray
    kind: np.ndarray
    chain: np.ndarray
    point: np.ndarray


@dataclass(frozen=True)
class PartColors:
    """What colors say of one person's parts: the logarithm of how much likelier a bin is on a kind of part than on the whole person.

    Parameters
    ----------
    ratio : ndarray of float32, shape (n_cameras, n_kinds, n_bins)
        Nats; 0 where a camera has hardly seen the part.
    usual : ndarray of float32, shape (n_cameras, n_kinds)
        Its mean over the part's own colors, nats a patch (Kullback and Leibler, 1951): how much they tell.
    """

    ratio: np.ndarray
    usual: np.ndarray

    def said(self, camera: int, kind: np.ndarray, bins: np.ndarray) -> np.ndarray:
        """What patches of some bins say for some kinds of parts there, nats; 0 where there is no silhouette or another person."""
        return np.where((bins == OUTSIDE) | (kind == ANOTHER), np.float32(0), self.ratio[camera][kind, bins])


def skin_of(body: BodyModel) -> Skin:
    """The surface of a body; what lies beyond the wrist is hand."""
    table = flesh_points(body, PATCH_M)
    points, part = table.points[table.is_surface], table.part[table.is_surface]
    names = [name.removeprefix("l_").removeprefix("r_") for name in PARTS]
    kind = np.array([KINDS.index(name) for name in names])[part]
    kind = np.where(beyond_wrist(body, points, part), KINDS.index("hand"), kind)
    return Skin(points, table.segment[table.is_surface], kind, CHAIN_OF_PART[part])


def patch_sides(rig: Rig, place: np.ndarray) -> tuple[int, ...]:
    """Sides of the patches of all cameras, pixels, for people about a place, shape (3,), world, metres."""
    return tuple(patch_side(camera, float(place @ camera.rotation[2] + camera.translation[2])) for camera in rig)


def frame_colors(rig: Rig, images: Sequence[np.ndarray | None], masks: Sequence[np.ndarray | None], sides: Sequence[int]) -> FrameColors:
    """The patches of a frame's silhouettes, their sides as from `patch_sides`."""
    bins = {
        k: patch_bins(camera, image, mask, side)
        for k, (camera, image, mask, side) in enumerate(zip(rig, images, masks, sides, strict=True))
        if image is not None and mask is not None
    }
    return FrameColors({k: sides[k] for k in bins}, bins)


def shown(camera: Camera, side: int, people: Iterable[tuple[Skin, np.ndarray]]) -> Shown:
    """The nearest skin in each patch of one camera.

    Parameters
    ----------
    camera : Camera
    side : int
        Of its patches, pixels.
    people : iterable of (Skin, ndarray of shape (n, 3))
        All people in the frame, and where their skin is (`Skin.placed`).
    """
    skins, points = zip(*people, strict=True)
    kind, chain = (np.concatenate([getattr(skin, name) for skin in skins]) for name in ("kind", "chain"))
    point = np.concatenate([np.arange(len(skin.kind)) for skin in skins])
    patch, depth, seen = _patches(camera, side, np.concatenate(points))
    near_first = np.flatnonzero(seen)[np.argsort(depth[seen], kind="stable")]
    patches, first = np.unique(patch[near_first], return_index=True)
    nearest = near_first[first]
    return Shown(patches, depth[nearest], kind[nearest], chain[nearest], point[nearest])


def _patches(camera: Camera, side: int, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Flat patches of points, their depths, and which are seen, each of shape (...) for points of shape (..., 3)."""
    column, row, seen = pixel_of_voxel(camera, points)
    return patch_of_pixel(camera, side, row, column), points @ camera.rotation[2] + camera.translation[2], seen


def no_counts(rig: Rig) -> np.ndarray:
    """Nothing seen yet, shape (n_cameras, n_kinds, n_bins)."""
    return np.zeros((len(rig), len(KINDS), N_BINS))


def count_colors(counts: np.ndarray, camera: int, seen: Shown, bins: np.ndarray, chains: Sequence[int]) -> None:
    """Add what a camera shows of some of a person's chains to what it has shown, in place."""
    own = bins[seen.patch]
    use = (own != OUTSIDE) & (seen.kind != ANOTHER) & np.isin(seen.chain, chains)
    np.add.at(counts[camera], (seen.kind[use], own[use]), 1.0)


def learn_part_colors(counts: np.ndarray) -> PartColors:
    """What colors say of a person's parts, by how often each camera saw which on which; `counts` as from `no_counts`."""
    cubes = counts.reshape(*counts.shape[:2], STEPS, STEPS, STEPS)
    smooth = ndimage.gaussian_filter(cubes, (0, 0, SMOOTHING, SMOOTHING, SMOOTHING), mode="constant").reshape(counts.shape)
    known = counts.sum(axis=2, keepdims=True) >= LEAST_PATCHES
    likely, whole = _chances(smooth), _chances(smooth.sum(axis=1, keepdims=True))
    ratio = np.where(known, np.clip(np.log(likely / whole), -MOST_NATS, MOST_NATS), 0.0)
    return PartColors(ratio.astype(np.float32), (likely * ratio).sum(axis=2).astype(np.float32))


def _chances(counts: np.ndarray) -> np.ndarray:
    total = counts.sum(axis=-1, keepdims=True)
    return (1 - ANY_SHARE) * counts / np.where(total > 0, total, 1.0) + ANY_SHARE / N_BINS


def gains(rig: Rig, colors: PartColors, frame: FrameColors, rest: Mapping[int, Shown], limb: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """How much better colors bear out a person with a limb in some places than the person without it.

    Parameters
    ----------
    rig : Rig
    colors : PartColors
    frame : FrameColors
    rest : mapping of int to Shown
        What each camera shows without the limb.
    limb : (ndarray of shape (n, k, 3), ndarray of int, shape (k,))
        The limb's skin in n places, world, metres, and its kinds.

    Returns
    -------
    ndarray, shape (n,)
        Nats, a mean over the cameras.
    """
    points, kind = limb
    n, k = points.shape[:2]
    gained = np.zeros(n)
    for camera, others in rest.items():
        side, bins = frame.sides[camera], frame.bins[camera]
        n_patches = int(np.prod(patch_shape(rig[camera], side)))
        behind, without = np.full(n_patches, np.inf), np.zeros(n_patches, np.float32)
        behind[others.patch], without[others.patch] = others.depth, colors.said(camera, others.kind, bins[others.patch])
        patch, depth, seen = _patches(rig[camera], side, points)
        before = np.flatnonzero(seen & (depth < behind[patch]))
        cell = before // k * n_patches + patch.ravel()[before]
        first = _first_of(cell, depth.ravel()[before], n * n_patches)
        place, patch = np.divmod(cell[first], n_patches)
        gained += np.bincount(place, colors.said(camera, kind[before[first] % k], bins[patch]) - without[patch], minlength=n)
    return gained / max(1, len(rest))


def _first_of(cell: np.ndarray, depth: np.ndarray, n_cells: int) -> np.ndarray:
    """The nearest of the points in each cell that has one, the first of equals, cell by cell; both of shape (m,)."""
    least = np.full(n_cells, np.inf)
    np.minimum.at(least, cell, depth)
    nearest = np.flatnonzero(depth == least[cell])
    _, first = np.unique(cell[nearest], return_index=True)
    return nearest[first]
