"""Left and right exchanged in some cameras: the best pattern of a frame, and which of it and its complement is right over time."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.body.keypoint_places import BODY_KEYPOINTS, KEYPOINT_SEGMENTS, MIRRORED, keypoint_places
from hmc.body.kinematics import segment_transforms
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.camera.model import Rig, look_at, project
from hmc.io.keypoints.layouts import KEYPOINTS
from hmc.io.results import TrackTable
from hmc.pose import keypoint_sides
from hmc.pose.keypoint_cues import learn_scatter, with_keypoints
from hmc.pose.keypoint_sides import exchanged_sides, kept
from hmc.pose.views import exchanged_sides as one_frame
from hmc.pose.views.exchanged_sides import pattern_scores, patterns_of, sides_of_frame
from hmc.pose.views.keypoints import lines_of_people
from hmc.pose.views.person_view import PersonView

BODY = default_body(1.75)
OF_BODY = [KEYPOINTS.index(name) for name in BODY_KEYPOINTS]
FPS, NOISE_PX = 30, 1.0


def rig_of(cameras, height=2.0, degrees=360.0):
    angles = np.radians(np.arange(cameras) * degrees / cameras)
    return Rig(tuple(look_at(f"c{k}", (640, 480), [4 * np.cos(a), 4 * np.sin(a), height], [0, 0, 0.9], 60) for k, a in enumerate(angles)))


def walk(n, turn_rad=0.6):
    """Places of keypoints of somebody who walks and turns, (n, 15, 3), metres."""
    states = np.tile(neutral_state("down", BODY.limits), (n, 1))
    time = np.arange(n) / FPS
    states[:, 0], states[:, 2], states[:, 3] = 0.5 * time - 0.5, 0.95, turn_rad * np.linspace(0, 1, n)
    swing = 0.4 * np.sin(2 * np.pi * 0.9 * time)[:, None]
    states[:, 6:] = np.clip(states[:, 6:] + swing * np.random.default_rng(5).choice([-1, 1], states.shape[1] - 6) * 0.5, *limits())
    rotations, positions = segment_transforms(BODY, states)
    return positions[:, KEYPOINT_SEGMENTS] + (rotations[:, KEYPOINT_SEGMENTS] @ keypoint_places(BODY)[..., None])[..., 0]


def limits():
    return BODY.limits.low[6:], BODY.limits.high[6:]


def detected(rig, points, rng, exchanged=()):
    out = []
    for c, camera in enumerate(rig):
        uv = project(camera, points)[0] + NOISE_PX * rng.standard_normal((15, 2))
        one = np.column_stack([uv, np.ones(15)])
        out.append((one[MIRRORED] if c in exchanged else one)[None])
    return out


class Drawn:
    """A source of drawn detections: a frame's exchanged cameras are ``exchanged[frame]``; frames of ``blank`` show nobody."""

    def __init__(self, rig, points, exchanged=None, blank=(), seed=0):
        rng, exchanged = np.random.default_rng(seed), exchanged or {}
        self.frames = [detected(rig, one, rng, exchanged.get(k, ())) for k, one in enumerate(points)]
        self.blank = blank

    def frame(self, index):
        whole = [np.full((len(one), len(KEYPOINTS), 3), np.nan) for one in self.frames[index]]
        for out, one in zip(whole, self.frames[index], strict=True):
            out[:, OF_BODY] = one
        return tuple(one[:0] if index in self.blank else one for one in whole)


def tracks_of(points):
    return TrackTable(np.arange(len(points)), np.zeros(len(points), int), points.mean(axis=1))


def turned_of(rig, points, exchanged=None, blank=(), seed=0):
    """What is found to be exchanged, by frame."""
    found = exchanged_sides(rig, tracks_of(points), Drawn(rig, points, exchanged, blank, seed), FPS)
    return {frame: tuple(np.flatnonzero(people[0]).tolist()) for frame, people in found.items()}


def lines(rig, given, points):
    own = lines_of_people(rig, given, {0: points.mean(axis=0)})[0]
    return rig.centres, own.directions, own.deviation_m


# --- one frame


