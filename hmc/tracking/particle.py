"""The particle filter: each particle is an upright ellipsoid the size of a person, scored by how much of it is occupied and by its colors.

Source: Canton (2009), section 4.3.2, Eq. 4.8-4.13. What differs from the text: particles move with the person's smoothed velocity
(``drift``; 0 is the thesis's), and weights are raised to a power (``sharpness``; 1 is the thesis's), because an ellipsoid that is a third
off is still half full, so that the plain mean of the particles hardly leaves the last place.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hmc.errors import InputError
from hmc.search import survival_rate, systematic
from hmc.tracking.blobs import Observation
from hmc.tracking.following import advance
from hmc.tracking.method import TrackerMethod
from hmc.tracking.region import PERSON_RADIUS_M
from hmc.tracking.settings import ALIKE, CANTON_2009, FollowingSettings
from hmc.tracking.state import PersonMemory, TrackerInfo, TrackerState
from hmc.tracking.surroundings import blocking, look_around, looks_of
from hmc.tracking.update import FilterEstimate

__all__ = ["METHOD", "ParticleSettings", "color_likelihood", "overlap", "step"]

#: An ellipsoid's centre is at least so high, metres.
LEAST_HEIGHT_M = 0.2


@dataclass(frozen=True)
class ParticleSettings:
    """Parameters of the particle filter.

    Attributes
    ----------
    particles : int
        Particles a person.
    color : bool
        Whether colors count.
    raw_share : float
        Canton's lambda (Eq. 4.8); the rest is the color's.
    noise_m_s, noise_z_m_s : float
        Standard deviation of the propagation, horizontally and vertically, for a second's step; a frame's is its share. Canton's is
        proportional to the largest variation of the centroid.
    drift : float
        Share of the person's velocity with which the particles move.
    sharpness : float
        Power of the weights.
    blocking : float
        Sharpness of the exclusion zones: ``k`` of Eq. 4.13 is this over the square of a person's radius; 0: there are none.
    keep_histogram : float
        Canton's alpha of Eq. 4.11.
    following : FollowingSettings
    """

    particles: int = 200
    color: bool = True
    raw_share: float = 0.8
    noise_m_s: float = 1.0
    noise_z_m_s: float = 0.3
    drift: float = 1.0
    sharpness: float = 20.0
    blocking: float = 1.0
    keep_histogram: float = 0.9
    following: FollowingSettings = field(default_factory=FollowingSettings)

    def __post_init__(self) -> None:
        if self.particles < 1:
            raise InputError(f"`particles` must be 1 or more; got {self.particles}")


def step(
    rng: np.random.Generator, state: TrackerState, frame: int, observation: Observation | None, settings: ParticleSettings
) -> tuple[TrackerState, TrackerInfo]:
    """The state after a frame, and what was found in it.

    Parameters
    ----------
    rng : numpy.random.Generator
    state : TrackerState
    frame, observation
        As for `hmc.tracking.following.advance`; for colors the observation's views hold the images.
    settings : ParticleSettings

    Returns
    -------
    state : TrackerState
    info : TrackerInfo
    """

    def follow(state: TrackerState, predicted: np.ndarray, observation: Observation) -> FilterEstimate:
        return _filter(rng, state, predicted, observation, settings)

    return advance(state, frame, observation, settings.following, follow)


def overlap(voxels: np.ndarray, centres: np.ndarray, radii: np.ndarray, origin: np.ndarray, voxel_size_m: float) -> np.ndarray:
    """Share of each ellipsoid's voxels that are occupied (Canton, Eq. 4.9).

    Sums along z turn each ellipsoid into columns of two look-ups. A voxel belongs to an ellipsoid when its centre is in it.

    Parameters
    ----------
    voxels : ndarray of int, shape (m, 3)
        The occupied voxels, no two the same; indices that are not negative.
    centres, radii : ndarray, shape (n, 3)
        World, metres.
    origin : ndarray, shape (3,)
        Lowest corner of voxel (0, 0, 0).
    voxel_size_m : float

    Returns
    -------
    ndarray, shape (n,)
        0 to 1; 0 for an ellipsoid without a voxel.
    """
    middle = (centres - origin) / voxel_size_m - 0.5  # in voxels, from the centre of voxel (0, 0, 0)
    size = np.asarray(radii, float) / voxel_size_m
    half = int(np.ceil(size[:, :2].max())) + 1
    side = np.arange(-half, half + 1)
    first = np.floor(middle[:, :2]).astype(np.int64)
    low = np.append(first.min(axis=0) - half, 0)
    shape = np.append(first.max(axis=0) + half + 1, voxels[:, 2].max(initial=0) + 1) - low
    moved = voxels - low
    moved = moved[((moved >= 0) & (moved < shape)).all(axis=1)]
    below = np.zeros(shape + (0, 0, 1), np.int32)  # occupied voxels of a column below each height
    below[tuple((moved + (0, 0, 1)).T)] = 1
    np.cumsum(below, axis=2, out=below)

    cells = first[:, None] + side[:, None]  # (n, side, 2)
    aside = ((cells - middle[:, None, :2]) / size[:, None, :2]) ** 2
    aside = aside.astype(np.float32)
    inside = (1 - aside[:, :, None, 0]) - aside[:, None, :, 1]
    crossed = inside >= 0
    counts = np.count_nonzero(crossed, axis=(1, 2))
    reach = np.repeat(size[:, 2].astype(np.float32), counts) * np.sqrt(inside[crossed])
    height = np.repeat(middle[:, 2].astype(np.float32), counts)
    start, end = np.ceil(height - reach).astype(np.int32), np.floor(height + reach).astype(np.int32) + 1
    moved_cells = (cells - low[:2]).astype(np.int32)
    column = ((moved_cells[:, :, None, 0] * shape[1] + moved_cells[:, None, :, 1]) * (shape[2] + 1))[crossed]
    flat = below.ravel()
    top = np.int32(shape[2])
    held = flat.take(column + np.minimum(end, top).clip(0)) - flat.take(column + np.minimum(start, top).clip(0))
    ends = np.cumsum(counts)
    # Sums a particle as differences of running sums: some ellipsoids may have no column.
    held, full = (np.diff(np.append(0, np.cumsum(values))[np.append(0, ends)]) for values in (held, end - start))
    return held / np.maximum(full, 1)


def color_likelihood(points: np.ndarray, colors: np.ndarray, centres: np.ndarray, radii: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Bhattacharyya coefficient of the reference histogram and that of the colored voxels in each ellipsoid (Canton, Eq. 4.10).

    Parameters
    ----------
    points : ndarray, shape (m, 3)
        Centres of the colored voxels, world, metres.
    colors : ndarray of int, shape (m,)
        Their bins.
    centres, radii : ndarray, shape (n, 3)
        The ellipsoids.
    reference : ndarray, shape (n_colors,)
        Sums to 1.

    Returns
    -------
    ndarray, shape (n,)
        0 where an ellipsoid holds no colored voxel.
    """
    if len(points) == 0:
        return np.zeros(len(centres))
    order = np.argsort(colors, kind="stable")
    bins, starts = np.unique(colors[order], return_index=True)
    middle = centres.mean(axis=0)
    at, to, scale = points[order] - middle, centres - middle, 1 / np.asarray(radii, float) ** 2
    distance = (scale @ (at**2).T) - 2 * (to * scale) @ at.T + (to**2 * scale).sum(axis=1, keepdims=True)
    counts = np.add.reduceat(distance <= 1, starts, axis=1, dtype=np.int64)
    return (np.sqrt(counts) @ np.sqrt(reference[bins])) / np.sqrt(np.maximum(counts.sum(axis=1), 1))


