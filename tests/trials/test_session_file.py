"""session.toml: what each trial gets, and all that is wrong with a file in one line."""

from pathlib import Path

import pytest

from hmc.errors import InputError
from hmc.io.calibration import write_calibration
from hmc.io.places import RecordingPlaces
from hmc.io.recording import background_frames, open_recording, whole_recording
from hmc.trials.session_file import chosen_trials, places_in_session, read_session

GOOD = """
name = "a day"
calibration = "rig"
background = "empty"
trials = "trials/*"
[recording]
fps = 50
[pose]
voxel = 0.05
seed = 1
[[person]]
name = "Ana"
height_m = 1.62
[[person]]
name = "Ben"
[[trial]]
name = "one"
persons = ["Ana"]
frames = 3
pose = { seed = 2 }
recording = { fps = 25 }
[[trial]]
name = "three"
videos = "raw/{trial}_{camera}.avi"
"""


@pytest.fixture
def lab(tmp_path, recording_folder, ring):
    """A session with two trials in folders, and one whose videos have names by a pattern."""
    folder = tmp_path / "lab"
    for name in ("one", "two"):
        (folder / "trials" / name).mkdir(parents=True)
        (folder / "trials" / name / "videos").symlink_to(recording_folder / "videos")
    (folder / "raw").mkdir()
    for video in (recording_folder / "videos").iterdir():
        (folder / "raw" / f"three_{video.name}").symlink_to(video)
    (folder / "empty").symlink_to(recording_folder / "background")
    (folder / "rig").mkdir()
    write_calibration(folder / "rig" / "calibration.toml", ring)
    (folder / "session.toml").write_text(GOOD)
    return folder


def test_every_trial_gets_what_its_folder_lacks(lab):
    session = read_session(lab)
    assert session.name == "a day" and [trial.name for trial in session.trials] == ["one", "two", "three"]
    one, two, _ = session.trials
    assert one.pose == {"voxel": 0.05, "seed": 2, "frames": 3} and two.pose == {"voxel": 0.05, "seed": 1}
    assert [str(person) for person in one.persons] == ["Ana (1.62 m)"] and two.persons == ()
    for trial in session.trials:
        recording = open_recording(trial.places)
        assert len(recording.rig) == 5 and recording.n_frames == 12 and recording.n_background_frames == (4,) * 5
        assert recording.fps == (25 if trial is one else 50)
        assert whole_recording(recording).n_frames == 12 and len(list(background_frames(recording, 0))) == 4
    recording = open_recording(one.places)
    assert recording.persons == 1 and recording.known_height_m == 1.62
    assert open_recording(two.places).persons is None


@pytest.mark.parametrize("everywhere", ["", "persons = 2\n"])
def test_statures_and_numbers_are_of_who_is_in_a_trial(lab, everywhere):
    """Of nobody else in the session: a trial that names nobody may be of anybody, and names go before a number for all trials."""
    both = '[[trial]]\nname = "two"\npersons = ["Ana", "Ben"]\n'
    (lab / "session.toml").write_text(GOOD.replace("fps = 50\n", f"fps = 50\n{everywhere}") + both)
    one, two, three = (open_recording(trial.places) for trial in read_session(lab).trials)
    assert (one.persons, one.subject_height_m, one.known_height_m) == (1, (1.62,), 1.62)
    assert (two.persons, two.known_height_m) == (2, None)
    assert (three.persons, three.subject_height_m, three.known_height_m) == (2 if everywhere else None, (), None)


def test_a_trial_s_own_number_of_persons_goes_before(lab):
    (lab / "session.toml").write_text(GOOD.replace("recording = { fps = 25 }", "recording = { persons = 2 }"))
    one = open_recording(read_session(lab).trials[0].places)
    assert (one.persons, one.known_height_m) == (2, None)


def test_a_session_s_one_person_is_in_every_trial(lab):
    """Unless the session says that there are more."""
    alone = GOOD.replace('[[person]]\nname = "Ben"\n', "")
    (lab / "session.toml").write_text(alone)
    assert [open_recording(trial.places).known_height_m for trial in read_session(lab).trials] == [1.62] * 3
    (lab / "session.toml").write_text(alone.replace("fps = 50\n", "fps = 50\npersons = 2\n"))
    assert [open_recording(trial.places).known_height_m for trial in read_session(lab).trials] == [1.62, None, None]


