"""What the tracker sees of every frame, computed once for all runs on a recording: voxels, components, silhouettes.

The thesis computes its components beforehand too, as they take most of the time (Canton 2009, section 4.4.3, track creation).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hmc.experiments.engine.inputs import Inputs, once
from hmc.io.door import kept_arrays
from hmc.io.recording import Recording
from hmc.tracking.blobs import Observation, blob_features
from hmc.tracking.resumable import observe_step, person_grid
from hmc.tracking.views import FrameViews
from hmc.voxels.grid import VoxelGrid

__all__ = ["observations"]


def observations(inputs: Inputs, label: str, voxel_m: float) -> Iterator[tuple[int, Observation | None]]:
    """Frame numbers and what is seen, in order, without images; None where the frame tells nothing.

    Parameters
    ----------
    inputs : Inputs
    label : str
        Of the recording.
    voxel_m : float
        Side of the voxels, metres.
    """
    recording = inputs.recording(label)
    grid = person_grid(recording, voxel_m)
    path = inputs.folder / label / f"observations-{1000 * voxel_m:g}mm"
    folder = once(path, lambda part: _write(part, inputs, label, recording, voxel_m))
    for file in sorted(folder.glob("*.npz")):
        with kept_arrays(file) as seen:
            one = _observation(seen, recording, grid) if seen else None
        yield int(file.stem), one


def _observation(seen: dict[str, np.ndarray], recording: Recording, grid: VoxelGrid) -> Observation:
    indices, labels = seen["indices"].astype(np.int64), seen["labels"].astype(np.int64)
    points = grid.centres(indices)
    blobs = blob_features(points, labels, int(labels.max(initial=-1)) + 1, grid.voxel_size_m)
    views = FrameViews(recording.rig, tuple(_mask(seen, c, camera.size) for c, camera in enumerate(recording.rig)))
    return Observation(grid.voxel_size_m, grid.bounds, indices, points, labels, blobs, seen["certain"], views)


def _write(folder: Path, inputs: Inputs, label: str, recording: Recording, voxel_m: float) -> None:
    grid = person_grid(recording, voxel_m)
    folder.mkdir()
    for hull in inputs.hulls(label, voxel_m):
        one, kept = observe_step(recording, grid, hull), {}
        if one is not None:
            kept = {"indices": one.indices.astype(np.int16), "labels": one.labels.astype(np.int32), "certain": one.certain}
            kept |= {f"mask_{c}": np.packbits(mask) for c, mask in enumerate(hull.masks) if mask is not None}
        np.savez(folder / f"{hull.index:08d}.npz", **kept)  # type: ignore[arg-type]


def _mask(seen: dict[str, np.ndarray], camera: int, size: tuple[int, int]) -> np.ndarray | None:
    bits = seen.get(f"mask_{camera}")
    return None if bits is None else np.unpackbits(bits, count=size[0] * size[1]).astype(bool).reshape(size[1], size[0])