def _filter(
    rng: np.random.Generator, state: TrackerState, predicted: np.ndarray, observation: Observation, settings: ParticleSettings
) -> FilterEstimate:
    """The estimate from all persons' particles, moved by one frame."""
    last = np.array([track.position for track in state.tracks]).reshape(-1, 3)
    centres = last + settings.drift * (predicted - last)
    sd = np.array([settings.noise_m_s, settings.noise_m_s, settings.noise_z_m_s]) / state.fps
    reach = 2 * PERSON_RADIUS_M + 2 * sd[0]
    around = look_around(observation, centres, reach, settings.following.least_certain_m3, settings.color)
    positions, efficiency = centres.copy(), np.zeros(len(centres))
    moved: list[dict[str, np.ndarray]] = []
    for k, memory in enumerate(state.memories):
        if memory.arrays:
            kept = systematic(rng, memory.arrays["weights"], settings.particles)
            particles = memory.arrays["points"][kept] + centres[k] - last[k]
        else:
            particles = centres[k]
        particles = particles + rng.normal(size=(settings.particles, 3)) * sd
        particles[:, 2] = np.maximum(particles[:, 2], LEAST_HEIGHT_M)
        radii = np.column_stack([np.full((len(particles), 2), PERSON_RADIUS_M), particles[:, 2]])
        rows = around.rows[k]
        weights = overlap(observation.indices[rows], particles, radii, observation.room[0], observation.voxel_size_m)
        if settings.color and memory.histogram.size:
            colored = rows[around.colors[rows] >= 0]
            like = color_likelihood(observation.points[colored], around.colors[colored], particles, radii, memory.histogram)
            weights = settings.raw_share * weights + (1 - settings.raw_share) * like
        zones = blocking(particles, np.full(len(particles), k), centres, settings.blocking / PERSON_RADIUS_M**2)
        weights = weights * zones
        best = weights.max()
        if best <= 0:
            moved.append({})
            continue
        weights = (weights / best) ** settings.sharpness
        efficiency[k] = survival_rate(weights)
        moved.append({"points": particles, "weights": weights / weights.sum()})
        positions[k] = moved[k]["weights"] @ particles
    looks = looks_of(observation, around, positions, settings.following) if settings.color else ()
    memories = tuple(PersonMemory(one.person, arrays, one.histogram) for one, arrays in zip(state.memories, moved, strict=True))
    seen = np.array([len(arrays) > 0 for arrays in moved], bool)
    return FilterEstimate(positions, seen, memories, looks, settings.keep_histogram, around.color_s, efficiency)


METHOD = TrackerMethod(
    name="particle",
    source="Canton (2009), section 4.3.2",
    summary="particle filter, each particle an ellipsoid",
    step=step,
    presets={
        "default": ParticleSettings(),
        # P is of the largest variation of a centroid in the development part (section 4.3.2): here in the recipes `train_*`, once.
        "canton2009": ParticleSettings(noise_m_s=1.6, noise_z_m_s=1.1, drift=0.0, sharpness=1.0, following=CANTON_2009),
        "alike": ParticleSettings(following=ALIKE),
    },
    label="PF",
    uses_colors=True,
    particles="particles",
)
