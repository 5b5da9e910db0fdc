"""The page of a result: its numbers against the result's own, and what a real browser makes of it."""

import base64
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from hmc.body.joints import DOF_NAMES, dof_index
from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.errors import InputError
from hmc.io.recording import open_recording
from hmc.io.results import PoseStates, PoseTable, TrackTable
from hmc.view.mosaic import Result
from hmc.view.overlay import cone_rings
from hmc.view.page.packed import MISSING, pack_fixed
from hmc.view.page.people import MOST_ROWS, chosen_frames
from hmc.view.page.write import write_page
from hmc.view.write import write_view

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def body():
    return default_body(1.75)


def posed(body, frames=12, persons=(0, 1)):
    """Two people who walk beside each other; the second is not there in the first frames, and a forearm of theirs is not known."""
    rows = [(frame, person) for frame in range(frames) for person in persons if person == 0 or frame >= 3]
    states = np.array([neutral_state("down", body.limits)] * len(rows))
    index, number = np.array(rows).T
    states[:, 0], states[:, 1], states[:, 2] = 0.05 * index - 0.3, 0.9 * number - 0.4, 1.0
    states[:, 3] = 0.1 * index
    states[:, dof_index("l_elbow_z")] = 0.8
    places = landmarks(body, states)
    views = np.where((index[:, None] + np.arange(15)) % 5 == 0, 1.0, 4.0)
    states[(number == 1) & (index > 8), dof_index("r_elbow_z")] = np.nan
    table = PoseStates(index, number, states, DOF_NAMES, {int(one): body.dimensions for one in persons}, costs=0.01 * index)
    return Result(PoseTable(index, number, places, views), TrackTable(index, number, places[:, 0]), table, dict.fromkeys(persons, body))


def data_of(page):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL).group(1))


def unpacked(packed):
    raw = np.frombuffer(base64.b64decode(packed["data"]), "<" + packed["type"]).reshape(packed["shape"])
    return np.where(raw == MISSING, np.nan, raw * packed["step"]) if "step" in packed else raw


@pytest.fixture(scope="module")
def written(tmp_path_factory, body):
    """A page of a drawn recording with both people, with its result."""
    recording = drawn_recording(tmp_path_factory.mktemp("page") / "a <b> & c")
    result = posed(body)
    out = recording.path.parent / "page.html"
    write_view(out, recording, result, (), None)
    return out, result


def drawn_recording(folder):
    """Three cameras, twelve frames, each brighter than the one before."""
    from conftest import write_images

    from hmc.camera.model import Rig, look_at
    from hmc.io.calibration import write_calibration

    folder.mkdir()
    rig = Rig(tuple(look_at(f"cam_{i:02d}", (160, 120), [3.5 * np.cos(i), 3.5 * np.sin(i), 2.0], [0, 0, 0.9], 70) for i in range(3)))
    write_calibration(folder / "calibration.toml", rig)
    for name in rig.names:
        write_images(folder / "images" / name, range(12), (160, 120))
    return open_recording(folder)


def test_what_a_page_holds_is_the_result(written, body):
    path, result = written
    data = data_of(path.read_text(encoding="utf-8"))
    assert data["count"] == 12 and len(data["people"]) == 2 and len(data["moments"]) == 12
    for person in data["people"]:
        table = result.poses.of(person["number"])
        places, views, costs = unpacked(person["landmarks"]), unpacked(person["views"]), unpacked(person["costs"])
        assert_allclose(places[table.frames], table.positions, atol=0.6e-3)
        assert_array_equal(views[table.frames], table.views)
        assert np.isnan(places[np.setdiff1d(np.arange(12), table.frames)]).all()
        assert_allclose(costs[table.frames], 0.01 * table.frames, rtol=1e-6)


def test_flesh_lies_where_the_overlay_draws_it_and_what_is_unknown_is_left_out(written, body):
    path, result = written
    person = data_of(path.read_text(encoding="utf-8"))["people"][1]
    rings, segments, turns, places = (unpacked(person[name]) for name in ("rings", "segments", "turns", "places"))
    for frame in (5, 10):
        state = result.states.states[(result.states.frames == frame) & (result.states.persons == 1)][0]
        lost = np.isnan(places[frame]).any(axis=-1)
        assert lost.sum() == (frame > 8)  # the right forearm
        there = ~lost[segments]
        turned = [Rotation.from_quat(turns[frame, s]).apply(ring) + places[frame, s] for ring, s in zip(rings, segments, strict=True)]
        drawn = cone_rings(body, np.nan_to_num(state))
        for ours, theirs in zip(np.array(turned)[there], drawn[there], strict=True):
            assert_allclose(ours[0], theirs[0], atol=2e-3)  # the first point of each ring is at angle 0
            assert_allclose(ours[12], theirs[16], atol=2e-3)


class Links(HTMLParser):
    """What a page would fetch."""

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        self.found += [value for name, value in attrs if name in ("src", "href", "data")]


