"""Poses from markers: lookups against brute force, geometry against OpenCV, detectors against what they are told, known poses."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from hmc.body.exchange import swapped_pose
from hmc.body.joints import N_DOF, dof_index
from hmc.body.kinematics import landmarks
from hmc.body.marker_places import fit_tips, place_tips, with_skin_markers
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.camera.epipolar import generalised_epipolar_distance
from hmc.camera.marker_color import MarkerColorSettings, detect_markers, learn_marker_color
from hmc.camera.model import Rig, look_at, project
from hmc.camera.triangulation import triangulate
from hmc.errors import InputError
from hmc.io.detections import DetectionTable, read_detections, write_detections
from hmc.io.recording import Recording
from hmc.landmarks import LANDMARKS
from hmc.pose.follow import FollowOptions, follow
from hmc.pose.method import Capture, StepInfo, begin_tracking, make_subject
from hmc.pose.methods.marker_apf import MarkerRecovery, MarkerStart, marker_method
from hmc.pose.objectives.epipolar import MarkerLikelihood, marker_cost, project_markers
from hmc.pose.objectives.marker_points import find_points
from hmc.pose.objectives.nearest_detections import nearest_detections
from hmc.pose.steps.marker_filter import MARKER_PRESETS, TIPS, MarkerPreset, marker_frame, on_markers, with_tips
from hmc.pose.steps.marker_limbs import fit_all_points, refine_to_points
from hmc.pose.steps.marker_search import left_over, search_near, start_poses
from hmc.pose.steps.presets import drift
from hmc.pose.views.markers import marker_views, observe_markers
from hmc.pose.views.person_view import PersonView
from hmc.search import AnnealedSettings, truncated_normal
from hmc.synthetic.marker_detector import SyntheticDetector, detect_synthetic, marker_visibility, seen_by_ideal_detector

BODY = default_body(1.75)
GATE = 25.0


def ring(n=5):
    angles = np.arange(n) * 2 * np.pi / n + 0.2
    places = [(2.8 * np.cos(a), 2.8 * np.sin(a), 1.9 + 0.2 * k) for k, a in enumerate(angles)]
    return Rig(tuple(look_at(f"c{k}", (640, 480), place, (0, 0, 0.95), 60) for k, place in enumerate(places)))


def standing(seed=None):
    state = neutral_state("down", BODY.limits)
    state[:3] = 0.1, -0.05, 0.95
    state[dof_index("l_shoulder_x", "r_elbow_z", "l_hip_y")] += np.radians([-30, 60, -25])
    if seed is not None:
        state = truncated_normal(np.random.default_rng(seed), state, 0.5 * drift(30), BODY.limits.low, BODY.limits.high)
    return state


RIG = ring()
VIEWS = marker_views(RIG)
ROOM = np.array([[-2.0, -2.0, 0.0], [2.0, 2.0, 2.5]])
SUBJECT = make_subject(BODY, Capture(30.0, rig=RIG))


def detections(points, false=8, noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    uv, _ = project(RIG, points)
    uv = uv + noise * rng.standard_normal(uv.shape)
    return [np.concatenate([one, rng.uniform(one.min(0), one.max(0), (false, 2))]) for one in uv]


def followed(table, n, preset, method=None, height_m=1.75):
    """The poses of a person of known stature in n frames of a table, markers at the joints."""
    recording = Recording(Path("markers"), "markers", 30.0, RIG, ROOM, n, 0, 1, ())
    return follow(recording, None, method or marker_method(preset, skin=False), FollowOptions(height_m=height_m, detections=table))


def test_placed_tips_are_the_landmarks():
    markers = with_skin_markers(BODY)
    states = np.array([standing(seed) for seed in range(7)])
    for body in (BODY, markers):
        np.testing.assert_allclose(place_tips(body, states), landmarks(body, states).transpose(2, 1, 0), atol=2e-6)
    offsets = np.linalg.norm(markers.tips - BODY.tips, axis=1)
    assert (offsets > 0.005).all() and (offsets < 0.13).all()


def test_nearest_detections_are_those_of_brute_force():
    rng = np.random.default_rng(1)
    points = rng.uniform(0, 300, (2, 3, 4, 50)).astype(np.float32) + rng.uniform(0, 200, (2, 3, 4, 1)).astype(np.float32)
    seen = np.full((2, 3, 21), np.inf, np.float32)
    seen[:, 0, :20], seen[:, 1, :1] = rng.uniform(0, 500, (2, 20)), 250  # many, one, and none in the last view
    place, squared = nearest_detections(seen, points, 60.0)
    distance = ((points[..., None] - seen[:, :, None, None]) ** 2).sum(axis=0)
    wanted, least = distance.argmin(axis=-1), distance.min(axis=-1)
    np.testing.assert_array_equal(place, np.where(least < 3600, wanted, 20))
    np.testing.assert_allclose(squared, np.minimum(least, 3600), rtol=1e-6)
    assert 0.05 < (place[0] < 20).mean() < 1 and (place[2] == 20).all()


def test_cost_is_that_of_a_loop_over_landmarks_and_views():
    states = np.array([standing(seed) for seed in range(6)])
    seen = observe_markers(VIEWS, detections(landmarks(BODY, standing()), noise=2.0), GATE)
    settings = MarkerLikelihood(GATE, reprojection=0.3)
    cost, matched = marker_cost(seen, place_tips(BODY, states), settings)
    for n, points in enumerate(landmarks(BODY, states)):
        uv, _ = project(RIG, points)
        scores = []
        for m in range(15):
            chosen, off = np.full((len(RIG), 2), np.nan), []
            for view in range(len(RIG)):
                apart = np.linalg.norm(seen.detections[view] - uv[view, m], axis=1)
                off.append(min(1.0, apart.min() ** 2 / GATE**2))
                if apart.min() <= GATE:
                    chosen[view] = seen.detections[view][apart.argmin()]
            k = int(np.isfinite(chosen[:, 0]).sum())
            assert matched[m, n] == k
            whole = generalised_epipolar_distance(VIEWS.fundamentals, chosen)
            epipolar = 1.0 if k < 2 else min(1.0, whole / np.sqrt(k * (k - 1) / 2) / (2 * np.sqrt(2) * GATE))
            scores.append(0.7 * epipolar + 0.3 * np.mean(off))
        assert cost[n] == pytest.approx(np.mean(scores), abs=2e-4)


def test_cost_is_least_at_the_true_pose_and_one_without_detections():
    states = np.array([standing(), *(standing(seed) for seed in range(30))])
    seen = observe_markers(VIEWS, detections(landmarks(BODY, standing()), false=0), GATE)
    cost, matched = marker_cost(seen, place_tips(BODY, states), MarkerLikelihood(GATE))
    assert cost.argmin() == 0 and cost[0] < 1e-3 and (matched[:, 0] == len(RIG)).all()
    empty = observe_markers(VIEWS, [np.zeros((0, 2))] * len(RIG), GATE)
    np.testing.assert_allclose(marker_cost(empty, place_tips(BODY, states), MarkerLikelihood(GATE))[0], 1, atol=1e-6)


def test_markers_behind_a_camera_match_nothing():
    uv = project_markers(VIEWS, np.array([[0.0, 50.0], [0.0, 50.0], [1.0, 1.0]]))
    assert np.isfinite(uv).all()
    front = project(RIG, np.array([0.0, 0.0, 1.0]))[0]
    np.testing.assert_allclose(uv[:, :, 0].T, front, atol=1e-2)
    assert (np.abs(uv[:, :, 1]).max(axis=0) > 1000)[project(RIG, np.array([50.0, 50.0, 1.0]))[1] == 0].all()


def test_triangulation_is_opencvs_and_exact_over_many_views():
    points = landmarks(BODY, standing())
    uv, _ = project(RIG, points)
    noisy = uv + np.random.default_rng(2).normal(0, 1, uv.shape)
    pair = np.full_like(noisy, np.nan)
    pair[:2] = noisy[:2]
    theirs = cv2.triangulatePoints(VIEWS.projections[0], VIEWS.projections[1], noisy[0].T, noisy[1].T)
    np.testing.assert_allclose(triangulate(VIEWS.projections, pair.swapaxes(0, 1)), (theirs[:3] / theirs[3]).T, atol=5e-3)
    np.testing.assert_allclose(triangulate(VIEWS.projections, uv.swapaxes(0, 1)), points, atol=1e-9)
    assert np.isnan(triangulate(VIEWS.projections, np.full((5, 2), np.nan))).all()


def test_points_are_found_among_false_detections():
    points = landmarks(BODY, standing())
    found, views = find_points(observe_markers(VIEWS, detections(points, false=4, noise=0.5), GATE))
    apart = np.linalg.norm(points[:, None] - found, axis=-1)
    assert apart.min(axis=1).max() < 0.02
    assert (views[apart.argmin(axis=1)] == len(RIG)).all() and views.min() >= 3
    assert find_points(observe_markers(VIEWS, [np.zeros((0, 2))] * len(RIG), GATE))[0].shape == (0, 3)


def test_a_pose_begins_from_points_alone():
    truth = standing(3)
    truth[dof_index("root_rz")] = 2.4
    points = np.random.default_rng(0).permutation(landmarks(BODY, truth))
    views = np.full(len(points), 5)
    state, cost = start_poses(np.random.default_rng(0), BODY, points, views)[0]
    assert cost < 1e-3
    assert np.linalg.norm(landmarks(BODY, state) - landmarks(BODY, truth), axis=1).mean() < 0.02
    assert start_poses(np.random.default_rng(0), BODY, points[:3], views[:3]) == []


def test_a_pose_begins_among_more_false_points_than_true_ones():
    """Twenty-four false points that three or four views agree on, between the true ones that five do, of somebody who boxes."""
    rng = np.random.default_rng(5)
    truth = standing(3)
    truth[dof_index("l_elbow_z", "r_elbow_z")], truth[dof_index("root_rz")] = np.radians([-90, 100]), 0.7
    places = landmarks(BODY, truth)
    points = np.concatenate([places, rng.uniform(places.min(0), places.max(0), (24, 3))])
    views = np.concatenate([np.full(15, 5), rng.integers(3, 5, 24)])
    state, _ = start_poses(np.random.default_rng(0), BODY, points, views)[0]
    assert np.linalg.norm(landmarks(BODY, state) - places, axis=1).mean() < 0.05
    assert left_over(BODY, state, points, views) == 0


def test_a_lost_arm_is_found_near_the_pose():
    truth = standing(3)
    lost = truth.copy()
    lost[dof_index("l_shoulder_x")] += np.radians(70)
    places = landmarks(BODY, truth)
    views = np.full(len(places), 5)
    found, better = search_near(np.random.default_rng(0), BODY, places, views, lost)
    assert better and np.linalg.norm(landmarks(BODY, found) - places, axis=1).max() < 0.03
    assert search_near(np.random.default_rng(0), BODY, places[:3], views[:3], lost)[1] is False


def test_markers_of_two_people_are_refused():
    both = landmarks(BODY, standing()), landmarks(BODY, standing()) + [0.9, 0.3, 0]
    uv = np.concatenate([project(RIG, points)[0] for points in both], axis=1).reshape(-1, 2)
    cameras = np.repeat(RIG.names, 30)
    table = DetectionTable(np.repeat(np.arange(4), len(uv)), np.tile(cameras, 4), np.tile(uv, (4, 1)))
    with pytest.raises(InputError, match="more than one person seems to wear markers"):
        followed(table, 4, MARKER_PRESETS["default"])


def test_learnt_markers_are_where_they_were_worn():
    rng = np.random.default_rng(5)
    markers, states = with_skin_markers(BODY), np.array([standing(seed) for seed in range(9)])
    worn = fit_tips(BODY, markers, states, landmarks(with_skin_markers(default_body(1.6)), states))
    assert np.isfinite(worn.tips).all()
    shifted = landmarks(markers, states) + rng.normal(0, 1e-3, (9, 15, 3))
    shifted[:, 4] = np.nan
    again = fit_tips(BODY, BODY, states, shifted)
    np.testing.assert_allclose(np.delete(again.tips, 4, 0), np.delete(markers.tips, 4, 0), atol=3e-3)
    np.testing.assert_array_equal(again.tips[4], BODY.tips[4])


# --- detectors


def test_flesh_hides_markers():
    state = neutral_state("sideways", BODY.limits)
    points, at = landmarks(BODY, state), LANDMARKS.index
    sides = np.array([[0.0, 4.0, 0.0], [0.0, -4.0, 0.0], [4.0, 0.0, 0.2]])
    seen = marker_visibility(BODY, state, points, sides)
    assert seen[0, at("l_wrist")] and not seen[0, at("r_wrist")]
    assert seen[1, at("r_hip")] and not seen[0, at("r_hip")]
    assert seen[2].all()  # all are seen from the front


def test_the_synthetic_detector_is_as_good_as_it_is_told():
    rng, detector = np.random.default_rng(0), SyntheticDetector(0.8, 10, 9.0)
    ideal = [np.full((1000, 2), 100.0), np.zeros((0, 2))]
    boxes = np.array([[[500, 500], [600, 700]], [[0, 0], [10, 10]]], float)
    counts, kept, off = [], [], []
    for _ in range(60):
        first, second = detect_synthetic(rng, ideal, detector, boxes)
        true = first[first[:, 0] < 300]
        kept.append(len(true))
        off.append(true - 100)
        counts += [len(first) - len(true), len(second)]
    assert np.mean(kept) == pytest.approx(800, rel=0.01)
    assert np.concatenate(off).var() == pytest.approx(9, rel=0.02)
    assert min(counts) >= 0 and max(counts) <= 20 and np.mean(counts) == pytest.approx(10, abs=1.7)
    assert all(len(one) == 0 for one in detect_synthetic(rng, [np.zeros((0, 2))], detector))
    with pytest.raises(InputError, match="detection_rate"):
        SyntheticDetector(1.2)


def test_the_ideal_detector_sees_true_places():
    truth = landmarks(BODY, standing())
    ideal, state = seen_by_ideal_detector(BODY, RIG, truth, standing(1))
    assert np.linalg.norm(landmarks(BODY, state) - truth, axis=1).max() < 0.02
    for uv, found in zip(project(RIG, truth)[0], ideal, strict=True):
        assert 5 < len(found) <= 15
        assert np.linalg.norm(found[:, None] - uv, axis=-1).min(axis=1).max() < 1e-9


def test_colored_blobs_are_found_and_others_not():
    rng = np.random.default_rng(3)
    scene = np.full((240, 320, 3), (110, 120, 115), np.uint8)
    cv2.rectangle(scene, (10, 10), (40, 40), (20, 220, 230), -1)  # as yellow as a marker, but part of the room
    places = np.array([[100.0, 60.0], [200.0, 150.0], [260.0, 90.0]])
    image = scene.copy()
    for u, v in places.astype(int):
        cv2.circle(image, (u, v), 3, (20, 220, 230), -1)
    cv2.circle(image, (150, 200), 6, (40, 40, 200), -1)  # red
    image = np.clip(image + rng.normal(0, 3, image.shape), 0, 255).astype(np.uint8)
    color = learn_marker_color([(image, places[:2] + 0.4)])
    found = detect_markers(image, color, background=scene)
    assert len(found) == 3
    assert np.linalg.norm(places[:, None] - found, axis=-1).min(axis=1).max() < 0.5
    assert len(detect_markers(image, color)) > 3
    assert detect_markers(scene, color, background=scene).shape == (0, 2)
    assert len(detect_markers(image, color, MarkerColorSettings(most=1))) == 1
    with pytest.raises(InputError, match="no labelled marker"):
        learn_marker_color([(image, np.array([[900.0, 20.0]]))])


def test_detections_come_back_from_their_table(tmp_path):
    table = DetectionTable(np.array([3, 3, 7]), np.array(["c0", "c1", "c0"]), np.array([[1.25, 2], [3, 4.5], [5, 6]]))
    write_detections(tmp_path / "d.csv", table)
    back = read_detections(tmp_path / "d.csv", RIG.names)
    np.testing.assert_array_equal(back.frames, table.frames)
    np.testing.assert_allclose(back.uv, table.uv)
    assert [len(uv) for uv in back.in_frame(3, RIG.names)] == [1, 1, 0, 0, 0]
    for text, message in (
        ("frame,camera,u\n1,c0,3\n", "no column 'v'"),
        ("frame,camera,u,v\n1,c9,3,4\n", "line 2: no camera named 'c9'"),
        ("frame,camera,u,v\n1,c0,3,\n", "line 2: `u` and `v` must be numbers"),
        ("frame,camera,u,v\n1.5,c0,3,4\n", "`frame` must be a whole number"),
    ):
        (tmp_path / "bad.csv").write_text(text)
        with pytest.raises(InputError, match=message):
            read_detections(tmp_path / "bad.csv", RIG.names)


# --- the filter


LEAN = MarkerPreset("lean", "for tests", annealed=AnnealedSettings(2, 150, 0.1, 0.5), drift_scale=0.4, refine=True, search=True)


def test_a_step_finds_the_pose_and_repeats_itself():
    truth = standing(2)
    seen = observe_markers(VIEWS, detections(landmarks(BODY, truth), noise=1.0), LEAN.likelihood.gate_px)
    start = truncated_normal(np.random.default_rng(9), truth, 0.3 * drift(30), BODY.limits.low, BODY.limits.high)
    begun = begin_tracking(SUBJECT, start)
    (one, info), (again, _) = (marker_frame(np.random.default_rng(1), begun, seen, LEAN) for _ in range(2))
    np.testing.assert_array_equal(one.state, again.state)
    assert info.status == "fitted" and np.isfinite(info.cost)
    assert np.linalg.norm(landmarks(BODY, one.state) - landmarks(BODY, truth), axis=1).mean() < 0.02


def test_exchanged_limbs_are_put_right_and_one_gone_astray_is_found():
    """Each from a pose that has taken other markers' detections, or false ones, for its own."""
    true = standing()
    seen = observe_markers(VIEWS, detections(landmarks(BODY, true), false=8, noise=1.0), GATE)
    astray = true.copy()
    astray[dof_index("r_shoulder_y", "r_elbow_z")] += -1.2, 0.8
    # A search by draws: of poses that are astray one draw in four may have none that is near.
    for wrong, least in ((swapped_pose(BODY, true, "legs"), 4), (astray, 3)):
        assert np.linalg.norm(landmarks(BODY, wrong) - landmarks(BODY, true), axis=1).max() > 0.15
        state, places = refine_to_points(BODY, seen, wrong, GATE)
        found = []
        for seed in range(4):
            better, points, choice = fit_all_points(np.random.default_rng(seed), BODY, seen, state, places, GATE)
            off = np.linalg.norm(landmarks(BODY, better) - landmarks(BODY, true), axis=1).max()
            found.append(off < 0.05 and np.nanmax(np.linalg.norm(points - landmarks(BODY, true), axis=1)) < 0.05)
            np.testing.assert_array_equal(choice.states[choice.costs.argmin()], better)
        assert sum(found) >= least


