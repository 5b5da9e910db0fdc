"""The body's flesh as points: Canton's look-up table of voxels (section 6.5.1.1, Eq. 6.11), and samples of its surface."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from scipy import ndimage

from hmc.body.cones import cone_distance
from hmc.body.joints import SEGMENTS
from hmc.body.kinematics import segment_transforms
from hmc.body.model import PARTS, BodyModel, neutral_state
from hmc.landmarks import landmark_index

__all__ = ["FleshTable", "SurfaceSamples", "beyond_wrist", "flesh_points", "place_points", "surface_coordinates", "surface_samples"]

# The golden angle spreads points evenly around a cone.
_GOLDEN = np.pi * (3 - np.sqrt(5))


@dataclass(frozen=True)
class FleshTable:
    """Voxel centres of the fleshed body, in the frames of the segments that carry them.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Metres, segment's frame.
    segment : ndarray of int, shape (n,)
    part : ndarray of int, shape (n,)
        Place in `hmc.body.model.PARTS`.
    is_surface : ndarray of bool, shape (n,)
        A voxel of which a 6-neighbour lies outside the part.
    spacing_m : float
        Distance between voxels, metres.
    """

    points: np.ndarray
    segment: np.ndarray
    part: np.ndarray
    is_surface: np.ndarray
    spacing_m: float


@dataclass(frozen=True)
class SurfaceSamples:
    """Points on the body's surface with their outward normals, in the frames of the segments that carry them.

    Parameters
    ----------
    points, normals : ndarray, shape (n, 3)
        Metres and unit vectors, segment's frame.
    segment, part : ndarray of int, shape (n,)
    hand : ndarray of bool, shape (n,)
        Beyond the wrist.
    """

    points: np.ndarray
    normals: np.ndarray
    segment: np.ndarray
    part: np.ndarray
    hand: np.ndarray

    def where(self, chosen: np.ndarray | slice) -> SurfaceSamples:
        """The chosen samples: a mask, shape (n,), row numbers, or a slice."""
        return SurfaceSamples(*(getattr(self, field.name)[chosen] for field in fields(self)))


def flesh_points(body: BodyModel, spacing_m: float) -> FleshTable:
    """Fill the body's truncated cones with voxels, part by part, no voxel twice in a segment of a part.

    Parameters
    ----------
    body : BodyModel
    spacing_m : float
        Voxel size times Canton's density factor (Eq. 6.26), metres.

    Returns
    -------
    FleshTable
    """
    cones, columns = body.cones, []
    for part in range(len(PARTS)):
        for segment in range(len(SEGMENTS)):
            members = np.flatnonzero((cones.part == part) & (cones.segment == segment))
            if not members.size:
                continue
            ends = np.concatenate([cones.start[members], cones.end[members]])
            reach = cones.radii[members].max()
            low, high = ends.min(0) - reach - 2 * spacing_m, ends.max(0) + reach + 2 * spacing_m
            axes = [np.arange(np.floor(a / spacing_m), np.ceil(b / spacing_m) + 1) * spacing_m for a, b in zip(low, high, strict=True)]
            grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
            inside = np.zeros(grid.shape[:3], bool)
            for cone in members:
                inside |= cone_distance(cones, cone, grid) <= 0
            surface = inside & ~ndimage.binary_erosion(inside)
            columns.append((grid[inside], np.full(inside.sum(), segment), np.full(inside.sum(), part), surface[inside]))
    points, segments, parts, surface = (np.concatenate(column) for column in zip(*columns, strict=True))
    return FleshTable(points, segments, parts, surface, spacing_m)


def surface_coordinates(body: BodyModel, n: int, least: int = 8) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where on which cone the surface is sampled; independent of the dimensions, so that samples move smoothly with them.

    Samples that lie inside another cone in the neutral pose are left out, as no data can show them.

    Parameters
    ----------
    body : BodyModel
    n : int
        About how many samples; shared out by surface area.
    least : int
        At least this many a cone.

    Returns
    -------
    cone : ndarray of int, shape (m,)
    along : ndarray, shape (m,)
        0 at the start of the axis, 1 at its end.
    angle : ndarray, shape (m,)
        Radians from the cone's `across` axis.
    """
    cones = body.cones
    area = cones.lengths * cones.radii.mean((1, 2))
    counts = np.maximum(np.round(n * area / area.sum()).astype(int), least)
    cone = np.repeat(np.arange(len(counts)), counts)
    order = np.arange(cone.size) - np.repeat(np.cumsum(counts) - counts, counts)
    along = (order + 0.5) / counts[cone]
    angle = (order * _GOLDEN) % (2 * np.pi)
    samples = surface_samples(body, (cone, along, angle))
    state = neutral_state("sideways", body.limits)
    rotations, positions = segment_transforms(body, state)
    world = place_points(rotations, positions, samples.points, samples.segment)
    hidden = np.zeros(cone.size, bool)
    for other in range(len(counts)):
        segment = cones.segment[other]
        local = (world - positions[segment]) @ rotations[segment]
        hidden |= (cone_distance(cones, other, local) <= 0) & (cone != other)
    return cone[~hidden], along[~hidden], angle[~hidden]


