"""Small recordings of drawn people: ellipsoids that stand on the floor before a speckled background, with exact silhouettes."""

from pathlib import Path

import cv2
import numpy as np

from hmc.camera.model import Camera, Rig, project
from hmc.io.calibration import write_calibration

RADIUS_M, HEIGHT_M = 0.24, 1.75
#: A rectangle on the floor, beside a body at (.3, .1): x and y from, to.
SHADOW = (-0.9, 0.2), (-0.1, 0.7)


def silhouette(camera: Camera, x: float, y: float) -> np.ndarray:
    """Exact up to a pixel: the convex hull of the projected surface, (h, w) bool."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 48), np.linspace(0, np.pi, 24))
    sphere = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1).reshape(-1, 3)
    points = sphere * (RADIUS_M, RADIUS_M, HEIGHT_M / 2) + (x, y, HEIGHT_M / 2)
    uv, valid = project(camera, points)
    mask = np.zeros(camera.size[::-1], np.uint8)
    cv2.fillConvexPoly(mask, cv2.convexHull(np.rint(uv[valid]).astype(np.int32)), 1)
    return mask.view(bool)


def post(camera: Camera, x: float, y: float, height_m: float = HEIGHT_M) -> np.ndarray:
    """As `silhouette`, of an upright cylinder that stands on the floor with its whole sole, (h, w) bool."""
    angle = np.linspace(0, 2 * np.pi, 48)
    circle = np.column_stack([0.8 * RADIUS_M * np.cos(angle) + x, 0.8 * RADIUS_M * np.sin(angle) + y])
    points = np.vstack([np.column_stack([circle, np.full(48, z)]) for z in np.linspace(0, height_m, 12)])
    uv, valid = project(camera, points)
    mask = np.zeros(camera.size[::-1], np.uint8)
    cv2.fillConvexPoly(mask, cv2.convexHull(np.rint(uv[valid]).astype(np.int32)), 1)
    return mask.view(bool)


def floor_patch(camera: Camera, sides: tuple[tuple[float, float], tuple[float, float]] = SHADOW) -> np.ndarray:
    """A camera's view of a rectangle on the floor, (h, w) bool."""
    (x0, y0), (x1, y1) = sides
    uv, valid = project(camera, np.array([[x0, y0, 0], [x1, y0, 0], [x1, y1, 0], [x0, y1, 0]]))
    assert valid.all()
    view = np.zeros(camera.size[::-1], np.uint8)
    cv2.fillConvexPoly(view, np.rint(uv).astype(np.int32), 1)
    return view.view(bool)


def draw_recording(
    folder: Path, rig: Rig, frames: list[list[tuple[float, float]]], background: int = 5, silhouettes: bool = False, shape=silhouette
) -> Path:
    """Write a recording: for every frame, where each person stands (x, y)."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(1)
    write_calibration(folder / "calibration.toml", rig)
    (folder / "recording.toml").write_text("fps = 20\nroom = [[-2.0, -2.0, 0.0], [2.0, 2.0, 2.2]]\n")
    for camera in rig:
        empty = rng.integers(90, 130, (*camera.size[::-1], 3)).astype(np.uint8)
        views = [np.any([shape(camera, *place) for place in places] or [np.zeros(empty.shape[:2], bool)], axis=0) for places in frames]
        for kind, masks in (("images", views), ("background", [np.zeros_like(view) for view in views[:1]] * background)):
            for index, mask in enumerate(masks):
                image = np.where(mask[..., None], (40, 60, 200), empty) + rng.normal(0, 2, empty.shape)
                write(folder / kind / camera.name / f"{index:06d}.png", image.clip(0, 255).astype(np.uint8))
        for index, mask in enumerate(views if silhouettes else ()):
            write(folder / "silhouettes" / camera.name / f"{index:06d}.png", mask.astype(np.uint8) * 255)
    return folder


def write(path: Path, image: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), image)


def walk(n: int) -> list[list[tuple[float, float]]]:
    """One person on a straight line from (-.8, -.3) to (.8, .3)."""
    return [[(-0.8 + 1.6 * t, -0.3 + 0.6 * t)] for t in np.linspace(0, 1, n)]
