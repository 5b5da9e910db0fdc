"""Pictures of each stage, with matplotlib: silhouettes, rig, voxels, stick figures, bodies, tracks, errors.

Every function takes ``ax=None``, draws into a new figure of its own if there is none, and returns the axes. The rig has its own module,
`hmc.camera.rig_picture`, whose functions are here too. Videos are the business of `hmc.view`, which draws quicker and plainer.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LightSource
from matplotlib.ticker import MultipleLocator
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from hmc.body.model import PARTS, BodyModel
from hmc.camera.model import Camera
from hmc.camera.rig_picture import draw_rig, draw_view
from hmc.io.results import TrackTable
from hmc.landmarks import BONES, LANDMARKS, landmark_index
from hmc.view.mosaic import Person
from hmc.view.mosaic import draw_people as _draw_people_into
from hmc.view.overlay import LEFT, RIGHT, cone_rings, draw_keypoints, person_color
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.surface import surface

__all__ = [
    "draw_body", "draw_errors", "draw_mask", "draw_overlay", "draw_rig", "draw_scores", "draw_sticks", "draw_tracks", "draw_view",
    "draw_voxels",
]  # fmt: skip

#: The six faces of a cube: outward direction, and its corners, in units of its side.
FACES = (
    ((1, 0, 0), ((1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1))),
    ((-1, 0, 0), ((0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0))),
    ((0, 1, 0), ((0, 1, 0), (0, 1, 1), (1, 1, 1), (1, 1, 0))),
    ((0, -1, 0), ((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1))),
    ((0, 0, 1), ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))),
    ((0, 0, -1), ((0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0))),
)
LIGHT = LightSource(azdeg=225, altdeg=40)

#: Landmarks whose errors share a curve.
GROUPS = {
    "trunk and head": ("pelvis", "neck", "head_top"),
    "arms": ("l_shoulder", "l_elbow", "l_wrist", "r_shoulder", "r_elbow", "r_wrist"),
    "legs": ("l_hip", "l_knee", "l_ankle", "r_hip", "r_knee", "r_ankle"),
}


def draw_mask(image: np.ndarray | None, mask: np.ndarray, ax: Axes | None = None, title: str = "") -> Axes:
    """Tint a silhouette over its image, and draw its edge.

    Parameters
    ----------
    image : ndarray, shape (h, w, 3), uint8 BGR, or None
        Without one, the silhouette stands before black.
    mask : ndarray of bool, shape (h, w)
    ax : Axes, optional
    title : str
    """
    ax = _flat_axes(ax)
    tint = np.array([255, 150, 40])
    base = np.zeros((*mask.shape, 3)) if image is None else image[..., ::-1].astype(float)
    picture = np.where(mask[..., None], 0.55 * base + 0.45 * tint, 0.75 * base)
    ax.imshow(picture.astype(np.uint8))
    if mask.any() and not mask.all():
        ax.contour(mask, levels=[0.5], colors=[tint / 255], linewidths=0.8)
    return _as_picture(ax, title)


def draw_overlay(
    camera: Camera,
    image: np.ndarray,
    people: Sequence[Person],
    ax: Axes | None = None,
    outlines: bool = True,
    keypoints: np.ndarray | None = None,
) -> Axes:
    """Draw people over a camera's image, as `hmc view` does.

    Parameters
    ----------
    camera : Camera
    image : ndarray, shape (h, w, 3), uint8 BGR
        Not changed.
    people : sequence of Person
        As from `hmc.view.mosaic.people_in`.
    ax : Axes, optional
    outlines : bool
        Draw the flesh too, where it is known.
    keypoints : ndarray, shape (n_people, 26, 3), optional
        What a 2-D detector found in this image (`hmc.io.keypoints.KeypointSource.frame`).
    """
    picture = image.copy()
    _draw_people_into(picture, camera, list(people), outlines)
    if keypoints is not None:
        draw_keypoints(picture, keypoints)
    ax = _flat_axes(ax)
    ax.imshow(picture[..., ::-1])
    return _as_picture(ax, camera.name)


def draw_voxels(
    grid: VoxelGrid, occupied: np.ndarray, colors: np.ndarray | None = None, ax: Axes3D | None = None, alpha: float = 1.0
) -> Axes3D:
    """Draw a volume in 3-D as shaded cubes.

    Parameters
    ----------
    grid : VoxelGrid
    occupied : ndarray of bool, shape (nx, ny, nz)
    colors : ndarray, shape (n_surface, 3), uint8 BGR, optional
        Of the surface voxels, in the order of `hmc.voxels.surface.surface`; plain grey without.
    ax : Axes (3-D), optional
    alpha : float
        Opacity; below 1, what lies inside shows through.
    """
    ax, had_data = _room_axes(ax)
    indices = surface(occupied)
    base = np.full((len(indices), 3), [0.72, 0.77, 0.84]) if colors is None else colors[:, ::-1] / 255.0
    padded = np.pad(occupied, 1)
    polygons, shades = [], []
    for direction, corners in FACES:
        bare = ~padded[tuple((indices + 1 + direction).T)]
        polygons.append(grid.origin + grid.voxel_size_m * (indices[bare, None] + np.array(corners)))
        shades.append(base[bare] * _brightness(np.array(direction)))
    faces = np.concatenate(polygons) if polygons else np.zeros((0, 4, 3))
    ax.add_collection3d(Poly3DCollection(faces, facecolors=np.clip(np.concatenate(shades), 0, 1), edgecolors="none", alpha=alpha))
    return _fit(ax, faces.reshape(-1, 3), had_data)


def draw_sticks(points: np.ndarray, ax: Axes3D | None = None, person: int = 0, label: str = "", color=None, width: float = 2.5) -> Axes3D:
    """Draw stick figures in 3-D: left limbs orange, right limbs blue, the trunk in the person's color.

    Parameters
    ----------
    points : ndarray, shape (15, 3) or (n, 15, 3)
        Landmarks, world, metres; bones with a missing (NaN) end are left out.
    ax : Axes (3-D), optional
    person : int
        Number that decides the trunk's color.
    label : str
        For a legend.
    color : matplotlib color, optional
        One for everything, as for the truth beside an estimate.
    width : float
        Of a bone, points.
    """
    ax, had_data = _room_axes(ax)
    figures = np.asarray(points, float).reshape(-1, len(LANDMARKS), 3)
    ends = np.array([[landmark_index(a), landmark_index(b)] for a, b in BONES])
    lines = figures[:, ends].reshape(-1, 2, 3)
    limb = [{"l_": LEFT, "r_": RIGHT}.get(b[:2], person_color(person)) for _, b in BONES]
    colors = [_rgb(bgr) if color is None else color for bgr in limb] * len(figures)
    known = ~np.isnan(lines).any(axis=(1, 2))
    shown = [line_color for line_color, is_known in zip(colors, known, strict=True) if is_known]
    ax.add_collection3d(Line3DCollection(lines[known], colors=shown, linewidths=width, capstyle="round"))
    if label:
        ax.plot([], [], [], color=shown[0] if shown else "grey", linewidth=width, label=label)
    return _fit(ax, lines[known].reshape(-1, 3), had_data)


def draw_body(body: BodyModel, state: np.ndarray, ax: Axes3D | None = None, person: int = 0, alpha: float = 0.9) -> Axes3D:
    """Draw a body's flesh in 3-D.

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (37,)
        Metres and radians.
    ax : Axes (3-D), optional
    person : int
        Number that decides the color of trunk and head.
    alpha : float
        Opacity.
    """
    ax, had_data = _room_axes(ax)
    rings = cone_rings(body, state)
    starts, ends = np.split(rings, 2, axis=1)
    # Short pieces, because matplotlib orders whole polygons by depth.
    levels = starts + np.linspace(0, 1, 6)[:, None, None, None] * (ends - starts)
    low, high = levels[:-1], levels[1:]
    sides = np.stack([low, np.roll(low, -1, axis=2), np.roll(high, -1, axis=2), high], axis=3)
    normals = np.cross(sides[..., 1, :] - sides[..., 0, :], sides[..., 3, :] - sides[..., 0, :])
    outward = np.sign(np.einsum("...i,...i->...", normals, sides.mean(axis=3) - levels[:-1].mean(axis=2, keepdims=True)))
    names = [PARTS[part] for part in body.cones.part]
    base = np.array([_rgb({"l_": LEFT, "r_": RIGHT}.get(name[:2], person_color(person))) for name in names])
    colors = base[:, None] * _brightness(normals * outward[..., None])[..., None]
    caps = np.stack([starts, ends])
    middles, following = np.broadcast_to(caps.mean(axis=2, keepdims=True), caps.shape), np.roll(caps, -1, axis=2)
    fans = np.stack([middles, caps, following, following], axis=3)
    polygons = np.concatenate([sides.reshape(-1, 4, 3), fans.reshape(-1, 4, 3)])
    flat = np.tile(np.repeat(0.6 * base, caps.shape[2], axis=0), (2, 1))
    faces = np.concatenate([np.clip(colors, 0, 1).reshape(-1, 3), flat])
    ax.add_collection3d(Poly3DCollection(polygons, facecolors=faces, edgecolors="none", alpha=alpha))
    return _fit(ax, rings.reshape(-1, 3), had_data)


def draw_tracks(tracks: TrackTable, room: np.ndarray | None = None, truth: TrackTable | None = None, ax: Axes | None = None) -> Axes:
    """Draw every person's way from above; a dot where it ends, a thin dark line for the truth.

    Parameters
    ----------
    tracks : TrackTable
    room : ndarray, shape (2, 3), optional
        Its floor is outlined.
    truth : TrackTable, optional
    ax : Axes, optional
    """
    ax = _flat_axes(ax)
    if room is not None:
        (x0, y0), (x1, y1) = room[:, :2]
        ax.plot([x0, x1, x1, x0, x0], [y0, y0, y1, y1, y0], color="0.6", linewidth=1)
    for person in np.unique(tracks.persons):
        x, y = _unbroken(tracks.of(int(person)))
        color = 0.85 * np.array(_rgb(person_color(int(person))))
        ax.plot(x, y, color=color, linewidth=2, label=f"person {person}")
        ax.plot(x[-1], y[-1], "o", color=color, markersize=7)
    if truth is not None:
        for k, person in enumerate(np.unique(truth.persons)):
            ax.plot(*_unbroken(truth.of(int(person))), color="0.15", linewidth=0.8, label="" if k else "truth")
    ax.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", title="tracks from above")
    if ax.get_legend_handles_labels()[1]:
        ax.legend(fontsize=8)
    return ax


def draw_errors(frames: np.ndarray, errors: np.ndarray, ax: Axes | None = None, threshold_m: float = 0.1, title: str = "") -> Axes:
    """Draw a person's landmark errors over time: the mean, groups of limbs, and the span from best to worst landmark.

    Parameters
    ----------
    frames : ndarray, shape (n,)
    errors : ndarray, shape (n, 15)
        From `hmc.metrics.landmarks.landmark_errors`, metres; what is not finite leaves a gap.
    ax : Axes, optional
    threshold_m : float
        A line at the error up to which a landmark counts as matched.
    title : str
    """
    ax = _flat_axes(ax)
    order = np.argsort(frames)
    frames, values = np.asarray(frames)[order], 1000 * np.where(np.isfinite(errors), errors, np.nan)[order]
    known = np.isfinite(values).any(axis=1)
    low, high = (np.full(len(values), np.nan) for _ in range(2))
    low[known], high[known] = np.nanmin(values[known], axis=1), np.nanmax(values[known], axis=1)
    ax.fill_between(frames, low, high, color="0.9", linewidth=0, label="best to worst landmark")
    for name, group in GROUPS.items():
        ax.plot(frames, _row_means(values[:, [landmark_index(landmark) for landmark in group]]), linewidth=1, label=name)
    ax.plot(frames, _row_means(values), color="black", linewidth=2, label="mean of all")
    ax.axhline(1000 * threshold_m, color="tab:red", linewidth=0.8, linestyle="--", label=f"{1000 * threshold_m:g} mm")
    ax.set(xlabel="frame", ylabel="error (mm)", title=title)
    ax.set_ylim(bottom=0)
    ax.legend(fontsize=8, ncols=2)
    return ax


def draw_scores(rows: Sequence[dict], ax: Axes | None = None, person: str = "all") -> Axes:
    """Draw the mean error and the deviation of every landmark as bars, the worst at the bottom.

    Parameters
    ----------
    rows : sequence of dict
        The table of a `hmc.metrics.scores.PoseEvaluation`.
    ax : Axes, optional
    person : str
        Whose rows: a number of the truth, or "all".
    """
    ax = _flat_axes(ax)
    chosen = sorted((row for row in rows if row["person"] == person and row["landmark"] in LANDMARKS), key=lambda row: -row["mean_mm"])
    overall = next(row["mean_mm"] for row in rows if row["person"] == person and row["landmark"] == "overall")
    names = [row["landmark"] for row in chosen]
    colors = [_rgb({"l_": LEFT, "r_": RIGHT}.get(name[:2], (150, 150, 150))) for name in names]
    spread = [row["deviation_mm"] for row in chosen]
    ax.barh(names, [row["mean_mm"] for row in chosen], xerr=spread, color=colors, error_kw={"elinewidth": 0.8, "ecolor": "0.3"})
    ax.axvline(overall, color="black", linewidth=1, linestyle="--", label=f"overall {overall:.1f} mm")
    ax.set(xlabel="mean error and deviation (mm)")
    ax.set_xlim(left=0)
    ax.legend(fontsize=8)
    return ax


def _flat_axes(ax: Axes | None) -> Axes:
    return plt.subplots(layout="constrained")[1] if ax is None else ax


def _room_axes(ax: Axes3D | None) -> tuple[Axes3D, bool]:
    """3-D axes with a quiet look, and whether anything is drawn in them already."""
    if ax is None:
        ax = plt.figure(figsize=(6, 6), layout="constrained").add_subplot(projection="3d")
    had_data = ax.has_data()
    if not had_data:
        ax.set(xlabel="x (m)", ylabel="y (m)", zlabel="z (m)")
        ax.view_init(elev=18, azim=-60)
        for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
            axis.set_pane_color((0.97, 0.97, 0.97, 1.0))
            axis.set_major_locator(MultipleLocator(0.5))
    return ax, had_data


def _fit(ax: Axes3D, points: np.ndarray, had_data: bool) -> Axes3D:
    """Widen the limits to what is drawn, at least a metre each way, with one scale for all axes."""
    if len(points):
        low, high = points.min(axis=0), points.max(axis=0)
        if had_data:
            now = np.array([ax.get_xlim3d(), ax.get_ylim3d(), ax.get_zlim3d()])
            low, high = np.minimum(low, now[:, 0]), np.maximum(high, now[:, 1])
        short = np.maximum(1.0 - (high - low), 0) / 2
        low, high = low - short, high + short
        ax.set(xlim3d=(low[0], high[0]), ylim3d=(low[1], high[1]), zlim3d=(low[2], high[2]))
        ax.set_box_aspect(tuple(high - low))
    return ax


def _as_picture(ax: Axes, title: str) -> Axes:
    ax.set(xticks=[], yticks=[])
    ax.set_title(title, fontsize=9)
    return ax


def _brightness(normals: np.ndarray) -> np.ndarray:
    """Light and dark by the direction of a face, shape (..., 3) to (...), .4 to 1."""
    length = np.maximum(np.linalg.norm(normals, axis=-1), 1e-12)
    return 0.7 + 0.3 * (normals @ np.asarray(LIGHT.direction)) / length


def _rgb(bgr: Sequence[int]) -> tuple[float, float, float]:
    return bgr[2] / 255, bgr[1] / 255, bgr[0] / 255


def _row_means(values: np.ndarray) -> np.ndarray:
    """Means of rows over what is known; NaN where nothing is."""
    known = np.isfinite(values)
    return np.where(known.any(axis=1), np.where(known, values, 0).sum(axis=1) / np.maximum(known.sum(axis=1), 1), np.nan)


def _unbroken(track: TrackTable) -> tuple[np.ndarray, np.ndarray]:
    """x and y by frame, with NaN where frames are missing, so that no line bridges a gap."""
    order = np.argsort(track.frames)
    frames, points = track.frames[order], track.positions[order, :2]
    steps = np.diff(frames)
    gaps = np.flatnonzero(steps > steps.min(initial=steps.max(initial=1))) + 1
    x, y = np.insert(points, gaps, np.nan, axis=0).T
    return x, y