def surface_samples(body: BodyModel, coordinates: tuple[np.ndarray, np.ndarray, np.ndarray]) -> SurfaceSamples:
    """Points of the body's surface at given coordinates (`surface_coordinates`)."""
    cones = body.cones
    cone, along, angle = coordinates
    t = along[:, None]
    radii = (1 - t) * cones.radii[cone, 0] + t * cones.radii[cone, 1]
    cos, sin = np.cos(angle), np.sin(angle)
    bases = cones.bases[cone]
    offset = (radii[:, 0] * cos)[:, None] * bases[:, 0] + (radii[:, 1] * sin)[:, None] * bases[:, 1]
    points = (1 - t) * cones.start[cone] + t * cones.end[cone] + offset
    # The gradient of the ellipse; the cone's slope tilts the normal by a few degrees only and is left out.
    normals = (cos / np.maximum(radii[:, 0], 1e-6))[:, None] * bases[:, 0] + (sin / np.maximum(radii[:, 1], 1e-6))[:, None] * bases[:, 1]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    part = cones.part[cone]
    return SurfaceSamples(points, normals, cones.segment[cone], part, beyond_wrist(body, points, part))


def beyond_wrist(body: BodyModel, points: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Which points of the flesh are of a hand: those of a forearm that lie farther out than the wrist.

    Parameters
    ----------
    body : BodyModel
    points : ndarray, shape (n, 3)
        Segment's frame, metres.
    part : ndarray of int, shape (n,)

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    out = np.full(len(PARTS), np.inf)
    for side in "rl":
        out[PARTS.index(f"{side}_forearm")] = abs(body.tips[landmark_index(f"{side}_wrist"), 1])
    return np.abs(points[:, 1]) > out[part] + 1e-6


def place_points(rotations: np.ndarray, positions: np.ndarray, points: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Carry points of segments into the world.

    Parameters
    ----------
    rotations : ndarray, shape (..., 16, 3, 3)
    positions : ndarray, shape (..., 16, 3)
        As from `hmc.body.kinematics.segment_transforms`.
    points : ndarray, shape (n, 3)
        Segment's frame.
    segment : ndarray of int, shape (n,)

    Returns
    -------
    ndarray, shape (..., n, 3)
        World, metres; float32 or float64 as `rotations`.
    """
    out = np.empty((*rotations.shape[:-3], len(points), 3), rotations.dtype)
    for index in np.unique(segment):
        members = segment == index
        out[..., members, :] = (
            points[members].astype(rotations.dtype) @ np.swapaxes(rotations[..., index, :, :], -1, -2) + positions[..., index, None, :]
        )
    return out