def test_what_a_folder_has_goes_before(lab, ring):
    own = lab / "trials" / "two"
    (own / "recording.toml").write_text("fps = 7\n")
    write_calibration(own / "calibration.toml", type(ring)(tuple(ring)[:3]))
    (own / "background").mkdir()
    recording = open_recording(read_session(lab).trials[1].places)
    assert recording.fps == 7 and len(recording.rig) == 3 and recording.n_background_frames == (0,) * 3


def test_changes_are_noticed_wherever_they_are(lab):
    import os

    places = read_session(lab).trials[2].places
    seen = {places.files_digest()}
    for file in (lab / "rig" / "calibration.toml", lab / "empty" / "cam_01.avi", lab / "raw" / "three_cam_01.avi"):
        os.utime(file, (10, 10))  # an older one than it was
        seen.add(places.files_digest())
    assert len(seen) == 4 and places.files_digest() in seen


def test_times_that_were_found_are_noticed(lab):
    """What `hmc sync` writes makes a run that was finished another."""
    places = read_session(lab).trials[0].places
    before, times = places.files_digest(), lab / "trials" / "one" / "times"
    times.mkdir()
    assert places.files_digest() == before
    (times / "cam_01.csv").write_text("frame,time_s\n0,0\n")
    assert places.files_digest() != before


@pytest.mark.parametrize(
    ("settings", "file"),
    [
        ("", "Calib_scene.toml"),
        ("", "calibration/cam_00.yml"),
        ("", "intri.yml"),
        ("", "extri.yml"),
        ("", "videos/cam_00/clip.mp4"),
        ("", "silhouettes/cam_00_0001.png"),
        ("", "markers/detections.csv"),
        ('videos = "trial/{camera}.mp4"', "trial/cam_00.mp4"),
        ('videos = "{camera}/clip.mp4"', "cam_00/clip.mp4"),
        ('videos = "*{camera}*"', "take_cam_00.mp4"),
        ('images = "{camera}/*.png"', "cam_00/0001.png"),
        ('images = { cam_00 = "left" }', "left/0001.png"),
    ],
)
def test_each_file_that_counts_is_noticed_when_it_changes_is_older_or_goes(tmp_path, ring, settings, file):
    """A result was said to be finished though its calibration was another: only some names, and only newer files, were noticed."""
    import os

    (tmp_path / "recording.toml").write_text(settings)
    if settings:
        write_calibration(tmp_path / "calibration.toml", ring)
    other, counts = tmp_path / "result" / "overlay.png", tmp_path / file
    for one in (tmp_path / "intri.yml", counts) if file == "extri.yml" else (counts,):
        one.parent.mkdir(parents=True, exist_ok=True)
        one.write_text("%YAML:1.0\n")
    places = RecordingPlaces(tmp_path)
    seen = [places.files_digest()]
    os.utime(counts, (10, 10))
    seen.append(places.files_digest())
    counts.write_text("%YAML:1.0\n\n")
    seen.append(places.files_digest())
    counts.unlink()
    seen.append(places.files_digest())
    assert len(set(seen)) == 4
    other.parent.mkdir()
    other.write_text("a result in the recording's folder")
    (counts.parent / ".DS_Store").write_text("what a Mac leaves beside files")
    assert places.files_digest() == seen[-1]
    assert RecordingPlaces(Path(os.path.relpath(tmp_path))).files_digest() == seen[-1]


def test_a_recording_by_its_folder_in_a_session(lab):
    session = read_session(lab / "session.toml")
    assert places_in_session(session, lab / "trials" / "one") is session.trials[0].places
    other = places_in_session(session, lab / "elsewhere")
    assert other == RecordingPlaces(lab / "elsewhere", lab / "rig", lab / "empty", None, {"fps": 50.0}, lab / "session.toml")


