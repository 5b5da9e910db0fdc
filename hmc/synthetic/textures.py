"""Procedural surfaces of a room: colors as a function of the place on a wall or floor, in metres."""

from __future__ import annotations

import numpy as np

from hmc.errors import InputError

__all__ = ["TEXTURES", "color_of"]


def _hash(*cells: np.ndarray, seed: int = 0) -> np.ndarray:
    """A number in [0, 1) for each cell of an integer lattice, the same at every call."""
    h = np.full(np.broadcast(*cells).shape, seed * 7919 + 12345, np.uint32)
    for k, cell in enumerate(cells):
        h = (h ^ (np.asarray(cell).astype(np.int64).astype(np.uint32) * np.uint32(0x9E3779B1 + 2 * k))) * np.uint32(0x85EBCA6B)
        h ^= h >> np.uint32(15)
    return (h * np.uint32(0xC2B2AE35) >> np.uint32(8)).astype(float) / 2**24


def _noise(u: np.ndarray, v: np.ndarray, period: float, seed: int) -> np.ndarray:
    """Smooth noise in [-1, 1]: bilinear between lattice values, with smooth steps."""
    u, v = u / period, v / period
    i, j = np.floor(u), np.floor(v)
    s, t = u - i, v - j
    s, t = s * s * (3 - 2 * s), t * t * (3 - 2 * t)
    corner = [[_hash(i + a, j + b, seed=seed) for b in (0, 1)] for a in (0, 1)]
    return 2 * ((corner[0][0] * (1 - s) + corner[1][0] * s) * (1 - t) + (corner[0][1] * (1 - s) + corner[1][1] * s) * t) - 1


def _plaster(u, v, seed):
    return 1 + 0.02 * _noise(u, v, 0.9, seed) + 0.025 * _noise(u, v, 0.05, seed + 1) + 0.015 * _noise(u, v, 0.02, seed + 2)


def _wallpaper(u, v, seed):
    stripe = np.where(np.mod(u, 0.18) < 0.09, 1.0, 0.86)
    du, dv = np.mod(u + 0.045, 0.09) - 0.045, np.mod(v + 0.09 * np.mod(np.floor((u + 0.045) / 0.09), 2) / 2, 0.12) - 0.06
    return np.where(du**2 + (0.6 * dv) ** 2 < 0.014**2, 0.72, stripe) * (1 + 0.01 * _noise(u, v, 0.03, seed))


def _brick(u, v, seed):
    row = np.floor(v / 0.075)
    shifted = u + 0.12 * np.mod(row, 2)
    column = np.floor(shifted / 0.24)
    mortar = (np.mod(v, 0.075) < 0.010) | (np.mod(shifted, 0.24) < 0.010)
    return np.where(mortar, 1.12, 0.80 + 0.25 * _hash(row, column, seed=seed)) * (1 + 0.06 * _noise(u, v, 0.02, seed))


def _tiles(u, v, seed):
    i, j = np.floor(u / 0.4), np.floor(v / 0.4)
    joint = (np.mod(u, 0.4) < 0.006) | (np.mod(v, 0.4) < 0.006)
    return np.where(joint, 0.7, 0.93 + 0.10 * _hash(i, j, seed=seed)) * (1 + 0.03 * _noise(u, v, 0.06, seed))


def _wood(u, v, seed):
    plank = np.floor(v / 0.11)
    shifted = u + 1.7 * _hash(plank, plank, seed=seed)
    board = np.floor(shifted / 1.1)
    joint = (np.mod(v, 0.11) < 0.004) | (np.mod(shifted, 1.1) < 0.004)
    grain = _noise(u * 0.12, v, 0.012, seed) * 0.07 + _noise(u * 0.2, v, 0.03, seed + 1) * 0.05
    return np.where(joint, 0.6, 0.80 + 0.30 * _hash(plank, board, seed=seed + 2) + grain)


def _carpet(u, v, seed):
    return 1 + 0.16 * _noise(u, v, 0.025, seed) + 0.08 * _noise(u, v, 0.08, seed + 1)


def _plain(u, v, seed):
    return 1 + 0.012 * _noise(u, v, 0.8, seed)


TEXTURES = {
    "plain": _plain, "plaster": _plaster, "wallpaper": _wallpaper, "brick": _brick, "tiles": _tiles, "wood": _wood, "carpet": _carpet,
}  # fmt: skip


def color_of(texture: str, color: tuple[float, float, float], u: np.ndarray, v: np.ndarray, seed: int) -> np.ndarray:
    """Linear reflectance, BGR, of places (u, v) on a surface.

    Parameters
    ----------
    texture : str
        A name of `TEXTURES`.
    color : tuple of float
        Base color, sRGB in [0, 1].
    u, v : ndarray, shape (n,)
        Along the surface, metres.
    seed : int
        Sets the pattern apart from that of other surfaces.

    Returns
    -------
    ndarray, shape (n, 3)

    Raises
    ------
    InputError
        For an unknown texture.
    """
    if texture not in TEXTURES:
        raise InputError(f"texture {texture!r} is unknown; use one of {', '.join(TEXTURES)}")
    base = np.array(color, float)[::-1] ** 2.2
    return np.clip(base * TEXTURES[texture](u, v, seed)[:, None], 0, 1)


def poster_color(u: np.ndarray, v: np.ndarray, seed: int) -> np.ndarray:
    """A poster of colored fields, (u, v) in [0, 1): linear reflectance, BGR, (n, 3)."""
    i, j = np.floor(u * 4), np.floor(v * 5)
    return np.stack([0.05 + 0.6 * _hash(i, j, seed=seed + k) for k in range(3)], axis=-1)
