"""Sparse Sampling: samples sit on voxels of a person's surface, and the person is at their weighted mean.

Source: Canton (2009), section 4.3.3. Each frame the samples are resampled by their weights, moved by a little discrete noise so that no
two share a voxel, weighted by their neighbourhoods in the hull and by the colours there, and averaged (Eq. 4.18). What differs from the
text: samples move with the person's smoothed velocity (``drift``; 0 is the thesis's), and each person's samples are seeded on the surface.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hmc.errors import InputError
from hmc.montecarlo import systematic
from hmc.tracking.appearance import similar_colors
from hmc.tracking.association import FollowingSettings
from hmc.tracking.blobs import Observation
from hmc.tracking.following import Cloud, Filtered, StepInfo, TrackerState, advance, finish, init
from hmc.tracking.region import PERSON_RADIUS_M
from hmc.tracking.surroundings import Surroundings, adapted, blocking, look_around

__all__ = ["SparseSettings", "finish", "init", "neighbourhood_counts", "pseudo_likelihood", "spread_out", "step"]

#: Bits that each of the three counts of a neighbourhood has.
COUNT_BITS = 10
#: Times that samples which fell on the same voxels may look for others.
ROUNDS = 6
#: The 26 neighbours of a voxel.
ADJACENT = np.array([step for step in np.ndindex(3, 3, 3) if step != (1, 1, 1)]) - 1


@dataclass(frozen=True)
class SparseSettings:
    """Parameters of Sparse Sampling.

    Attributes
    ----------
    samples : int
        Samples a person.
    color : bool
        Whether colours count.
    raw_share : float
        Canton's lambda: weight of the raw pseudo-likelihood; the rest is the colour's.
    radius : int
        Of the neighbourhood, voxels (26-connected, so a cube of ``2 radius + 1``); at most 4.
    solid : bool
        Whether samples in empty voxels count nothing, as in Eq. 4.15; the thesis's surface samples may lie outside.
    noise_m : float
        Samples move by up to this far along each axis; at least by one voxel.
    scouts : float
        Share of the samples that are not resampled but drawn anew from the voxels near the person. Without them (the thesis) samples
        gather where weights are highest, and legs and what lies ahead are lost.
    drift : float
        Share of the person's velocity with which the samples move.
    reach_m : float
        Canton's delta: samples further from the person's axis than this do not count.
    blocking : float
        Sharpness of the exclusion zones: ``k`` of Eq. 4.13 is this over the square of a person's radius; 0: there are none.
    keep_histogram : float
        Canton's alpha of Eq. 4.11.
    similar_share : float
        Share of the reference histogram whose colours count as the person's.
    following : FollowingSettings
    """

    samples: int = 1000
    color: bool = True
    raw_share: float = 0.8
    radius: int = 2
    solid: bool = True
    noise_m: float = 0.05
    scouts: float = 0.5
    drift: float = 1.0
    reach_m: float = 0.45
    blocking: float = 1.0
    keep_histogram: float = 0.9
    similar_share: float = 0.8
    following: FollowingSettings = field(default_factory=FollowingSettings)

    def __post_init__(self) -> None:
        if self.samples < 1:
            raise InputError(f"`samples` must be 1 or more; got {self.samples}")
        if not 1 <= self.radius <= 4:
            raise InputError(f"`radius` must be 1 to 4 voxels; got {self.radius}")


def step(
    rng: np.random.Generator, state: TrackerState, frame: int, observation: Observation | None, settings: SparseSettings | None = None
) -> tuple[TrackerState, StepInfo]:
    """One frame on.

    Parameters
    ----------
    rng : numpy.random.Generator
    state : TrackerState
    frame, observation
        As for `hmc.tracking.following.advance`; for colours the observation's views hold the images.
    settings : SparseSettings, optional

    Returns
    -------
    state : TrackerState
    info : StepInfo
    """
    settings = SparseSettings() if settings is None else settings

    def follow(state: TrackerState, predicted: np.ndarray, observation: Observation) -> Filtered:
        return _filter(rng, state, predicted, observation, settings)

    return advance(state, frame, observation, settings.following, follow)


def neighbourhood_counts(voxels: np.ndarray, codes: np.ndarray, samples: np.ndarray, radius: int) -> tuple[np.ndarray, np.ndarray]:
    """Sum of the voxels' codes in the cube around each sample, and the code of the sample's own voxel.

    Parameters
    ----------
    voxels : ndarray of int, shape (m, 3)
        No two the same.
    codes : ndarray of int, shape (m,)
    samples : ndarray of int, shape (n, 3)
        Voxels, occupied or not; at least one.
    radius : int
        The cube has ``2 radius + 1`` voxels a side.

    Returns
    -------
    sums, own : ndarray of int32, shape (n,)
        0 where nothing is occupied.
    """
    low = samples.min(axis=0) - radius
    shape = samples.max(axis=0) - low + (radius + 1)
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    moved = voxels - low
    inside = np.flatnonzero(((moved >= 0) & (moved < shape)).all(axis=1))
    volume = np.zeros(int(shape.prod()), np.int32)
    volume[moved[inside] @ strides] = codes[inside]
    runs = volume[: len(volume) - 2 * radius].copy()  # sums along z from each voxel on
    for ahead in range(1, 2 * radius + 1):
        runs += volume[ahead : len(volume) - 2 * radius + ahead]
    side = np.arange(-radius, radius + 1)
    columns = (side[:, None] * strides[0] + side * strides[1]).ravel() - radius
    places = (samples - low) @ strides
    return runs.take(places[:, None] + columns).sum(axis=1, dtype=np.int32), volume.take(places)


def pseudo_likelihood(
    samples: np.ndarray, voxels: np.ndarray, colors: np.ndarray, similar: np.ndarray | None, settings: SparseSettings
) -> np.ndarray:
    """How likely each sample is part of the person's surface (Canton, Eq. 4.19-4.21).

    Parameters
    ----------
    samples : ndarray of int, shape (n, 3)
    voxels : ndarray of int, shape (m, 3)
        The occupied voxels.
    colors : ndarray of int, shape (m,)
        Bins of their colours; negative where there is none.
    similar : ndarray of bool, shape (n_colors,), optional
        The person's colours; where left out, colours do not count.
    settings : SparseSettings
        Of which the raw share, the radius and whether samples must be solid count.

    Returns
    -------
    ndarray, shape (n,)
        0 to 1.
    """
    codes = np.ones(len(voxels), np.int32)
    if similar is not None:
        colored = np.flatnonzero(colors >= 0)
        codes[colored] += (1 << COUNT_BITS) + (similar[colors[colored]].astype(np.int32) << 2 * COUNT_BITS)
    counts, own = neighbourhood_counts(voxels, codes, samples, settings.radius)
    field = (1 << COUNT_BITS) - 1
    raw = 1 - np.abs(2 * (counts & field) / (2 * settings.radius + 1) ** 3 - 1)
    likelihood = raw
    if similar is not None:
        like = (counts >> 2 * COUNT_BITS) / np.maximum(counts >> COUNT_BITS & field, 1)
        likelihood = settings.raw_share * raw + (1 - settings.raw_share) * like
    return likelihood * (own > 0) if settings.solid else likelihood


def spread_out(rng: np.random.Generator, samples: np.ndarray) -> np.ndarray:
    """Let no two samples share a voxel: of those that do, one stays, the others look for a free one beside it or are dismissed.

    Parameters
    ----------
    rng : numpy.random.Generator
    samples : ndarray of int, shape (n, 3)

    Returns
    -------
    ndarray of int, shape (m, 3)
        At most n, all different.
    """
    low = samples.min(axis=0) - 1
    shape = samples.max(axis=0) - low + 2
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    around = ADJACENT @ strides
    wanted = (samples - low) @ strides
    home, waiting = wanted, np.arange(len(samples))
    holder = np.full(int(shape.prod()), -1)  # the sample in each voxel
    place = np.full(len(samples), -1)
    for _ in range(ROUNDS):
        empty = holder[wanted] < 0
        holder[wanted[empty]] = waiting[empty]
        held = holder[wanted] == waiting
        place[waiting[held]] = wanted[held]
        waiting = waiting[~held]
        beside = home[waiting, None] + around
        chance = rng.random(beside.shape, np.float32)
        chance[holder[beside] >= 0] = 0
        best = chance.argmax(axis=1)
        hopeful = chance[np.arange(len(waiting)), best] > 0
        waiting, wanted = waiting[hopeful], beside[hopeful, best[hopeful]]
        if waiting.size == 0:
            break
    place = place[place >= 0]
    return np.stack(np.unravel_index(place, tuple(shape)), axis=-1) + low


def _filter(
    rng: np.random.Generator, state: TrackerState, predicted: np.ndarray, observation: Observation, settings: SparseSettings
) -> Filtered:
    """Move everybody's samples by one frame."""
    size = observation.voxel_size_m
    last = np.array([track.position for track in state.tracks]).reshape(-1, 3)
    centres = last + settings.drift * (predicted - last)
    reach = settings.reach_m + settings.radius * size
    around = look_around(observation, centres, reach, settings.following.least_certain_m3, settings.color)
    positions, moved = centres.copy(), []
    for k, cloud in enumerate(state.clouds):
        samples = _propagate(rng, cloud, np.rint((centres[k] - last[k]) / size), observation, around.rows[k], settings)
        weights = _weigh(samples, k, cloud.histogram, centres, observation, around, settings)
        good = weights > 0
        moved.append((samples[good], weights[good] / max(weights.sum(), 1e-300)))
        if good.any():
            positions[k] = observation.room[0] + size * (moved[k][1] @ moved[k][0] + 0.5)
    references = [cloud.histogram for cloud in state.clouds]
    if settings.color:
        references = adapted(references, observation, around, positions, settings.keep_histogram)
    clouds = tuple(Cloud(cloud.person, *pair, reference) for cloud, pair, reference in zip(state.clouds, moved, references, strict=True))
    return Filtered(positions, np.array([len(cloud.points) > 0 for cloud in clouds], bool), clouds, around.color_s)