def test_trials_are_chosen_by_names_and_patterns(lab):
    session = read_session(lab)
    assert [trial.name for trial in chosen_trials(session, ["t*", "one"])] == ["one", "two", "three"]
    assert [trial.name for trial in chosen_trials(session, ["three"])] == ["three"]
    with pytest.raises(InputError, match=r"no trial named `tow`; did you mean `two`\? \(trials: one, two, three\)"):
        chosen_trials(session, ["tow"])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('calibration = "rig"', 'calibraton = "rig"', "unknown key `calibraton`; did you mean `calibration`?"),
        ('calibration = "rig"', 'calibration = "nowhere"', "`calibration`: "),
        ('calibration = "rig"', "calibration = 3", "`calibration` must be a path; got 3"),
        ('background = "empty"', 'background = "full"', "full is no folder; give one with a video or a subfolder of images a camera"),
        ('name = "a day"', "name = 7", "`name` must be a text; got 7"),
        ('trials = "trials/*"', 'trials = "tests/*"', "`trials`: no folder is like 'tests/*'"),
        ('trials = "trials/*"', 'trials = "."', "`trials`: '.' is no pattern of folders from here"),
        ('trials = "trials/*"', "trials = 3", "`trials` must be a pattern of folders from here"),
        ("fps = 50", "fsp = 50", "[recording]: unknown key `fsp`; did you mean `fps`?"),
        ("fps = 50", "fps = -1", "[recording]: `fps` must be a number above 0; got -1"),
        ("fps = 50", "subject_height_m = [1.8]", "[recording] `subject_height_m`: statures stand with the persons"),
        ("[pose]\nvoxel = 0.05\nseed = 1", "[[pose]]", "[pose] must be a table"),
        ("height_m = 1.62", "height_m = 162", "[[person]] Ana `height_m` must be a stature in metres, such as 1.77; got 162"),
        ("height_m = 1.62", "heigth_m = 1.62", "[[person]] Ana unknown key `heigth_m`; did you mean `height_m`?"),
        ('name = "Ben"', 'name = "Ana"', "[[person]] Ana: there are two persons of this name; rename one"),
        ('persons = ["Ana"]', 'persons = ["Anna"]', "[[trial]] one `persons`: no [[person]] named `Anna`; did you mean `Ana`?"),
        ('persons = ["Ana"]', 'persons = "Ana"', "[[trial]] one `persons` must be a list of names; got 'Ana'"),
        ("frames = 3", "frame = 3", "[[trial]] one unknown key `frame`; did you mean `frames`?"),
        ("frames = 3", 'folder = "elsewhere"', "elsewhere is no folder"),
        ('name = "three"', 'name = "one"', "[[trial]] one: there are two trials of this name; rename one"),
        ('name = "three"', 'name = "a/b"', "a trial's name must begin with no dot and have none of"),
        ('name = "three"', 'name = "a\\nb"', "a trial's name must begin with no dot and have none of"),
        ('name = "three"\n', "", "[[trial]] 2: `name` must be a text"),
        ('videos = "raw/{trial}_{camera}.avi"', "", "three is no folder; give `folder`, or `videos` with {camera} in it"),
        ('videos = "raw/{trial}_{camera}.avi"', 'videos = "raw/{trial}.avi"', "must be a path with {camera} in it"),
        ('[[person]]\nname = "Ben"', "", ""),
    ],
)
def test_what_is_wrong_is_said(lab, old, new, said):
    file = lab / "session.toml"
    assert old in GOOD
    file.write_text(GOOD.replace(old, new, 1))
    if not said:
        read_session(file)
        return
    with pytest.raises(InputError) as caught:
        read_session(file)
    assert said in str(caught.value) and "\n" not in str(caught.value) and str(file) in str(caught.value)


def test_all_faults_are_told_at_once(lab):
    file = lab / "session.toml"
    file.write_text(GOOD.replace("fps = 50", "fsp = 50").replace("1.62", "162").replace('["Ana"]', '["Anna"]'))
    with pytest.raises(InputError, match="3 faults: ") as caught:
        read_session(file)
    assert all(word in str(caught.value) for word in ("fsp", "162", "Anna"))


@pytest.mark.parametrize(
    ("text", "said"), [("a = ", "not a TOML file"), (None, "no such file; a session is a TOML file"), ("", "no trials")]
)
def test_a_file_that_is_none(tmp_path, text, said):
    if text is not None:
        (tmp_path / "session.toml").write_text(text)
    with pytest.raises(InputError, match=said):
        read_session(tmp_path)
