"""A session's report from what lies in the trials' folders: whole in itself, and told where something is missing."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import cv2
import numpy as np
import pytest

from hmc.errors import InputError
from hmc.io.places import RecordingPlaces
from hmc.io.results import PoseStates, PoseTable, TrackTable, write_joints, write_pose, write_run, write_tracks
from hmc.landmarks import LANDMARKS, landmark_index
from hmc.trials import state as state_file
from hmc.trials.curves import MOST_POINTS, curves_svg, flexion, speed
from hmc.trials.page import session_page
from hmc.trials.quality import read_trial_result
from hmc.trials.session_file import Session, SessionPerson, Trial
from hmc.trials.state import DONE, FAILED, TrialState, only_one, read_state, write_state
from hmc.view.curve import PALE

N = 8


def write_result(folder, persons=(0,), costs=True):
    """A result of persons who walk 0.1 m a frame."""
    frames, numbers = np.repeat(np.arange(N), len(persons)), np.tile(persons, N)
    rng = np.random.default_rng(0)
    positions = rng.normal(0, 0.3, (1, len(LANDMARKS), 3)) + np.array([0.1, 0, 0]) * frames[:, None, None]
    views = np.full((len(frames), len(LANDMARKS)), 3.0)
    views[: len(frames) // 2] = 1
    write_joints(folder / "joints.csv", PoseTable(frames, numbers, positions, views))
    write_tracks(folder / "tracks.csv", TrackTable(frames, numbers, positions[:, 0]))
    values = np.where(frames == 0, np.nan, 2.0) if costs else None
    write_pose(folder / "pose.npz", PoseStates(frames, numbers, np.zeros((len(frames), 2)), ("a", "b"), {}, values))
    write_run(folder / "run.toml", "apf", {"frames": N, "fps": 10.0}, 0, problems=["cam_01: <frame> 3 cannot be read"])


def session_of(tmp_path, *names):
    trials = tuple(Trial(name, RecordingPlaces(tmp_path / name), (SessionPerson("Ana & Co", 1.62),)) for name in names)
    return Session(tmp_path / "session.toml", "A <day>", RecordingPlaces(tmp_path), trials)


class Checked(HTMLParser):
    """Knows which elements are open, and what is linked and shown."""

    def __init__(self):
        super().__init__()
        self.open, self.ids, self.links, self.sources, self.text = [], set(), [], [], ""

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.ids |= {values["id"]} if "id" in values else set()
        self.links += [values["href"]] if "href" in values else []
        self.sources += [values["src"]] if "src" in values else []
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def test_a_page_is_whole_in_itself(tmp_path):
    for name in ("one", "two people"):
        write_result(tmp_path / name, (0,) if name == "one" else (0, 1))
        write_state(tmp_path / name, TrialState(DONE, "", ("warning: videos differ",), "", "", {"check": 1.0, "pose": 2.0}))
        (tmp_path / name / "moments").mkdir()
        for frame in (0, 5):
            cv2.imwrite(str(tmp_path / name / "moments" / f"{frame:06d}.jpg"), np.full((20, 10, 3), 90, np.uint8))
    cv2.imwrite(str(tmp_path / "one" / "check.png"), np.full((20, 2000, 3), 90, np.uint8))
    write_state(tmp_path / "bad", TrialState(FAILED, "no videos/"))
    text = session_page(session_of(tmp_path, "one", "two people", "bad", "later"), tmp_path)
    page = Checked()
    page.feed(text)
    assert not page.open and "A <day>" in page.text and "4 trials: 2 done, 1 failed, 1 not finished." in page.text
    assert all(source.startswith("data:image/") for source in page.sources) and len(page.sources) == 1 + 2 * 3
    assert "<script" not in text and not re.search(r"(https?:)?//", re.sub(r"base64,[^\"]*", "", text))
    for link in page.links:
        assert link[1:] in page.ids if link.startswith("#") else (tmp_path / link.replace("%20", " ")).is_file()
    for said in (
        "With Ana & Co (1.62 m).",
        "no videos/",
        "warning: videos differ",
        "cam_01: <frame> 3",
        "2.00e+00",
        "50 %",
        "0.50 s, frame 5",
        "Curves of knees and elbows are pale where",
        "; of 120 landmarks 60 are doubtful (50.0%): pelvis of Ana & Co in 4 frames, ",
        "8 frames, 10 a second: Ana & Co (person 0): 8 frames, from 0 to 7",
        "8 frames, 10 a second: person 0: 8 frames, from 0 to 7, no pose; person 1: ",  # who is who of two is not told
    ):
        assert said in page.text, said
    assert "<time>3 s</time>" in text and text == session_page(session_of(tmp_path, "one", "two people", "bad", "later"), tmp_path)


def test_a_damaged_trial_is_told_in_its_place(tmp_path):
    write_result(tmp_path / "one", costs=False)
    (tmp_path / "one" / "joints.csv").write_text("frame\n")
    assert "joints.csv" in session_page(session_of(tmp_path, "one"), tmp_path)
    write_result(tmp_path / "one", costs=False)
    (tmp_path / "one" / "trial.toml").write_text("colour = 3\n")
    assert "not of this program" in session_page(session_of(tmp_path, "one"), tmp_path)


def test_nobody_is_no_fault(tmp_path):
    write_result(tmp_path / "one", persons=())
    assert "no person in 8 frames" in session_page(session_of(tmp_path, "one"), tmp_path)


def test_curves_are_of_what_they_say(tmp_path):
    write_result(tmp_path)
    result = read_trial_result(tmp_path)
    assert np.allclose(speed(result.tracks.positions, result.tracks.frames, 10.0), 1.0)
    assert np.isnan(speed(np.zeros((1, 3)), np.array([4]), 10.0)).all()
    points = np.zeros((1, len(LANDMARKS), 3))
    for name, place in (("l_hip", (0, 0, 2)), ("l_knee", (0, 0, 1)), ("l_ankle", (1, 0, 1))):
        points[0, landmark_index(name)] = place
    assert np.allclose(flexion(points, ("l_hip", "l_knee", "l_ankle")), 90)
    text = curves_svg(result)
    assert text == curves_svg(result) and "knees bent, deg" in text and "date" not in text


@pytest.mark.parametrize(("landmark", "curves"), [("l_ankle", 1), ("r_hip", 1), ("r_wrist", 1), ("neck", 0)])
def test_curves_are_pale_where_a_landmark_of_theirs_is_doubtful(tmp_path, landmark, curves):
    write_result(tmp_path)
    sure = read_trial_result(tmp_path)
    trust = np.ones((N, len(LANDMARKS)))
    sure = replace(sure, poses=replace(sure.poses, trust=trust))
    assert f"stroke-opacity: {PALE}" not in curves_svg(sure)
    trust = trust.copy()
    trust[2:4, landmark_index(landmark)] = 0.1
    drawn = curves_svg(replace(sure, poses=replace(sure.poses, trust=trust)))
    assert drawn.count(f"stroke-opacity: {PALE}") == curves


def test_a_short_doubt_is_seen_in_a_long_trial(tmp_path):
    """Of a long trial not every frame is drawn, but what is doubtful between two that are is pale."""
    write_result(tmp_path)
    n = 3 * MOST_POINTS
    positions = np.random.default_rng(0).normal(size=(n, len(LANDMARKS), 3))
    trust = np.ones((n, len(LANDMARKS)))
    trust[7, landmark_index("l_knee")] = 0.1
    poses = PoseTable(np.arange(n), np.zeros(n, int), positions, trust=trust)
    assert curves_svg(replace(read_trial_result(tmp_path), poses=poses)).count(f"stroke-opacity: {PALE}") == 1


def test_only_one_run_works_in_a_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(state_file, "WAIT_S", 0.0)
    with only_one(tmp_path), pytest.raises(InputError, match="another run is at work there"), only_one(tmp_path):
        pass
    with only_one(tmp_path):
        assert read_state(tmp_path) == TrialState()
