"""Draw `docs/images/hull_votes.png`: what tolerance and the rule for unseen voxels do to a visual hull.

    python docs/draw_hull_votes.py

Six cameras look at three upright cylinders; the pictures are one horizontal slice of the hull.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from hmc.camera.model import Camera, Rig, look_at, project
from hmc.voxels.carving import carve, make_tables
from hmc.voxels.grid import VoxelGrid

ROOM = np.array([[-2.2, -2.2, 1.0], [2.2, 2.2, 1.04]])
PEOPLE = {"left": (-0.7, 0.5), "middle": (0.2, 0.1), "unseen by one camera": (1.05, -0.95)}
RADIUS_M = 0.16
SIZE = (240, 60)
OUT = Path(__file__).parent / "images" / "hull_votes.png"


def make_rig() -> Rig:
    """A ring at the height of the slice; the last camera, at the bottom, sees less than the others."""
    angles, views = np.deg2rad([30, 95, 155, 205, 330, 268]), [44, 44, 44, 44, 44, 28]
    return Rig(
        tuple(
            look_at(f"cam_{c}", SIZE, [3.6 * np.cos(angle), 3.6 * np.sin(angle), 1.02], [0, 0, 1.02], view)
            for c, (angle, view) in enumerate(zip(angles, views, strict=True))
        )
    )


def silhouette(camera: Camera, people) -> np.ndarray:
    """The mask of upright cylinders, shape (h, w): columns between a cylinder's two edges."""
    mask = np.zeros(SIZE[::-1], bool)
    angles = np.linspace(0, 2 * np.pi, 200)
    for x, y in people:
        rim = np.column_stack([x + RADIUS_M * np.cos(angles), y + RADIUS_M * np.sin(angles), np.full(200, 1.02)])
        columns = np.round(project(camera, rim)[0][:, 0]).astype(int)
        mask[:, max(columns.min(), 0) : max(columns.max() + 1, 0)] = True
    return mask


def draw(ax, rig: Rig, hull: np.ndarray, title: str) -> None:
    """One slice from above, with the true people as circles."""
    (x0, y0), (x1, y1) = ROOM[:, :2]
    ax.add_patch(plt.Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, color="0.8"))
    ax.imshow(hull[:, :, 0].T, origin="lower", extent=(x0, x1, y0, y1), cmap="Blues", vmin=0, vmax=1.5)
    for place in PEOPLE.values():
        ax.add_patch(plt.Circle(place, RADIUS_M, fill=False, color="tab:orange", linewidth=1.5))
    for camera in rig:
        ax.plot(*camera.centre[:2], "s", color="0.3", markersize=5)
    narrow = rig[-1]
    for u in (-0.5, SIZE[0] - 0.5):
        ray = narrow.rotation.T @ [(u - narrow.matrix[0, 2]) / narrow.matrix[0, 0], 0, 1]
        ax.plot(*np.column_stack([narrow.centre, narrow.centre + 7 * ray])[:2], color="0.6", linewidth=0.8)
    ax.set(xlim=(-3.8, 3.8), ylim=(-3.8, 3.8), xticks=[], yticks=[])
    ax.set_title(title, fontsize=9)


def main() -> None:
    """Carve and draw."""
    rig = make_rig()
    tables = make_tables(VoxelGrid.from_room(ROOM, 0.02), rig)
    whole = [silhouette(camera, PEOPLE.values()) for camera in rig]
    faulty = [silhouette(rig[0], [place for name, place in PEOPLE.items() if name != "middle"]), *whole[1:]]
    figure, axes = plt.subplots(2, 4, figsize=(12, 6.4), layout="constrained")
    for k, (masks, what) in enumerate(((whole, "all silhouettes right"), (faulty, "one lacks the middle person"))):
        draw(axes[0, k], rig, carve(tables, masks, 0), f"strict: {what}")
        draw(axes[0, k + 2], rig, carve(tables, masks, 1), f"tolerant: {what}")
    for ax, outside in zip(axes[1], ("ignore", "carve", "keep"), strict=False):
        draw(ax, rig, carve(tables, whole, outside=outside), f'strict, outside="{outside}"')
    draw(axes[1, 3], rig, carve(tables, whole, min_views=6), 'strict, outside="ignore", min_views=6')
    figure.savefig(OUT, dpi=80)


if __name__ == "__main__":
    main()