def test_a_page_fetches_nothing_and_no_name_leaves_its_place(written):
    page = written[0].read_text(encoding="utf-8")
    links = Links()
    links.feed(page)
    assert links.found == [] and "a &lt;b&gt; &amp; c" in page and "a <b>" not in page
    assert not re.search(r"https?://", page)


def test_images_are_small_and_of_the_moments(written):
    moments = data_of(written[0].read_text(encoding="utf-8"))["moments"]
    assert [one["frame"] for one in moments] == list(range(12))
    image = cv2.imdecode(np.frombuffer(base64.b64decode(moments[4]["images"][1].partition(",")[2]), np.uint8), cv2.IMREAD_COLOR)
    assert image.shape == (120, 160, 3)
    assert abs(int(np.median(image)) - 60) < 6  # frame 4 of the drawn images has brightness 40 + 5 x 4


def test_long_results_show_every_second_frame_or_fewer():
    n = 3 * MOST_ROWS + 1
    track = TrackTable(np.arange(n), np.zeros(n, int), np.zeros((n, 3)))
    frames = chosen_frames(Result(tracks=track), 0, n)
    assert len(frames) <= MOST_ROWS and (np.diff(frames) == 4).all()
    assert len(chosen_frames(Result(tracks=track), 5, 100)) == 100


def test_numbers_of_sixteen_bits_know_what_is_missing_and_do_not_wrap():
    packed = pack_fixed(np.array([0.0, np.nan, 1e9, -1e9, 0.0014]), 1e-3)
    assert_allclose(unpacked(packed), [0, np.nan, 32.767, -32.767, 0.001])


def test_a_result_without_people_is_refused(written, tmp_path, recording_folder):
    result = replace(written[1], states=None, poses=None, tracks=written[1].tracks.where(np.zeros(21, bool)))
    with pytest.raises(InputError, match="has nobody in frames 0 to 11"):
        write_page(tmp_path / "a.html", open_recording(recording_folder), result, None)
    assert not (tmp_path / "a.html").exists()


def browsed(page, *more):
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--virtual-time-budget=4000", *more]
    return subprocess.run([*command, page.as_uri()], capture_output=True, text=True, timeout=180, check=True)


@pytest.mark.skipif(BROWSER is None, reason="there is no Chromium")
def test_a_browser_shows_it_without_a_fault(written, tmp_path):
    done = browsed(written[0], "--dump-dom", "--window-size=1200,800")
    head = re.search(r"<body[^>]*>", done.stdout).group()
    assert 'data-people="2"' in head and 'data-frames="12"' in head and 'data-cameras="3"' in head and "fault" not in head
    assert "CONSOLE" not in done.stderr
    assert "2 people, 12 frames (0 to 11), 3 cameras" in done.stdout
    assert done.stdout.count("<figcaption>cam_0") == 3 and done.stdout.count('src="data:image/jpeg;base64,') == 3


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="there is no Chromium")
@pytest.mark.parametrize("size", [(1200, 800), (500, 1400)])
def test_people_are_seen_in_their_colors(written, tmp_path, size):
    browsed(written[0], f"--screenshot={tmp_path / 'a.png'}", "--window-size={},{}".format(*size), "--hide-scrollbars")
    picture = cv2.imread(str(tmp_path / "a.png"))
    assert picture.shape[:2] == size[::-1]
    green, violet = (np.abs(picture.astype(int) - color).max(axis=-1) < 60 for color in ((110, 230, 120), (235, 110, 220)))
    assert green.sum() > 300 and violet.sum() > 300


def test_a_file_of_rerun_is_read_by_its_own_reader(tmp_path, body):
    reader = pytest.importorskip("rerun.chunk", exc_type=ImportError)
    result = posed(body)
    write_view(tmp_path / "a.rrd", drawn_recording(tmp_path / "walk"), result, (), None)
    chunks = list(reader.RrdReader(tmp_path / "a.rrd").stream().to_chunks())
    paths = {str(chunk.entity_path) for chunk in chunks}
    assert {"/world/people/0/bones", "/world/people/1/landmarks", "/world/cameras/cam_02", "/images/cam_00", "/angles/0/l_elbow_z"} <= paths
    read = {}
    for chunk in chunks:
        table = chunk.to_record_batch().to_pydict()
        column = next((name for name in table if name.endswith("Points3D:positions")), None)
        if str(chunk.entity_path) == "/world/people/1/landmarks" and column is not None:
            read |= {frame: np.array(points) for frame, points in zip(table["frame"], table[column], strict=True) if points}
    table = result.poses.of(1)
    assert sorted(read) == table.frames.tolist()
    for frame, places in zip(table.frames.tolist(), table.positions, strict=True):
        assert_allclose(read[frame], places, atol=1e-5)
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["a.rrd"]


def test_without_rerun_a_line_says_what_to_install(tmp_path, body, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(InputError, match=r"rerun-sdk; install it: pip install"):
        write_view(tmp_path / "a.rrd", drawn_recording(tmp_path / "walk"), posed(body), (), None)
