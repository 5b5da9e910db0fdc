"""Where a camera's images stir: people who stay where they are breathe and sway, which shows along their outlines; furniture does not.

Light that changes is no motion: shadows and lamps change large places evenly, so only what differs from its own surroundings counts.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from hmc.camera.people_cut import disc

__all__ = ["stirring"]

#: Widths in pixels of an image whose longer side is 320: of the surroundings that a pixel is compared with, and of the margin around
#: people who move, which tells nothing.
AROUND_PX = 9
MARGIN_PX = 7
#: Deviations over time count in full from so many times that of a typical pixel on, and from so many grey levels at least.
FULL, LEAST = 3.0, 2.0
#: Images in which a place must be free of people who move for its deviation to be known.
FEWEST = 5


def stirring(images: Sequence[np.ndarray], people: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """How much each pixel changes over time beyond the noise, beside people who move.

    Parameters
    ----------
    images : sequence of ndarray of uint8, shape (height, width, 3)
        Small ones of one camera, spread over a time; some 320 pixels are enough.
    people : sequence of ndarray of bool, shape (height, width)
        One an image: people who are known already, before whom or behind whom nothing tells.

    Returns
    -------
    amount : ndarray of float32, shape (height, width)
        From 0, as still as the noise lets be known, to 1.
    known : ndarray of bool, shape (height, width)
        Where enough images are free of people.
    """
    total, square = np.zeros((2, *images[0].shape), np.float32)
    count = np.zeros(images[0].shape[:2], np.float32)
    for image, mask in zip(images, people, strict=True):
        free = 1 - cv2.dilate(mask.view(np.uint8), disc(mask, MARGIN_PX)).astype(np.float32)
        side = len(disc(mask, AROUND_PX))
        detail = (image - cv2.blur(image.astype(np.float32), (side, side))) * free[..., None]
        total += detail
        square += detail * detail
        count += free
    n = np.maximum(count, 2)[..., None]
    deviation = np.sqrt(np.maximum(square - total * total / n, 0) / (n - 1)).max(axis=2)
    known = count >= FEWEST
    if not known.any():
        return np.zeros_like(deviation), known
    noise = float(np.median(deviation[known]))
    deviation = cv2.blur(np.where(known, deviation, 0), (3, 3))
    return np.clip(deviation / max(FULL * noise, LEAST), 0, 1) ** 2, known