def test_limbs_are_told_apart_over_the_whole_motion():
    """A filter that now and then ends with exchanged legs; the motion before and after says which they are."""
    frames = list(range(16))
    states = np.repeat(standing()[None], len(frames), axis=0)
    states[:, 0] += 0.03 * np.array(frames)
    states[:, dof_index("l_hip_y", "r_hip_y")] += 0.4 * np.sin(np.arange(16) / 3)[:, None] * [1, -1]
    points = landmarks(BODY, states)
    rows = [
        (frame, name, uv)
        for frame in frames
        for name, seen in zip(RIG.names, detections(points[frame], false=2, seed=frame), strict=True)
        for uv in seen
    ]
    table = DetectionTable(*(np.array(column) for column in zip(*rows, strict=True)))
    method = marker_method(MARKER_PRESETS["default"], skin=False)

    def confused(rng, tracked, view):
        tracked, info = method.step(rng, tracked, view)
        if int(rng.integers(3)) or info.alternatives is None:
            return tracked, info
        return replace(tracked, state=info.alternatives.states[1]), info

    found = followed(table, len(frames), MARKER_PRESETS["default"], replace(method, step=confused))
    off = np.linalg.norm(found.poses.positions - points, axis=2)
    assert off.mean() < 0.03 and off.max() < 0.15