def test_scores_of_patterns_are_those_of_a_plain_loop():
    rig, points = rig_of(4), walk(3)[1]
    rng = np.random.default_rng(1)
    given = detected(rig, points, rng, (1,))
    given[2][0, 3], given[0][0, 7, :2] = np.nan, given[0][0, 7, :2] + 50
    centres, directions, deviation = lines(rig, given, points)
    expected = []
    for pattern in patterns_of(4):
        of = [MIRRORED if turned else np.arange(15) for turned in pattern]
        score = 0.0
        for k in np.flatnonzero(MIRRORED != np.arange(15)):
            best = 9.0 * 4
            for i, j in combinations(range(4), 2):
                one, other = directions[i, of[i][k]], directions[j, of[j][k]]
                if np.isnan([one, other]).any():
                    continue
                along = np.linalg.lstsq(np.column_stack([one, -other]), centres[j] - centres[i], rcond=None)[0]
                if (along <= 0).any() or np.linalg.norm(np.cross(one, other)) < 0.05:
                    continue
                point = (centres[i] + along[0] * one + centres[j] + along[1] * other) / 2
                total = 0.0
                for c in range(4):
                    off = np.linalg.norm(np.cross(point - centres[c], directions[c, of[c][k]])) / deviation[c, of[c][k]]
                    total += 9.0 if np.isnan(off) else min(off, 3.0) ** 2
                best = min(best, total)
            score += best
        expected.append(score)
    found = pattern_scores(centres, directions, deviation, patterns_of(4))
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert patterns_of(4)[found.argmin()].tolist() == [False, True, False, False]


@pytest.mark.parametrize("cameras, exchanged", [(4, (2,)), (5, (0, 3)), (7, (1, 2, 5)), (12, (0, 4, 5, 9, 11))])
def test_one_frame_tells_the_fewer_cameras(cameras, exchanged, monkeypatch):
    """All patterns of few cameras, and those that pairs suggest of many, of as many too."""
    rig, points = rig_of(cameras), walk(3)[1]
    given = lines(rig, detected(rig, points, np.random.default_rng(2), exchanged), points)
    sides = sides_of_frame(*given)
    assert tuple(np.flatnonzero(sides.turned)) == exchanged and sides.told.all()
    assert np.abs(sides.points - points).max() < 0.05
    monkeypatch.setattr(one_frame, "ALL_PATTERNS", 1)
    assert (sides_of_frame(*given).turned == sides.turned).all()


def test_a_camera_that_agrees_with_nobody_is_not_told_of():
    rig, points = rig_of(5), walk(3)[1]
    rng = np.random.default_rng(3)
    given = detected(rig, points, rng, (1,))
    given[3][0, :, :2] = given[3][0, rng.permutation(15), :2]
    sides = sides_of_frame(*lines(rig, given, points))
    assert sides.turned.tolist() == [False, True, False, False, False] and not sides.told[3]


def test_where_little_speaks_for_a_turn_there_is_none(monkeypatch):
    """Two cameras as high as the person's middle: level ways from right to left lie in the plane of both lines."""
    rig = rig_of(2, height=0.9, degrees=180)

    def n_turned():
        wrong = 0
        for seed, points in enumerate(walk(20)):
            rng = np.random.default_rng(seed)
            given = detected(rig, points, rng)
            for one in given:
                one[..., :2] += rng.normal(0, 6, (15, 2))
            wrong += sides_of_frame(*lines(rig, given, points)).turned.any()
        return wrong

    assert n_turned() == 0
    monkeypatch.setattr(one_frame, "TURN_COST", 0.0)
    assert n_turned() > 0


@pytest.mark.parametrize("seen", [0, 1])
def test_no_two_cameras_tell_nothing(seen):
    rig, points = rig_of(4), walk(3)[1]
    centres, directions, deviation = lines(rig, detected(rig, points, np.random.default_rng(0)), points)
    directions[seen:] = np.nan
    sides = sides_of_frame(centres, directions, deviation)
    assert not sides.turned.any() and not sides.told.any()


# --- over time


