"""The edge cue: contours of the limbs matched with color edges in the three views that see them best. Kehl (2006), section 6.1.2."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.contours import contour_points, hidden
from hmc.body.solid_samples import SampledBody
from hmc.body.solids import GROUPS, to_world
from hmc.camera.color_edges import ColorEdgeSettings, color_edges
from hmc.camera.stacked import Views, project_in
from hmc.pose.objectives.cue_rows import Matches, PosedBody, point_wrenches
from hmc.pose.views.skin import Crop

__all__ = ["EdgeMaps", "best_views", "edge_maps", "match_edges", "shown_contours"]

#: Of the edge points on either side of a limb so many, the ones with the highest scores, take part in the search for the best pair.
BEST = 5
#: Lengths of a pair that differ by less than this are alike: edges are found to the pixel.
ALIKE_PX = 1.0


@dataclass(frozen=True)
class EdgeMaps:
    """Edges of the views that are used.

    Parameters
    ----------
    views : Views
        Of these cameras.
    table : ndarray of float32, shape (m, 3)
        Strength and direction of all their pixels, row by row, view after view.
    corner, size : ndarray of int, shape (v, 2)
        (left, top) and (width, height) of each view's part.
    first : ndarray of int, shape (v,)
        Where each view's pixels begin.
    shown : ndarray of bool, shape (v, n_strips, 2)
        Contour points that each view sees, in the pose that was expected for the frame: occlusion changes little while the pose is sought.
    """

    views: Views
    table: np.ndarray
    corner: np.ndarray
    size: np.ndarray
    first: np.ndarray
    shown: np.ndarray


def shown_contours(sampled: SampledBody, posed: PosedBody, views: Views) -> np.ndarray:
    """Which contour points each camera sees.

    Parameters
    ----------
    sampled : SampledBody
    posed : PosedBody
    views : Views

    Returns
    -------
    ndarray of bool, shape (n_views, n_strips, 2)
        False where there is no such point, or where a solid hides it.
    """
    body, strips = sampled.body, sampled.strips
    n = len(strips.solid)
    chosen, of = np.tile(np.arange(n), len(views)), np.repeat(np.arange(len(views)), n)
    turns, centres = to_world(body, posed.rotations, posed.positions)
    cameras = views.centre[of]
    contour = contour_points(body, strips, chosen, turns, centres, cameras)
    both = np.flatnonzero(np.repeat(contour.found, 2))
    shown = np.zeros(2 * len(chosen), bool)
    shown[both] = ~hidden(body, turns, centres, strips.solid[chosen[both // 2]], contour.points.reshape(-1, 3)[both], cameras[both // 2])
    return shown.reshape(len(views), n, 2)


def best_views(shown: np.ndarray, usable: np.ndarray, count: int) -> np.ndarray:
    """The views in which the fewest contour points are hidden.

    Parameters
    ----------
    shown : ndarray of bool, shape (v, n_strips, 2)
        From `shown_contours`.
    usable : ndarray of bool, shape (v,)
        Which of them have an image.
    count : int

    Returns
    -------
    ndarray of int
        Rising; fewer where fewer are usable.
    """
    cameras = np.flatnonzero(usable)
    lost = (~shown[cameras]).sum(axis=(1, 2))
    return np.sort(cameras[np.argsort(lost, kind="stable")[:count]])


def edge_maps(views: Views, crops: list[Crop], shown: np.ndarray, settings: ColorEdgeSettings) -> EdgeMaps:
    """Find edges.

    Parameters
    ----------
    views : Views
        Of the crops' cameras.
    crops : list of Crop
    shown : ndarray of bool, shape (v, n_strips, 2)
        Contour points that these cameras see.
    settings : ColorEdgeSettings
    """
    found = [color_edges(crop.image, settings) for crop in crops]
    table = np.concatenate([np.concatenate([edges.strength[..., None], edges.direction], axis=2).reshape(-1, 3) for edges in found])
    size = np.array([crop.image.shape[1::-1] for crop in crops])
    corner = np.array([(crop.left, crop.top) for crop in crops])
    return EdgeMaps(views, table, corner, size, np.cumsum([0, *size.prod(axis=1)])[:-1], shown)


def match_edges(
    sampled: SampledBody, posed: PosedBody, maps: EdgeMaps, chosen: np.ndarray, view: np.ndarray, reach_m: float, weight: float
) -> Matches:
    """Match contour points with edges: both points of a circle of latitude as a pair (Eq. 12, 13), others singly (Eq. 14, 15).

    Parameters
    ----------
    sampled : SampledBody
    posed : PosedBody
    maps : EdgeMaps
    chosen : ndarray of int, shape (n,)
        Strips.
    view : ndarray of int, shape (n,)
        In which of the maps' views.
    reach_m : float
        How far edges are looked for on either side of a contour point, metres at its depth.
    weight : float
        Of all contour points together.

    Returns
    -------
    Matches
        Two features a strip: the pair and nothing, or either point. Hidden points, and those without an edge, are missing.
    """
    body, strips = sampled.body, sampled.strips
    n = len(chosen)
    turns, centres = to_world(body, posed.rotations, posed.positions)
    solid, segment, group = strips.solid[chosen], body.segment[strips.solid[chosen]], strips.group[chosen]
    cameras = maps.views.centre[view]
    contour = contour_points(body, strips, chosen, turns, centres, cameras)
    points, both = contour.points.reshape(-1, 3), np.repeat(np.arange(n), 2)
    uv, slopes, valid = project_in(maps.views, view[both], points)
    seen = maps.shown[view, chosen].ravel() & contour.found[both] & valid
    normal = (slopes @ contour.normals.reshape(-1, 3, 1))[..., 0]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    pixels_a_metre = np.sqrt(0.5 * np.einsum("nij,nij->n", slopes, slopes))

    seen = seen.reshape(n, 2)
    paired = strips.is_circle[chosen] & seen.all(axis=1)
    across = uv.reshape(n, 2, 2)
    across = across[:, 1] - across[:, 0]
    length = np.linalg.norm(across, axis=1)
    paired &= length > 1e-6
    # A pair is searched along the line through both, away from one another; a single point along its normal.
    unit = across / np.maximum(length, 1e-9)[:, None]
    line = np.where(paired[both][:, None], unit[both] * np.tile([-1.0, 1.0], n)[:, None], normal)
    found_at, score = _along(maps, view[both], uv, line, normal, reach_m * pixels_a_metre, np.where(paired, length / 2, np.inf)[both])

    rows = np.arange(2 * n)
    best = score.argmax(axis=1)
    target, matched = found_at[rows, best], (score[rows, best] > 0) & seen.ravel()
    pair_target, pair_matched = _best_pairs(found_at.reshape(n, 2, -1, 2), score.reshape(n, 2, -1), length)
    pair_matched &= paired

    residuals, wrenches = np.zeros((2 * n, 3)), np.zeros((2 * n, 3, 6))
    single_scale = 1 / np.maximum(body.diameter[solid][both] * pixels_a_metre, 1e-9)
    moved = slopes @ point_wrenches(points)
    residuals[:, :2] = (uv - target) * single_scale[:, None]
    wrenches[:, :2] = moved * single_scale[:, None, None]
    as_pair = np.flatnonzero(paired)
    scale = 1 / length[as_pair]
    middle = moved.reshape(n, 2, 2, 6)[as_pair].mean(axis=1)
    first, second = 2 * as_pair, 2 * as_pair + 1
    residuals[first, :2] = (uv.reshape(n, 2, 2)[as_pair].mean(axis=1) - pair_target[as_pair]) * scale[:, None]
    wrenches[first, :2] = middle * scale[:, None, None]
    matched[first], matched[second] = pair_matched[as_pair], False
    residuals[~matched], wrenches[~matched] = 0.0, 0.0
    share = np.full(2 * n, weight / (2 * n))
    share[first], share[second] = 2 * share[first], 0.0
    missing = np.bincount(group[both], np.where(matched, 0.0, share), len(GROUPS))
    return Matches(residuals, wrenches, segment[both], group[both], np.where(matched, share, 0.0), missing)


def _along(maps: EdgeMaps, view, uv, line, normal, reach, inwards) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of a line through each point as Bresenham draws it, from `inwards` pixels before the point at most to `reach` pixels on either
    side, and their gradient scores (Eq. 11); 0 where there is no edge."""
    step = line / np.maximum(np.abs(line).max(axis=1, keepdims=True), 1e-9)
    pace = np.linalg.norm(step, axis=1)
    most = int(np.ceil((reach / pace).max(initial=1.0)))
    away = np.arange(-most, most + 1)
    place = np.floor(uv[:, None] + away[:, None] * step[:, None] + 0.5).astype(np.int64)
    distance = away * pace[:, None]
    asked = (np.abs(distance) <= reach[:, None]) & (distance >= -inwards[:, None])
    at = place - maps.corner[view][:, None]
    size = maps.size[view][:, None]
    asked &= ((at >= 0) & (at < size)).all(axis=2)
    flat = np.where(asked, maps.first[view][:, None] + at[..., 1] * size[..., 0] + at[..., 0], 0)
    edge = maps.table.take(flat, axis=0)
    # An edge has no sign: what is brighter may be on either side.
    score = edge[..., 0] * np.abs(edge[..., 1] * normal[:, None, 0] + edge[..., 2] * normal[:, None, 1])
    return place.astype(float), np.where(asked, score, 0.0)


def _best_pairs(places: np.ndarray, scores: np.ndarray, length: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middles of the best pairs of edge points (Eq. 12), and whether there is any."""
    n = len(length)
    k = min(BEST, scores.shape[2])
    best = np.argpartition(-scores, k - 1, axis=2)[:, :, :k]
    rows, sides = np.arange(n)[:, None, None], np.arange(2)[:, None]
    places, scores = places[rows, sides, best], scores[rows, sides, best]
    apart = np.linalg.norm(places[:, 0, :, None] - places[:, 1, None], axis=-1)
    product = scores[:, 0, :, None] * scores[:, 1, None]
    cost = np.where(product > 0, np.maximum(np.abs(apart - length[:, None, None]), ALIKE_PX) / np.maximum(product, 1e-12), np.inf)
    cost = cost.reshape(n, -1)
    winner = cost.argmin(axis=1)
    a, b = np.divmod(winner, k)
    row = np.arange(n)
    return (places[row, 0, a] + places[row, 1, b]) / 2, np.isfinite(cost[row, winner])