def test_without_markers_the_pose_stays():
    step, start = on_markers(MARKER_PRESETS["canton2009"]), begin_tracking(SUBJECT, standing(), np.ones(N_DOF), {TIPS: BODY.tips})
    nothing = PersonView(0, markers=observe_markers(VIEWS, [np.zeros((0, 2))] * 5, GATE))
    for view, why in ((nothing, "fewer than two views"), (PersonView(0), "no detections in this frame")):
        tracked, info = step(np.random.default_rng(0), start, view)
        np.testing.assert_array_equal(tracked.state, start.state)
        assert not tracked.velocity.any() and tracked.memory == start.memory
        assert why in info.status and np.isnan(info.cost)
    with pytest.raises(InputError, match="two cameras"):
        marker_views(Rig(RIG.cameras[:1]))


def walking_table(n=8, unseen=(5,)):
    """A person who moves aside and lowers an arm; the true landmarks, and detections in all frames but some."""
    frames = np.arange(n)
    states = np.array([standing() for _ in frames])
    states[:, 0] += 0.04 * frames
    states[:, dof_index("l_shoulder_x")] += 0.06 * frames[:, None]
    truth = landmarks(BODY, states)
    rows = [(frame, RIG.names[view], uv) for frame in frames for view, one in enumerate(detections(truth[frame], 2)) for uv in one]
    rows = [row for row in rows if row[0] not in unseen]
    return DetectionTable(np.array([r[0] for r in rows]), np.array([r[1] for r in rows]), np.array([r[2] for r in rows])), truth