@pytest.mark.parametrize("exchanged", [(0, 1), (1, 2), (2, 3), (3,), (0, 1, 3), (0, 1, 2, 3)])
def test_what_is_exchanged_for_half_a_second_is_turned_back(exchanged):
    points = walk(60)
    expected = dict.fromkeys(range(20, 35), exchanged)
    assert turned_of(rig_of(4), points, expected) == expected


def test_few_detections_are_exchanged(monkeypatch):
    """Which of both halves of the cameras it is at the end of a clip is told by the frames before, where none is rarer than all."""
    points, expected = walk(60), dict.fromkeys(range(45, 60), (0, 1))
    assert turned_of(rig_of(4), points, expected) == expected
    monkeypatch.setattr(keypoint_sides, "TURNED_COST", 0.0)
    assert turned_of(rig_of(4), points, expected) != expected


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 5), st.floats(-6, 6))
def test_without_an_exchange_nothing_is_turned(seed, cameras, turn_rad):
    rig = rig_of(cameras, degrees=360 if cameras > 2 else 180)
    assert not turned_of(rig, walk(30, turn_rad), seed=seed)


def test_somebody_who_turns_about_within_a_second_has_exchanged_nothing():
    points = walk(60, 2 * np.pi)  # half a turn a second
    left, right = BODY_KEYPOINTS.index("l_hip"), BODY_KEYPOINTS.index("r_hip")
    assert np.dot(points[0, left] - points[0, right], points[30, left] - points[30, right]) < 0
    assert not turned_of(rig_of(4), points)
    assert turned_of(rig_of(4), points, dict.fromkeys(range(25, 40), (0, 2))) == dict.fromkeys(range(25, 40), (0, 2))


def test_who_turned_about_unseen_has_exchanged_nothing(monkeypatch):
    before, after = walk(70, 0.0)[:10], walk(70, 0.0)[60:]
    after = 2 * after.mean(axis=(0, 1)) * [1, 1, 0] + after * [-1, -1, 1]  # by 180 degrees
    points = np.concatenate([before, np.repeat(before[-1:], 60, axis=0), after])
    blank = range(10, 70)
    assert not turned_of(rig_of(4), points, blank=blank)
    monkeypatch.setattr(keypoint_sides, "WAY_M_S", 0.0)
    assert turned_of(rig_of(4), points, blank=blank)


def test_one_way_that_is_wrong_does_not_outweigh_the_others():
    ways = np.tile([0.0, 0.3, 0.0], (7, 1))
    after = ways.copy()
    after[0] = -5.0, -5.0, 0.0
    after[6] = np.nan
    # The way that is not known counts alike for both.
    np.testing.assert_allclose(kept(ways, np.array([after, -after]), 1 / FPS), [9 + 4.5, 6 * 9 + 4.5])


@pytest.mark.parametrize("exchanged", [(0,), (1,), (0, 1)])
def test_two_level_cameras_are_told_by_the_frames_before_and_after(exchanged, monkeypatch):
    """One frame has none, one or the other exchanged about as likely: lines meet in the wrong corners as well."""
    rig, points = Rig(rig_of(8, height=1.0).cameras[:2]), walk(60)
    expected = dict.fromkeys(range(20, 35), exchanged)
    assert turned_of(rig, points, expected) == expected
    if len(exchanged) == 1:
        monkeypatch.setattr(one_frame, "MOST_PATTERNS", 1)
        assert turned_of(rig, points, expected) != expected


def test_views_have_what_was_decided():
    """Two of four cameras exchanged: one frame would not tell which."""
    rig, points = rig_of(4), walk(60)
    source, tracks = Drawn(rig, points, dict.fromkeys(range(20, 35), (0, 1))), tracks_of(points)
    cues = learn_scatter(rig, tracks, source, FPS)
    for frame in (19, 20, 34, 35):
        seen = with_keypoints({0: PersonView(frame)}, rig, tracks, cues)[0].keypoints
        assert np.abs(seen.points - points[frame]).max() < 0.05
        assert np.linalg.norm(seen.missed(points[frame]), axis=1).max() < 0.1
    assert learn_scatter(rig.select(rig.names[:1]), tracks, Alone(source), FPS).turned == {}


class Alone:
    """The first camera of a source."""

    def __init__(self, source):
        self.source = source

    def frame(self, index):
        return self.source.frame(index)[:1]
