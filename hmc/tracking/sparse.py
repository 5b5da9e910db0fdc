"""Sparse Sampling: samples sit on voxels of a person's surface, and the person is at their weighted mean.

Source: Canton (2009), section 4.3.3. Each frame the samples are resampled by their weights, moved by a little discrete noise so that no
two share a voxel, weighted by their neighbourhoods in the hull and by the colors there, and averaged (Eq. 4.18). What differs from the
text: samples move with the person's smoothed velocity (``drift``; 0 is the thesis's), and each person's samples are seeded on the surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hmc.errors import InputError
from hmc.search import systematic
from hmc.tracking.appearance import similar_colors
from hmc.tracking.blobs import Observation
from hmc.tracking.following import advance
from hmc.tracking.method import TrackerMethod
from hmc.tracking.region import PERSON_RADIUS_M
from hmc.tracking.settings import ALIKE, CANTON_2009, FollowingSettings
from hmc.tracking.state import PersonMemory, TrackerInfo, TrackerState
from hmc.tracking.surroundings import Surroundings, blocking, look_around, looks_of
from hmc.tracking.update import FilterEstimate

__all__ = [
    "METHOD",
    "SparseSettings",
    "filter_samples",
    "neighbourhood_counts",
    "propagate",
    "pseudo_likelihood",
    "sample_likelihood",
    "spread_out",
    "step",
]

#: Bits that each of the three counts of a neighbourhood has.
COUNT_BITS = 10
#: What a colored voxel counts beside its occupancy: of another's colors, and of the person's.
CODES = np.array([1 << COUNT_BITS, (1 << COUNT_BITS) + (1 << 2 * COUNT_BITS)], np.int32)
#: Times that samples which fell on the same voxels may look for others.
ROUNDS = 6
#: The 26 neighbours of a voxel.
ADJACENT = np.random.default_rng(0).permutation([step for step in np.ndindex(3, 3, 3) if step != (1, 1, 1)]) - 1
#: The orders in which they are tried: the same round from each of them on.
TURNS = (np.arange(26)[:, None] + np.arange(26)) % 26


@dataclass(frozen=True)
class SparseSettings:
    """Parameters of Sparse Sampling.

    Attributes
    ----------
    samples : int
        Samples a person.
    color : bool
        Whether colors count.
    raw_share : float
        Canton's lambda: weight of the raw pseudo-likelihood; the rest is the color's.
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
        Share of the reference histogram whose colors count as the person's.
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
    rng: np.random.Generator, state: TrackerState, frame: int, observation: Observation | None, settings: SparseSettings
) -> tuple[TrackerState, TrackerInfo]:
    """The state after a frame, and what was found in it.

    Parameters
    ----------
    rng : numpy.random.Generator
    state : TrackerState
    frame, observation
        As for `hmc.tracking.following.advance`; for colors the observation's views hold the images.
    settings : SparseSettings

    Returns
    -------
    state : TrackerState
    info : TrackerInfo
    """

    def follow(state: TrackerState, predicted: np.ndarray, observation: Observation) -> FilterEstimate:
        last = np.array([track.position for track in state.tracks]).reshape(-1, 3)
        centres = last + settings.drift * (predicted - last)
        reach = settings.reach_m + settings.radius * observation.voxel_size_m
        around = look_around(observation, centres, reach, settings.following.least_certain_m3, settings.color)
        return filter_samples(rng, state, centres, observation, around, settings)

    return advance(state, frame, observation, settings.following, follow)


