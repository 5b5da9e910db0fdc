"""Cameras out of time: shifts, dropped frames, drift, and those that fit at no time, of drawn people."""

import re
import shutil
import tomllib

import numpy as np
import pytest
from drawn import draw_recording, post, silhouette, walk
from hypothesis import given
from hypothesis import strategies as st

from hmc.check.sync.barcodes import barcode, shared_planes, unlikeness
from hmc.check.sync.courses import NONE, Course, best_course
from hmc.check.sync.evidence import Evidence, by_silhouettes, pack, unpack
from hmc.check.sync.find import find_synchrony
from hmc.check.sync.shifts import find_shifts
from hmc.cli import main
from hmc.io.recording import iterate_frames, open_recording

N = 90


def path_of(n):
    """Somebody who walks in an eight, faster and slower: metres, of n moments."""
    t = np.arange(n) * 0.09 + 0.4 * np.sin(np.arange(n) * 0.07)
    return np.column_stack([0.9 * np.sin(t), 0.8 * np.sin(0.63 * t + 1)])


@pytest.fixture(scope="module")
def views(ring):
    """Silhouettes of each camera at many moments, moments by cameras."""
    return [[silhouette(camera, x, y) for camera in ring] for x, y in path_of(N + 60)]


def found_of(ring, views, frames, reach=40):
    """What is found where each camera's files have these moments."""
    n = max(len(own) for own in frames)
    packed = [pack([views[own[k]][c] if k < len(own) else None for c, own in enumerate(frames)], ring) for k in range(n)]
    return find_synchrony(by_silhouettes(ring, packed, reach))


def test_planes_through_two_cameras_cut_both_views_alike(ring, views):
    for pair in ((0, 1), (1, 3), (2, 4)):
        first, second, n = shared_planes(ring, pair)
        rows = [barcode([views[t][c] for t in (0, 20, 40)], index, n) for c, index in zip(pair, (first, second), strict=True)]
        apart = unlikeness(*rows)
        assert np.diag(apart).max() < 0.06
        assert apart[~np.eye(3, dtype=bool)].min() > np.diag(apart).max()


def test_cameras_in_one_place_share_no_plane(ring):
    assert shared_planes(ring, (1, 1)) is None


def test_silhouettes_are_kept_as_they_were(ring, views):
    np.testing.assert_array_equal(unpack(pack(views[3], ring)[2]), views[3][2])
    assert unpack(pack([None] * 5, ring)[0]) is None


@pytest.mark.parametrize("shifts", [(0, 0, 0, 0, 0), (0, 7, 0, -12, 0), (3, -4, 20, 0, 9)])
def test_shifts_are_found(ring, views, shifts):
    found = found_of(ring, views, [range(25 + 0 - shift, 25 - shift + N) for shift in shifts])
    assert [one.status for one in found.cameras] == ["sure"] * 5
    middle = int(np.median(shifts))
    assert [one.course for one in found.cameras] == [Course(shift - middle) for shift in shifts]
    assert all(abs(one.fraction) < 0.35 for one in found.cameras)
    assert found.in_time == (not any(shifts))


def test_half_a_frame_is_seen(ring):
    places = path_of(2 * N + 2)
    views = [[silhouette(camera, *places[2 * k + (c == 1)]) for c, camera in enumerate(ring)] for k in range(N)]
    found = find_synchrony(by_silhouettes(ring, [pack(frame, ring) for frame in views], 20))
    ahead = found.cameras[1].course.shift + found.cameras[1].fraction
    assert abs(ahead + 0.5) < 0.2 and all(abs(found.cameras[c].fraction) < 0.2 for c in (0, 2, 3, 4))


def test_dropped_frames_are_found_where_they_were(ring, views):
    frames = [list(range(N)) for _ in range(5)]
    frames[2] = [t for t in range(N + 3) if t not in (30, 60, 61)]
    found = found_of(ring, views, frames)
    steps = found.cameras[2].course.steps
    assert [change for _, change in steps] == [-1, -2] and found.cameras[2].course.shift == 0
    assert abs(steps[0][0] - 31) <= 1 and abs(steps[1][0] - 62) <= 1
    assert all(found.cameras[c].course == Course() for c in (0, 1, 3, 4))


