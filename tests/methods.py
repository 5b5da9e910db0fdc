"""Every pose method of the registry, with little work a frame, and what the small rendered clip shows to any of them."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from hmc.camera.model import project
from hmc.camera.segmentation_settings import SegmentationSettings
from hmc.io.detections import DetectionTable
from hmc.io.recording import Recording, open_recording
from hmc.io.results import TrackTable, read_centroids, read_joints
from hmc.pose.follow import FollowOptions, PosedPeople, follow
from hmc.pose.method import PoseMethod
from hmc.pose.methods import pso, smd
from hmc.pose.recovery import Recovery
from hmc.pose.registry import METHODS, pose_method
from hmc.pose.starts import templates
from hmc.pose.starts.candidates import StartSettings
from hmc.pose.starts.window import WindowStart
from hmc.pose.steps import marker_filter, presets
from hmc.pose.steps.limb_search import SearchSettings
from hmc.pose.steps.swarm.fit import FitSettings
from hmc.pose.views.markers import marker_views, seen_in_frame
from hmc.pose.views.person_view import PersonView, views_of
from hmc.search.filters import AnnealedSettings
from hmc.tracking.resumable import person_grid
from hmc.voxels.frontend_settings import FrontendSettings
from hmc.voxels.hulls import HullStep, stream_hulls
from hmc.voxels.run_options import RunOptions

TINY = Path(__file__).resolve().parents[1] / "data" / "synthetic" / "tiny"
VOXEL_M, HEIGHT_M, MOST_FRAMES = 0.05, 1.76, 7
#: Silhouettes that no network has told shades of: of this clip they leave more in doubt.
BY_RULES = FrontendSettings(segmentation=SegmentationSettings(least_chance=0))
#: The house's methods, and the papers' own where they remember something else. That on keypoints alone draws no random numbers: it has
#: tests of its own.
CASES = [
    *((name, "default") for name in METHODS if name != "keypoints"),
    ("apf", "canton2009"),
    ("shbm-ddm-apf", "canton2009"),
    ("smd", "kehl2006"),
    ("pso", "hsiao2008"),
    ("marker-apf", "canton2009"),
]
#: Those with the house's refinement, search, recovery and legs on hulls.
HOUSE = [(name, preset) for name, preset in CASES if preset == "default" and name != "marker-apf"]
TRACKED = [(name, preset) for name, preset in CASES if pose_method(name).needs_tracks]


#: Those that run in `make test`: of each kind one, with all that it remembers.
QUICK = [("shbm-ddm-apf", "default"), ("smd", "default"), ("pso", "default"), ("marker-apf", "default"), ("apf", "canton2009")]


def each(cases):
    """Parameters of a test of many methods: all of them are `slow`, but for `QUICK`."""
    marked = [case if case in QUICK else pytest.param(case, marks=pytest.mark.slow) for case in cases]
    return pytest.mark.parametrize("case", marked, ids=[case_id(case) for case in cases])


def case_id(case: tuple[str, str]) -> str:
    return "-".join(part for part in case if part != "default")


def lean_presets(patch: pytest.MonkeyPatch) -> None:
    """All presets as they are, with fewer particles, iterations and draws."""
    few, search = AnnealedSettings(layers=2, particles=30, survival_rate=0.1, spread=0.5), SearchSettings(draws=40)
    house, canton = presets.PRESETS["default"], presets.PRESETS["canton2009"]
    structural = replace(house.structural, layers=1)
    patch.setitem(presets.PRESETS, "default", replace(house, annealed=few, search=search, structural=structural))
    patch.setitem(presets.PRESETS, "canton2009", replace(canton, annealed=AnnealedSettings(layers=3, particles=60)))
    for name, one in smd.SMD_PRESETS.items():
        patch.setitem(smd.SMD_PRESETS, name, replace(one, descent=replace(one.descent, iterations=6)))
    fit = FitSettings(stages=((6, 3),) * 5, tune_particles=6, tune_iterations=2)
    for name, one in pso.SWARM_PRESETS.items():
        patch.setitem(pso.SWARM_PRESETS, name, replace(one, swarm=replace(one.swarm, fit=fit, particles=8, iterations=2)))
    for name, one in marker_filter.MARKER_PRESETS.items():
        patch.setitem(marker_filter.MARKER_PRESETS, name, replace(one, annealed=replace(one.annealed, layers=2, particles=120)))


@cache
def lean_method(name: str, preset: str = "default", models: tuple[str, ...] = (), init: str | None = None, skin: bool = True) -> PoseMethod:
    """A method with little work, that watches people for three frames and decides a frame after one or two more."""
    with pytest.MonkeyPatch.context() as patch:
        lean_presets(patch)
        method = pose_method(name, preset, models, init, skin)
    start, least = method.start, StartSettings(anchors=1, candidates=1)
    if isinstance(start, smd.DaVinciStart):
        start = replace(start, otherwise=replace(start.otherwise, settings=least))
    elif isinstance(start, WindowStart):
        start = replace(start, settings=least)
    recover = replace(method.recover, start=least) if isinstance(method.recover, Recovery) else method.recover
    legs = None if method.legs is None else replace(method.legs, lag_s=0.1)
    return replace(method, start=start, recover=recover, legs=legs, window_s=0.2)


def lean_work(patch: pytest.MonkeyPatch) -> None:
    """Fewer headings at the start, and hulls of the small clip that are carved once for all runs."""
    patch.setattr(templates, "HEADINGS", 6)
    patch.setattr(templates, "VARIANTS", 1)
    patch.setattr("hmc.pose.follow.stream_hulls", _carved_before)


def _carved_before(recording, grid, frontend=None, *, first=0, masks=None, **more):
    """`hmc.voxels.hulls.stream_hulls` of a selection of the clip, from memory; silhouettes that were kept are read and left."""
    if recording.path != TINY:
        yield from stream_hulls(recording, grid, frontend, first=first, masks=masks, **more)
        return
    for step in _carved(recording.rig.names, grid.voxel_size_m, frontend):
        if first <= step.index < recording.start + recording.n_frames:
            yield step


@cache
def _carved(cameras: tuple[str, ...], voxel_size_m: float, frontend=None) -> tuple[HullStep, ...]:
    clip = tiny_clip(MOST_FRAMES, cameras)
    return tuple(stream_hulls(clip, person_grid(clip, voxel_size_m), frontend))


@cache
def clip_views() -> list[PersonView]:
    """All that the clip shows of its person, frame by frame, the markers' detections included; at rest."""
    clip = tiny_clip(MOST_FRAMES)
    grid, tracks, views = person_grid(clip, VOXEL_M), true_tracks(MOST_FRAMES), marker_views(clip.rig)
    seen = []
    for hull in _carved(clip.rig.names, VOXEL_M):
        (view,) = views_of(clip, grid, tracks, hull, ("hulls", "skin", "voxels")).values()
        markers = seen_in_frame(clip.rig, views, true_detections(MOST_FRAMES).in_frame(hull.index, clip.rig.names), 20.0)
        seen.append(replace(view, markers=markers))
    return seen