def neighbourhood_counts(
    voxels: np.ndarray, codes: np.ndarray, voxel_person: np.ndarray, samples: np.ndarray, person: np.ndarray, radius: int
) -> tuple[np.ndarray, np.ndarray]:
    """Sum of the codes of a person's voxels in the cube around each of that person's samples, and the code of the sample's own voxel.

    Parameters
    ----------
    voxels : ndarray of int, shape (m, 3)
        A person has no two the same.
    codes : ndarray of int, shape (m,)
    voxel_person : ndarray of int, shape (m,)
        Whose each voxel is.
    samples : ndarray of int, shape (n, 3)
        Voxels, occupied or not; at least one.
    person : ndarray of int, shape (n,)
        Whose each sample is, ascending.
    radius : int
        The cube has ``2 radius + 1`` voxels a side.

    Returns
    -------
    sums, own : ndarray of int32, shape (n,)
        0 where nothing is occupied.
    """
    low, shape = _boxes(samples, person, radius)
    x, y, z = voxels.T - low[:, np.minimum(voxel_person, low.shape[1] - 1)]
    inside = (x >= 0) & (x < shape[1]) & (y >= 0) & (y < shape[2]) & (z >= 0) & (z < shape[3]) & (voxel_person < shape[0])
    volume = np.zeros(int(np.prod(shape)), np.int32)
    volume[_flat(voxel_person, (x, y, z), shape)[inside]] = codes[inside]
    runs = volume[: len(volume) - 2 * radius].copy()  # sums along z from each voxel on
    for ahead in range(1, 2 * radius + 1):
        runs += volume[ahead : len(volume) - 2 * radius + ahead]
    side = np.arange(-radius, radius + 1)
    columns = ((side[:, None] * shape[2] + side) * shape[3]).ravel() - radius
    places = _flat(person, samples.T - low[:, person], shape)
    return runs.take(columns[:, None] + places).sum(axis=0, dtype=np.int32), volume.take(places)


def pseudo_likelihood(counts: np.ndarray, own: np.ndarray, settings: SparseSettings, colored: bool | np.ndarray = True) -> np.ndarray:
    """How likely each sample is part of its person's surface (Canton, Eq. 4.19-4.21).

    Parameters
    ----------
    counts : ndarray of int, shape (n,)
        In the neighbourhood: occupied voxels, plus the colored ones times ``2**10``, plus those of the person's colors times ``2**20``.
    own : ndarray of int, shape (n,)
        Whether the sample's own voxel is occupied.
    settings : SparseSettings
        Of which the raw share, the radius and whether samples must be solid count.
    colored : bool or ndarray of bool, shape (n,)
        Whether colors count.

    Returns
    -------
    ndarray, shape (n,)
        0 to 1.
    """
    field = (1 << COUNT_BITS) - 1
    likelihood = 1 - np.abs((counts & field) * (2 / (2 * settings.radius + 1) ** 3) - 1)
    if np.any(colored):
        like = (counts >> 2 * COUNT_BITS) / np.maximum(counts >> COUNT_BITS & field, 1)
        likelihood = np.where(colored, settings.raw_share * likelihood + (1 - settings.raw_share) * like, likelihood)
    return likelihood * (own > 0) if settings.solid else likelihood