def test_where_nobody_moves_a_dropped_frame_may_be_anywhere():
    places = np.concatenate([np.arange(30), np.full(30, 29), np.arange(29, 59)])  # walks, stands, and walks on
    own = np.delete(places, 45)[:-1]
    n = len(own)
    costs = np.full((n, 41), np.nan)
    for k in range(-20, 21):
        there = (np.arange(n) + k >= 0) & (np.arange(n) + k < n)
        costs[there, k + 20] = np.minimum(np.abs(places[:n][there] - own[np.arange(n)[there] + k]), 6) / 20 + 0.02
    course, _ = best_course(costs)
    assert [change for _, change in course.steps] == [-1] and course.shift == 0
    low, high = course.spans[0]
    assert 24 <= low <= 32 and 57 <= high <= 65


@pytest.mark.parametrize(("dropped", "placed"), [((40, 40, 40), True), ((12, 45, 85), False)])
def test_where_others_do_not_agree_a_dropped_frame_is_not_placed(dropped, placed):
    """Cameras of which each says, of a fourth, where a frame of it is missing; all others are in time."""
    n, reach = 100, 20
    apart = np.minimum(np.abs(np.arange(-reach, reach + 1)), 6) / 20 + 0.02
    bands = {pair: np.tile(apart, (n, 1)) for pair in ((0, 1), (0, 2), (1, 2))}
    for c, moment in enumerate(dropped):
        own = np.arange(n) - (np.arange(n) >= moment)  # the frame of the fourth at each moment
        there = np.arange(n)[:, None] + np.arange(-reach, reach + 1)
        bands[c, 3] = np.minimum(np.abs(there - own[:, None]), 6) / 20 + 0.02
    found = find_synchrony(Evidence(4, n, reach, bands)).cameras
    assert all(one.course == Course() and one.unplaced == 0 for one in found[:3])
    assert (found[3].unplaced == 0, bool(found[3].course.steps)) == (placed, placed)
    if placed:
        assert [change for _, change in found[3].course.steps] == [-1] and abs(found[3].course.steps[0][0] - 40) <= 1
    else:
        assert found[3].unplaced == 1 and found[3].doubt >= 1


def apart_from(own, reach, floor=0.02, slope=0.05):
    """How unlike each frame about a moment is, where the frame of that moment is `own`."""
    there = np.arange(len(own))[:, None] + np.arange(-reach, reach + 1)
    return np.minimum(np.abs(there - own[:, None]), 6) * slope + floor


def test_a_pair_that_is_unlike_at_any_time_counts_for_little():
    """Two cameras tell of a frame that the fourth lacks; by the third, before which furniture stands, nothing is missing."""
    n, reach = 100, 20
    even, own = np.arange(n), np.arange(n) - (np.arange(n) >= 40)
    bands = {pair: apart_from(even, reach) for pair in ((0, 1), (0, 2), (1, 2))}
    bands |= {(0, 3): apart_from(own, reach), (1, 3): apart_from(own, reach), (2, 3): apart_from(even, reach, 0.3, 0.15)}
    found = find_synchrony(Evidence(4, n, reach, bands)).cameras
    assert all(one.course == Course() for one in found[:3])
    ((moment, change),) = found[3].course.steps
    assert (found[3].status, found[3].course.shift, change) == ("sure", 0, -1) and abs(moment - 40) <= 1


def test_while_somebody_stands_it_is_all_one_where_a_frame_was_dropped():
    """Somebody walks, stands for long, and walks on; by each camera the frame is missing at another moment of standing."""
    places = np.concatenate([np.arange(25), np.full(80, 25), np.arange(25, 50)])
    n, reach = len(places) - 1, 20
    own = np.delete(places, 60)
    bands = {}
    for pair, seems in {(0, 3): 27, (1, 3): 60, (2, 3): 100, (0, 1): None, (0, 2): None, (1, 2): None}.items():
        other = places[:n] if seems is None else own
        there = np.arange(n)[:, None] + np.arange(-reach, reach + 1)
        known = (there >= 0) & (there < n)
        apart = np.minimum(np.abs(places[:n, None] - other[there.clip(0, n - 1)]), 6) / 20 + 0.02
        if seems is not None:  # what silhouettes are off by
            best = np.arange(n) - (np.arange(n) >= seems)
            apart[25:104] += 0.002 * (there != best[:, None])[25:104]
        bands[pair] = np.where(known, apart, np.nan)
    found = find_synchrony(Evidence(4, n, reach, bands)).cameras
    assert found[3].unplaced == 0 and [change for _, change in found[3].course.steps] == [-1] and found[3].course.shift == 0
    assert 25 <= found[3].course.steps[0][0] <= 105
    assert all(one.course == Course() for one in found[:3])