def test_a_moving_person_from_a_table():
    table, truth = walking_table()
    people = followed(table, 8, LEAN)
    errors = np.linalg.norm(people.poses.positions - truth, axis=-1)
    assert np.isnan(errors[5]).all() and np.isnan(people.costs[5])
    assert np.delete(errors, 5, 0).mean() < 0.02
    assert people.notes == ("person 0: 1 frame without a pose: markers in fewer than two views",)


def test_a_table_in_which_nobody_is_gives_no_pose_and_says_so():
    people = followed(DetectionTable(np.zeros(0, int), np.zeros(0, str), np.zeros((0, 2))), 2, LEAN)
    assert np.isnan(people.poses.positions).all() and not people.states.bodies
    assert len(people.notes) == 1 and people.notes[0].startswith("person 0: 2 frames without a pose: ")


def views_from(table, n):
    return [PersonView(k, markers=observe_markers(VIEWS, table.in_frame(k, RIG.names), LEAN.likelihood.gate_px)) for k in range(n)]


def test_what_is_learnt_of_the_markers_places_is_remembered_from_frame_to_frame():
    """Markers worn elsewhere than the body has its joints: the start learns where, the steps keep it and the body stays."""
    frames, worn = np.arange(6), with_skin_markers(BODY)
    states = np.array([standing(seed) for seed in (2, 2, 2, 2, 2, 2)])
    states[:, 0] += 0.02 * frames
    rows = [
        (frame, RIG.names[view], uv)
        for frame, points in zip(frames, landmarks(worn, states), strict=True)
        for view, seen in enumerate(detections(points, 0))
        for uv in seen
    ]
    views = views_from(DetectionTable(*(np.array(column) for column in zip(*rows, strict=True))), 6)

    def rng(k):
        return np.random.default_rng([0, k])

    capture = Capture(30.0, room=ROOM, rig=RIG)
    started, at_joints = (MarkerStart(LEAN, skin)(rng, views, capture, 1.75) for skin in (True, False))
    learnt = started.memory[TIPS]
    assert learnt.shape == (15, 3) and np.linalg.norm(learnt - BODY.tips, axis=1).mean() > 0.01
    np.testing.assert_array_equal(at_joints.memory[TIPS], BODY.tips)
    np.testing.assert_array_equal(started.subject.body.tips, BODY.tips)
    tracked = begin_tracking(started.subject, started.state, memory=started.memory)
    after, info = on_markers(LEAN)(rng(started.anchor), tracked, views[started.anchor])
    assert info.status == "fitted" and "particles" in after.memory
    np.testing.assert_array_equal(after.memory[TIPS], learnt)
    np.testing.assert_array_equal(with_tips(after).tips, learnt)
    np.testing.assert_array_equal(with_tips(begin_tracking(SUBJECT, standing())).tips, BODY.tips)
    # The next frame differs without it: it is all of the past that a step reads beside pose and velocity.
    forgetful = replace(after, memory={name: values for name, values in after.memory.items() if name != TIPS})
    on, off = (marker_frame(rng(9), one, views[1].markers, LEAN)[0].state for one in (after, forgetful))
    assert np.abs(on - off).max() > 1e-3


def test_a_pose_that_has_been_without_markers_for_long_is_begun_anew():
    table, truth = walking_table(1, unseen=())
    (view,) = views_from(table, 1)
    recover = MarkerRecovery()
    astray = standing()
    astray[:2] += 1.2
    now, starts = begin_tracking(SUBJECT, astray, memory={TIPS: BODY.tips, **recover.first(np.ones(1))}), []
    for _ in range(12):
        before, stepped = now, (replace(now), StepInfo("too few markers where the body should have them"))
        now, _ = recover(np.random.default_rng([1, 2]), before, stepped, view)
        starts.append(np.linalg.norm(landmarks(BODY, now.state) - truth[0], axis=1).mean())
    assert min(starts[:9]) > 1 and max(starts[9:]) < 0.05
    np.testing.assert_array_equal(now.memory[TIPS], BODY.tips)
    # One frame with a pose between, and the count begins anew.
    now = begin_tracking(SUBJECT, astray, memory=recover.first(np.ones(1)))
    for k in range(14):
        info = StepInfo() if k == 7 else StepInfo("markers in fewer than two views")
        now, _ = recover(np.random.default_rng([1, 2]), now, (now, info), view)
        np.testing.assert_array_equal(now.state, astray)