def spread_out(rng: np.random.Generator, samples: np.ndarray, person: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Let no two samples of a person share a voxel: of those that do, one stays, the others look for a free one beside it or are dismissed.

    Parameters
    ----------
    rng : numpy.random.Generator
    samples : ndarray of int, shape (n, 3)
        At least one.
    person : ndarray of int, shape (n,)
        Whose each is, ascending.

    Returns
    -------
    samples : ndarray of int, shape (m, 3)
        At most n.
    person : ndarray of int, shape (m,)
    """
    low, shape = _boxes(samples, person, 1)
    home = _flat(person, samples.T - low[:, person], shape)
    around = (ADJACENT[:, 0] * shape[2] + ADJACENT[:, 1]) * shape[3] + ADJACENT[:, 2]
    wanted, waiting = home, np.arange(len(samples), dtype=np.int32)
    holder = np.full(int(np.prod(shape)), -1, np.int32)  # the sample in each voxel
    place = np.full(len(samples), -1)
    for _ in range(ROUNDS):
        empty = holder[wanted] < 0
        holder[wanted[empty]] = waiting[empty]
        held = holder[wanted] == waiting
        place[waiting[held]] = wanted[held]
        waiting = waiting[~held]
        if waiting.size == 0:
            break
        # The first free neighbour in an order that begins anywhere.
        beside = home[waiting, None] + around[TURNS[rng.integers(len(ADJACENT), size=waiting.size)]]
        free = holder[beside] < 0
        best = free.argmax(axis=1)
        lucky = free[np.arange(waiting.size), best]
        waiting, wanted = waiting[lucky], beside[lucky, best[lucky]]
    kept = np.flatnonzero(place >= 0)
    rest, z = np.divmod(place[kept], shape[3])
    rest, y = np.divmod(rest, shape[2])
    return (np.stack([rest % shape[1], y, z]) + low[:, person[kept]]).T, person[kept]


def _boxes(samples: np.ndarray, person: np.ndarray, margin: int) -> tuple[np.ndarray, tuple[int, int, int, int]]:
    """Lowest corners (3, k) of equal boxes around each person's samples, and the shape (k, nx, ny, nz) of all."""
    starts = np.searchsorted(person, np.arange(int(person[-1]) + 1))
    low = np.minimum.reduceat(samples, np.minimum(starts, len(samples) - 1), axis=0)
    high = np.maximum.reduceat(samples, np.minimum(starts, len(samples) - 1), axis=0)
    nx, ny, nz = ((high - low).max(axis=0) + (2 * margin + 1)).tolist()
    return (low - margin).T, (len(starts), nx, ny, nz)


def _flat(person: np.ndarray, cells: Sequence[np.ndarray] | np.ndarray, shape: tuple[int, int, int, int]) -> np.ndarray:
    """Where cells (x, y, z) of the persons' boxes are in the flat array of all boxes."""
    x, y, z = cells
    return ((person * shape[1] + x) * shape[2] + y) * shape[3] + z


def filter_samples(
    rng: np.random.Generator,
    state: TrackerState,
    centres: np.ndarray,
    observation: Observation,
    around: Surroundings,
    settings: SparseSettings,
) -> FilterEstimate:
    """The estimate from all persons' samples, moved by one frame and weighed: their means (Canton, Eq. 4.18).

    Parameters
    ----------
    rng : numpy.random.Generator
    state : TrackerState
    centres : ndarray, shape (k, 3)
        Where the state's tracks are expected, world, metres: the middle of the samples allowed and of the exclusion zones.
    observation : Observation
    around : Surroundings
        The voxels near each.
    settings : SparseSettings

    Returns
    -------
    FilterEstimate
    """
    n, size, origin = len(state.tracks), observation.voxel_size_m, observation.room[0]
    last = np.array([track.position for track in state.tracks]).reshape(-1, 3)
    # What is less than a voxel is owed to the next frame: at many frames a second it is all of the way.
    owed = (centres - last) / size + np.array([one.arrays.get("owed", np.zeros(3)) for one in state.memories]).reshape(-1, 3)
    moved = np.rint(owed)
    samples, person = propagate(rng, state.memories, moved, observation, around, settings)
    weights, drawn = np.zeros(0), np.bincount(person, minlength=n)
    if len(samples):
        weights = sample_likelihood(samples, person, state.memories, observation, around, settings)
        x, y = (origin[:2] + size * (samples[:, :2] + 0.5)).T
        weights *= (x - centres[person, 0]) ** 2 + (y - centres[person, 1]) ** 2 <= settings.reach_m**2
        weights *= blocking(np.stack([x, y], axis=1), person, centres, settings.blocking / PERSON_RADIUS_M**2)
        good = weights > 0
        samples, person, weights = samples[good], person[good], weights[good]
    total = np.bincount(person, weights, n)
    seen = total > 0
    weights = weights / total[person]
    efficiency = seen / np.maximum(drawn * np.bincount(person, weights**2, n), 1e-12)
    mean = np.stack([np.bincount(person, weights * column, n) for column in samples.T], axis=1)
    positions = np.where(seen[:, None], origin + size * (mean + 0.5), centres)
    looks = looks_of(observation, around, positions, settings.following) if settings.color else ()
    parts = np.split(np.arange(len(samples)), np.cumsum(np.bincount(person, minlength=n))[:-1]) if n else []
    kept = [
        {"samples": samples[part], "weights": weights[part], "owed": rest} if len(part) else {}
        for part, rest in zip(parts, owed - moved, strict=True)
    ]
    memories = tuple(PersonMemory(one.person, arrays, one.histogram) for one, arrays in zip(state.memories, kept, strict=True))
    return FilterEstimate(positions, seen, memories, looks, settings.keep_histogram, around.color_s, efficiency)


def propagate(
    rng: np.random.Generator,
    memories: tuple[PersonMemory, ...],
    drift: np.ndarray,
    observation: Observation,
    around: Surroundings,
    settings: SparseSettings,
) -> tuple[np.ndarray, np.ndarray]:
    """All persons' samples in this frame: the last ones resampled and moved, and voxels of the hull drawn anew.

    Parameters
    ----------
    rng : numpy.random.Generator
    memories : tuple of PersonMemory
    drift : ndarray, shape (k, 3)
        By how many voxels each person's samples move, whole numbers.
    observation, around, settings
        As for `filter_samples`.

    Returns
    -------
    samples : ndarray of int, shape (n, 3)
        Voxels; a person has no two the same.
    person : ndarray of int, shape (n,)
        Whose each is, ascending.
    """
    most = max(1, round(settings.noise_m / observation.voxel_size_m))
    parts = []
    for k, (memory, rows) in enumerate(zip(memories, around.rows, strict=True)):
        n_scouts = round(settings.scouts * settings.samples) if memory.arrays else settings.samples
        if n_scouts < settings.samples:
            kept = memory.arrays["samples"][systematic(rng, memory.arrays["weights"], settings.samples - n_scouts)]
            parts.append((k, kept + drift[k].astype(np.int64) + rng.integers(-most, most, kept.shape, endpoint=True)))
        parts.append((k, observation.indices[_draw(rng, rows, n_scouts)]))
    samples = np.concatenate([part for _, part in parts]) if parts else np.zeros((0, 3), np.int64)
    person = np.repeat([k for k, _ in parts], [len(part) for _, part in parts]).astype(np.int64)
    return spread_out(rng, samples, person) if len(samples) else (samples, person)


def _draw(rng: np.random.Generator, rows: np.ndarray, n: int) -> np.ndarray:
    """At most `n` of the rows, hardly any twice, one from each of n equal stretches: neighbours lie close in the list."""
    n = min(n, len(rows))
    return rows[((np.arange(n) + rng.random(n)) * (len(rows) / max(n, 1))).astype(np.int64)]


def sample_likelihood(
    samples: np.ndarray,
    person: np.ndarray,
    memories: tuple[PersonMemory, ...],
    observation: Observation,
    around: Surroundings,
    settings: SparseSettings,
) -> np.ndarray:
    """Pseudo-likelihood of all persons' samples, shape (n,).

    Parameters
    ----------
    samples, person
        As from `propagate`; at least one.
    memories : tuple of PersonMemory
    observation, around, settings
        As for `filter_samples`.

    Returns
    -------
    ndarray, shape (n,)
        0 to 1.
    """
    rows = np.concatenate(around.rows)
    codes = np.ones(len(rows), np.int32)
    known = np.array([settings.color and one.histogram.size > 0 for one in memories])
    ends = np.cumsum([len(mine) for mine in around.rows])
    for memory, mine, end in zip(memories, around.rows, ends, strict=True):
        if settings.color and memory.histogram.size:
            colors = around.colors[mine]
            similar = similar_colors(memory.histogram, settings.similar_share)
            codes[end - len(mine) : end] += np.where(colors >= 0, CODES[similar[colors].astype(np.int8)], 0)
    whose = np.repeat(np.arange(len(memories)), [len(mine) for mine in around.rows])
    counts, own = neighbourhood_counts(observation.indices[rows], codes, whose, samples, person, settings.radius)
    return pseudo_likelihood(counts, own, settings, known[person])


METHOD = TrackerMethod(
    name="sparse",
    source="Canton (2009), section 4.3.3",
    summary="Sparse Sampling, samples on the voxels of the surface",
    step=step,
    presets={
        "default": SparseSettings(),
        # "Some discrete noise" (section 4.3.3): of 5 and 10 cm the better one on the recipe `meeting_tuning`.
        "canton2009": SparseSettings(noise_m=0.1, drift=0.0, scouts=0.0, solid=False, following=CANTON_2009),
        "alike": SparseSettings(following=ALIKE),
    },
    label="SS",
    uses_colors=True,
    particles="samples",
)