def test_a_clock_that_drifts_is_found(ring):
    places = np.column_stack([np.interp(np.arange(4 * 310) / 4, np.arange(320), axis) for axis in path_of(320).T])
    n = 300
    views = [[silhouette(camera, *places[round(4 * k * (1.0045 if c == 3 else 1))]) for c, camera in enumerate(ring)] for k in range(n)]
    found = find_synchrony(by_silhouettes(ring, [pack(frame, ring) for frame in views], 20))
    own = found.cameras[3].course.moments(np.arange(n))
    assert found.cameras[3].course.slope == pytest.approx(-0.0045 / 1.0045, abs=0.001)
    assert np.abs(own - 1.0045 * np.arange(n)).max() < 0.5
    assert all(found.cameras[c].course == Course() for c in (0, 1, 2, 4))


def test_a_camera_of_another_recording_fits_at_no_time(ring, views):
    frames = [list(range(N)) for _ in range(5)]
    other = [[silhouette(camera, y - 0.3, x) for camera in ring] for x, y in path_of(N + 60)[::-1] * (1, 0.7)]
    mixed = [[*view[:4], strange[4]] for view, strange in zip(views, other, strict=True)]
    found = found_of(ring, mixed, frames)
    assert found.cameras[4].status != "sure" and found.cameras[4].course == Course()
    assert all(one.status == "sure" and one.course == Course() for one in found.cameras[:4])


def test_nobody_who_moves_tells_nothing(ring):
    still = [pack([silhouette(camera, 0.3, 0.1) for camera in ring], ring)] * N
    empty = [pack([np.zeros((120, 160), bool)] * 5, ring)] * N
    for packed in (still, empty):
        found = find_synchrony(by_silhouettes(ring, packed, 20))
        assert not found.known and found.in_time
        assert {one.status for one in found.cameras} == {"weak"}


@given(st.integers(2, 6), st.lists(st.integers(-9, 9), min_size=2, max_size=6), st.integers(0, 3))
def test_shifts_of_exact_curves(n, shifts, strangers):
    """Any shifts, and some pairs of which nothing is known."""
    n = len(shifts)
    reach = 20
    curves = np.full((n, n, 2 * reach + 1), np.nan)
    for i in range(n):
        for j in range(n):
            if i != j and not (n > 3 and {i, j} <= set(range(strangers - 1))):
                curves[i, j] = np.minimum(np.abs(np.arange(-reach, reach + 1) - (shifts[j] - shifts[i])), 8) / 10
    found = find_shifts(curves)
    np.testing.assert_array_equal(found - found[0], np.array(shifts) - shifts[0])


@given(
    st.integers(-5, 5),
    st.lists(st.tuples(st.integers(5, 12), st.integers(-4, 4).filter(bool)), max_size=4),
)
def test_a_course_turned_round_is_itself(shift, gaps):
    moment, steps = 0, []
    for gap, change in gaps:
        moment += gap + 4
        steps.append((moment, change))
    course = Course(shift, tuple(steps))
    frames = course.frames(moment + 10)
    there = frames != NONE
    np.testing.assert_allclose(course.moments(frames[there]), np.flatnonzero(there))
    every = course.moments(np.arange(frames[there].min(), frames[there].max() + 1))
    assert (np.diff(every) > 0).all()


def test_noise_makes_no_course():
    rng = np.random.default_rng(0)
    for _ in range(10):
        costs = 0.02 + 0.01 * np.abs(np.arange(-20, 21)) + rng.normal(0, 0.01, (N, 41)).cumsum(axis=1) * 0.2
        assert best_course(costs)[0] == Course() or best_course(costs)[1] < 0.25


@pytest.fixture(scope="module")
def proper(ring, tmp_path_factory):
    return draw_recording(tmp_path_factory.mktemp("sync") / "proper", ring, [[tuple(place)] for place in path_of(70)], shape=post)


