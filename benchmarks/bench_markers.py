"""A layer of the marker filter against brute force and against a bare gather, and frames a second. Row 9 of README.md.

python benchmarks/bench_markers.py
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from _timing import interleaved, report

from hmc.body.kinematics import landmarks
from hmc.body.marker_places import place_tips
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.camera.model import Rig, look_at, project
from hmc.pose.method import Capture, begin_tracking, make_subject
from hmc.pose.objectives.epipolar import marker_cost, project_markers
from hmc.pose.objectives.nearest_detections import nearest_detections
from hmc.pose.steps.marker_filter import MARKER_PRESETS, marker_frame
from hmc.pose.steps.presets import drift
from hmc.pose.views.markers import marker_views, observe_markers
from hmc.search import truncated_normal
from hmc.synthetic.marker_detector import SyntheticDetector, detect_synthetic, seen_by_ideal_detector

VIEWS, PARTICLES = 7, 700


def brute(seen, points):
    """Every detection against every landmark, view by view, then the table of pairs (Eq. 6.5 and 6.7)."""
    uv = project_markers(seen.views, points.reshape(3, -1))
    place = []
    for view in range(VIEWS):
        apart = ((uv[:, view, :, None] - seen.uv[:, view, None]) ** 2).sum(axis=0)
        nearest = apart.argmin(axis=1)
        place.append(np.where(apart[np.arange(len(apart)), nearest] <= seen.gate_px**2, nearest, seen.stride - 1))
    total = np.zeros(uv.shape[2])
    for table, i, j in zip(seen.pairs, *np.triu_indices(VIEWS, 1), strict=True):
        total += table[place[i], place[j]]
    return np.array(place), total


def main() -> int:
    rng, body, good = np.random.default_rng(0), default_body(1.75), True
    angles = np.arange(VIEWS) * 2 * np.pi / VIEWS
    rig = Rig(tuple(look_at(f"c{k}", (640, 480), (2.9 * np.cos(a), 2.6 * np.sin(a), 2.3), (0, 0, 0.95), 65) for k, a in enumerate(angles)))
    state = neutral_state("down", body.limits)
    state[2] = 0.95
    ideal, _ = seen_by_ideal_detector(body, rig, landmarks(body, state), state)
    boxes = np.array([[one.min(0), one.max(0)] for one in project(rig, landmarks(body, state))[0]])
    views, preset = marker_views(rig), MARKER_PRESETS["canton2009"]
    frames = [detect_synthetic(rng, ideal, SyntheticDetector(0.9, 6.5, 4.0), boxes) for _ in range(20)]
    counts = [len(uv) for one in frames for uv in one]
    print(f"{VIEWS} views, {min(counts)} to {max(counts)} detections, 15 landmarks, {PARTICLES} particles a layer")
    seen = observe_markers(views, frames[0], preset.likelihood.gate_px)
    for name, scale in (("first", 1.0), ("second", 0.5), ("third", 0.25)):
        states = truncated_normal(rng, np.tile(state, (PARTICLES, 1)), scale * drift(30), body.limits.low, body.limits.high)
        points = place_tips(body, states)
        uv = project_markers(views, points.reshape(3, -1)).reshape(2, VIEWS, 15, PARTICLES)
        place = nearest_detections(seen.uv, uv, seen.gate_px)[0].reshape(VIEWS, -1)
        same = float((place == brute(seen, points)[0]).mean())
        good &= report("9", f"nearest equals brute force, {name} layer", same, 1.0, at_least=True)
        flat = seen.uv[0].ravel()
        index = (place + seen.stride * np.arange(VIEWS)[:, None]).ravel()
        tables, at = seen.pairs.ravel(), rng.integers(0, seen.pairs.size, len(seen.pairs) * place.shape[1])
        times = interleaved(
            {
                "ours": lambda points=points: marker_cost(seen, points, preset.likelihood),
                "brute": lambda points=points: brute(seen, points),
                "gather": lambda index=index, at=at, flat=flat, tables=tables: (flat.take(index), flat.take(index), tables.take(at)),
            }
        )
        note = f"{1e3 * times['ours']:.1f} ms; {times['ours'] / times['gather']:.1f} of a bare gather"
        good &= report("9", f"likelihood / brute nearest with a pair table, {name} layer", times["ours"] / times["brute"], 0.35, note=note)
    # Each filter follows the still person; the detections change from frame to frame.
    for name, target in (("canton2009", 100.0), ("default", None)):
        preset = MARKER_PRESETS[name]
        begun = begin_tracking(make_subject(body, Capture(30.0)), state)

        def follow(pose=begun, preset=preset):
            for k, detections in enumerate(frames):
                pose, _ = marker_frame(
                    np.random.default_rng(k), pose, observe_markers(views, detections, preset.likelihood.gate_px), preset
                )

        rate = len(frames) / interleaved({"follow": follow}, rounds=5)["follow"]
        if target is None:
            print(f"     frames a second, {name}, with refinement {rate:28.0f}")
        else:
            good &= report("9", f"frames a second, {name}, 3 layers of 700", rate, target, at_least=True)
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
