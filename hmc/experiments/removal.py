"""Silhouettes of which a share is taken away: whole limbs, or patches anywhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import cv2
import numpy as np

from hmc.camera.model import Rig, project
from hmc.io.masks import MaskStep
from hmc.landmarks import landmark_index

__all__ = ["LIMB_BONES", "remover"]

#: Bones of the pieces of limbs that go, outer ones before inner ones.
LIMB_BONES = (
    ("l_elbow", "l_wrist"), ("r_elbow", "r_wrist"), ("l_knee", "l_ankle"), ("r_knee", "r_ankle"),
    ("l_shoulder", "l_elbow"), ("r_shoulder", "r_elbow"), ("l_hip", "l_knee"), ("r_hip", "r_knee"),
)  # fmt: skip
#: Half of the width of what goes with a bone, and how far beyond its end (hands, feet), metres.
LIMB_RADIUS_M, BEYOND_M = 0.11, 0.18
#: Side of a patch as a share of the silhouette's height.
PATCH_SHARE = 0.12


def remover(how: Literal["limbs", "patches"], share: float, seed: int) -> Callable[[MaskStep, Rig, np.ndarray], MaskStep]:
    """What takes a share of the silhouettes' pixels away, in all cameras.

    Limbs go in an order that is the same in all frames and cameras, outer pieces first, until the share of all cameras' pixels is
    reached; a piece goes whole, so the share may be passed. Patches are others in every frame and camera.

    Parameters
    ----------
    how : {"limbs", "patches"}
    share : float
        0 to 1.
    seed : int

    Returns
    -------
    callable
        Takes a frame's silhouettes, the rig and the true joints (15, 3), metres.
    """
    rng = np.random.default_rng(seed)
    order = [*rng.permutation(4), *4 + rng.permutation(4)]

    def limbs(step: MaskStep, rig: Rig, joints: np.ndarray) -> MaskStep:
        masks = [None if mask is None else mask.copy() for mask in step.masks]
        whole = sum(int(mask.sum()) for mask in masks if mask is not None)
        for piece in order:
            if sum(int(mask.sum()) for mask in masks if mask is not None) <= (1 - share) * whole:
                break
            a, b = (joints[landmark_index(name)] for name in LIMB_BONES[piece])
            ends = np.stack([a, b + BEYOND_M * (b - a) / np.linalg.norm(b - a) * (piece < 4)])
            for camera, mask in zip(rig, masks, strict=True):
                if mask is not None:
                    uv, valid = project(camera, ends)
                    depth = np.linalg.norm(ends.mean(axis=0) - camera.centre)
                    if valid.all():
                        _erase_line(mask, uv, camera.matrix[0, 0] * LIMB_RADIUS_M / depth)
        return replace(step, masks=tuple(masks))

    def patches(step: MaskStep, rig: Rig, joints: np.ndarray) -> MaskStep:
        own = np.random.default_rng([seed, step.index])
        masks = [None if mask is None else mask.copy() for mask in step.masks]
        for mask in masks:
            if mask is None or not mask.any():
                continue
            whole, rows = int(mask.sum()), np.flatnonzero(mask.any(axis=1))
            half = max(1, round(PATCH_SHARE * (rows[-1] - rows[0] + 1) / 2))
            while mask.sum() > (1 - share) * whole:
                v, u = np.argwhere(mask)[own.integers(int(mask.sum()))]
                mask[max(v - half, 0) : v + half + 1, max(u - half, 0) : u + half + 1] = False
        return replace(step, masks=tuple(masks))

    return {"limbs": limbs, "patches": patches}[how]


def _erase_line(mask: np.ndarray, ends: np.ndarray, radius_px: float) -> None:
    """Clear what lies about a line, in place."""
    line = np.zeros(mask.shape, np.uint8)
    first, last = (tuple(np.rint(np.clip(end, -10_000, 10_000)).astype(int).tolist()) for end in ends)
    cv2.line(line, first, last, 1, max(1, round(2 * radius_px)))
    mask[line > 0] = False