def out_of_time(proper, folder, changes):
    """The recording with images numbered anew: of each camera, the moments that it has."""
    shutil.copytree(proper, folder)
    for name, moments in changes.items():
        shutil.rmtree(folder / "images" / name)
        (folder / "images" / name).mkdir()
        for place, moment in enumerate(moments):
            shutil.copy(proper / "images" / name / f"{moment:06d}.png", folder / "images" / name / f"{place:06d}.png")
    return folder


def test_the_command_mends_a_recording(proper, tmp_path, capsys):
    dropped = [t for t in range(70) if t != 40]
    folder = out_of_time(proper, tmp_path / "late", {"cam_01": range(6, 70), "cam_03": dropped})
    text = (folder / "recording.toml").read_text()
    words = ["sync", str(folder), "--out", str(tmp_path / "a.png")]
    assert main([*words, "--dry-run"]) == 0
    assert (folder / "recording.toml").read_text() == text and "(--dry-run)" in capsys.readouterr().out
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "written: `first_frame`" in said and (tmp_path / "a.png").stat().st_size > 10_000
    assert (folder / "recording_before.toml").read_text() == text
    settings = tomllib.loads((folder / "recording.toml").read_text())
    assert settings.pop("first_frame") == {"cam_00": 6, "cam_01": 0, "cam_02": 6, "cam_04": 6} and settings == tomllib.loads(text)
    assert re.search(r"'cam_03': frames are missing before its frame (39|40|41)", said)
    recording = open_recording(folder)
    lost = [frame.index for frame in iterate_frames(recording) if frame.images[3] is None]
    assert len(lost) == 1 and abs(lost[0] - 34) <= 1
    assert recording._own_views[3].in_file(60) == 65
    assert said.endswith(f"next: hmc check {folder}\n")
    assert main(words) == 0
    assert capsys.readouterr().out.endswith(f"in time already; nothing is written\nnext: hmc pose {folder} --out late-result\n")


def test_a_trial_of_a_session_is_mended_in_its_own_folder(proper, tmp_path, capsys):
    lab = tmp_path / "lab"
    trial, session = out_of_time(proper, lab / "trials" / "walk", {"cam_01": range(6, 70)}), lab / "session.toml"
    (trial / "calibration.toml").rename(lab / "calibration.toml")
    (trial / "recording.toml").unlink()
    text = 'calibration = "calibration.toml"\ntrials = "trials/*"\n[recording]\nfps = 25\nfirst_frame = { cam_01 = 1 }\n'
    session.write_text(text)
    words = ["sync", str(trial), "--session", str(session), "--out", str(tmp_path / "a.png")]
    assert main(words) == 0
    assert capsys.readouterr().out.endswith(f"next: hmc check {trial} --session {session}\n")
    assert session.read_text() == text
    others = {"cam_00": 6, "cam_02": 6, "cam_03": 6, "cam_04": 6}
    assert tomllib.loads((trial / "recording.toml").read_text()) == {"first_frame": {**others, "cam_01": 0}}
    assert main(words) == 0
    assert capsys.readouterr().out.endswith(f"next: hmc pose {trial} --session {session} --out walk-result\n")


def test_the_command_says_where_there_is_too_little_to_go_by(ring, tmp_path, capsys):
    folder = draw_recording(tmp_path / "still", ring, [[(0.2, 0.1)]] * 24)
    before = sorted(path.name for path in folder.iterdir())
    assert main(["sync", str(folder), "--out", str(tmp_path / "a.png")]) == 0
    assert "too little to go by" in capsys.readouterr().out
    assert sorted(path.name for path in folder.iterdir()) == before


def test_one_camera_has_nothing_to_be_in_time_with(ring, tmp_path, capsys):
    folder = draw_recording(tmp_path / "one", type(ring)(tuple(ring)[:1]), walk(20))
    assert main(["sync", str(folder), "--out", str(tmp_path / "a.png")]) == 0
    assert "too little to go by" in capsys.readouterr().out


def test_a_recording_that_is_not_there(tmp_path, capsys):
    assert main(["sync", str(tmp_path / "none")]) == 2
    assert "no such folder" in capsys.readouterr().err