def _propagate(
    rng: np.random.Generator, cloud: Cloud, drift: np.ndarray, observation: Observation, rows: np.ndarray, settings: SparseSettings
) -> np.ndarray:
    """Samples in this frame, (n, 3) int: the last ones resampled and moved, or voxels of the hull where there are none."""
    if len(cloud.points) == 0:
        return observation.indices[rng.permutation(rows)[: settings.samples]]
    n_scouts = round(settings.scouts * settings.samples)
    kept = systematic(rng, cloud.weights, settings.samples - n_scouts)
    most = max(1, round(settings.noise_m / observation.voxel_size_m))
    noise = rng.integers(-most, most, (len(kept), 3), endpoint=True)
    scouts = observation.indices[rng.permutation(rows)[:n_scouts]]
    return spread_out(rng, np.concatenate([cloud.points[kept].astype(np.int64) + drift.astype(np.int64) + noise, scouts]))


def _weigh(
    samples: np.ndarray,
    k: int,
    reference: np.ndarray,
    centres: np.ndarray,
    observation: Observation,
    around: Surroundings,
    settings: SparseSettings,
) -> np.ndarray:
    """Weights of one person's samples, shape (n,): pseudo-likelihood, distance rule, exclusion zones."""
    if len(samples) == 0:
        return np.zeros(0)
    rows = around.rows[k]
    similar = similar_colors(reference, settings.similar_share) if settings.color and reference.size else None
    weights = pseudo_likelihood(samples, observation.indices[rows], around.colors[rows], similar, settings)
    places = observation.room[0] + observation.voxel_size_m * (samples + 0.5)
    weights *= np.hypot(*(places - centres[k])[:, :2].T) <= settings.reach_m
    return weights * blocking(places, np.delete(centres, k, axis=0), settings.blocking / PERSON_RADIUS_M**2)
