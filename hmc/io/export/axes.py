"""Our axes (z up) as those of other programs; both are turns, so that left stays left."""

from __future__ import annotations

import numpy as np

__all__ = ["FACING_X", "FACING_Z"]

#: To x forward, y up, z to the right: OpenSim's axes and the ISB's. Rows are the new axes: (x, y, z) becomes (x, z, -y).
FACING_X = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
#: To z forward, y up, x to the left: glTF's axes, and those of most BVH files. (x, y, z) becomes (y, z, x).
FACING_Z = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