@cache
def tiny_clip(frames: int, cameras: tuple[str, ...] = ()) -> Recording:
    """The small rendered clip that comes with the package."""
    return open_recording(TINY, cameras or None, frames=frames)


def true_tracks(frames: int) -> TrackTable:
    """The true centroids, so that nothing depends on the tracker."""
    truth = read_centroids(TINY / "truth" / "centroids.csv")
    return truth.where(truth.frames < frames)


def true_joints(frames: int) -> np.ndarray:
    """Landmarks of the clip's person, shape (frames, 15, 3)."""
    return read_joints(TINY / "truth" / "joints.csv").positions[:frames]


@cache
def true_detections(frames: int, without: tuple[int, ...] = ()) -> DetectionTable:
    """Images of the true joints in all cameras, in all frames but some."""
    rig = open_recording(TINY).rig
    uv, _ = project(rig, true_joints(frames))
    rows = [(frame, rig.names[view]) for frame in range(frames) if frame not in without for view in range(len(rig)) for _ in range(15)]
    places = [uv[view, frame] for frame in range(frames) if frame not in without for view in range(len(rig))]
    return DetectionTable(np.array([row[0] for row in rows]), np.array([row[1] for row in rows]), np.concatenate(places))


def followed(case: tuple[str, str], frames: int, run: RunOptions | None = None, **how) -> PosedPeople:
    """The clip's person by a method: `tracks`, `seed`, `recording`, `detections`, `method` and `change` may be others."""
    method = how.get("method") or lean_method(*case)
    tracks = how.get("tracks", true_tracks(frames)) if pose_method(case[0]).needs_tracks else None
    detections = None
    if "detections" in method.needs:
        detections = how.get("detections", true_detections(frames))
    options = FollowOptions(VOXEL_M, how.get("seed", 3), HEIGHT_M, detections, change=how.get("change"))
    return follow(how.get("recording") or tiny_clip(frames), tracks, method, options, run)
