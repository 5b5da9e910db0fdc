"""A tracker from a file outside of the package: run, resumed, chosen by name on the command line and in an experiment."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn import draw_recording, walk

from hmc.cli import main
from hmc.errors import InputError
from hmc.experiments import table_4_3
from hmc.experiments import tracking_runs as runs
from hmc.experiments.engine.experiment import Plan
from hmc.experiments.engine.inputs import Inputs, source_of
from hmc.io.recording import open_recording
from hmc.io.results import TrackTable, read_run, read_tracks, write_tracks
from hmc.tracking import resumable
from hmc.tracking.method import TrackerMethod
from hmc.tracking.trackers import TRACKERS, make_tracker, register_tracker
from hmc.voxels.run_options import RunOptions

FRAMES, N = 24, 15  # later the two touch
#: Each component goes to the person expected nearest to it, at constant velocity; what is left begins a person.
TOY = """
from dataclasses import dataclass, field, replace

import numpy as np

from hmc.tracking.method import TrackerMethod
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.state import TrackerInfo, TrackRow
from hmc.tracking.trackers import register_tracker


@dataclass(frozen=True)
class ToySettings:
    reach_m: float = 0.5
    following: FollowingSettings = field(default_factory=FollowingSettings)


def step(rng, state, frame, observation, settings):
    if observation is None:
        return state, TrackerInfo(())
    places, speeds = (state.arrays.get(name, np.zeros((0, 3))) for name in ("places", "speeds"))  # a row a person
    expected, rows = places + speeds, []
    places, speeds = expected.copy(), speeds.copy()
    for b in np.flatnonzero(observation.blobs.volume_m3 > 0.25):
        centroid, head = observation.blobs.centroid[b], observation.blobs.highest[b]
        gaps = np.linalg.norm(expected - centroid, axis=1)
        person = int(gaps.argmin()) if gaps.min(initial=np.inf) < settings.reach_m else len(places)
        if person == len(places):
            places, speeds = np.vstack([places, centroid]), np.vstack([speeds, np.zeros(3)])
        else:
            speeds[person] += 0.5 * (centroid - expected[person])
        places[person] = centroid
        rows.append(TrackRow(frame, person, centroid, head))
    return replace(state, arrays={"places": places, "speeds": speeds}), TrackerInfo(tuple(rows))


register_tracker(TrackerMethod("toy", "these tests", "nearest components", step, {"default": ToySettings(), "near": ToySettings(0.1)}))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory, ring):
    other = [(0.9, -0.9 + 0.02 * k) for k in range(FRAMES)]
    places = [[*one, two] for one, two in zip(walk(FRAMES), other, strict=True)]
    path = draw_recording(tmp_path_factory.mktemp("toy") / "two", ring, places[:N], silhouettes=True)
    frames, persons = np.repeat(np.arange(N), 2), np.tile([0, 1], N)
    centres = np.array([(*place, 0.875) for two in places[:N] for place in two])
    write_tracks(path / "truth" / "centroids.csv", TrackTable(frames, persons, centres, centres + (0, 0, 0.8)))
    return path


@pytest.fixture
def toy(tmp_path):
    before = dict(TRACKERS)
    (tmp_path / "toy.py").write_text(TOY)
    spec = importlib.util.spec_from_file_location("toy", tmp_path / "toy.py")
    spec.loader.exec_module(importlib.util.module_from_spec(spec))
    yield TRACKERS["toy"]
    TRACKERS.clear()
    TRACKERS.update(before)


def same(one, other):
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("frames", "persons", "positions", "heads"))


def distances(table):
    """Of each row to the nearer of the two people."""
    truth = [np.array([place, (0.9, -0.9 + 0.02 * k)]) for k, (place,) in enumerate(walk(FRAMES))]
    return np.array([np.hypot(*(truth[f] - p[:2]).T).min() for f, p in zip(table.frames, table.positions, strict=True)])


def test_it_runs_from_python(toy, folder):
    table = resumable.track_recording(open_recording(folder), 0.08, toy.tracker())
    assert set(table.persons) == {0, 1} and len(table.frames) == 2 * N and distances(table).max() < 0.06
    assert same(table, resumable.track_recording(open_recording(folder), 0.08, make_tracker("toy")))
    near = make_tracker("toy", preset="near")
    assert near.settings.reach_m == 0.1 and near.name == "toy" and not near.color


def test_a_stopped_run_takes_its_arrays_from_the_journal(toy, folder, tmp_path, monkeypatch):
    monkeypatch.setattr(resumable, "CHECKPOINT_FRAMES", 5)
    calls = []

    def dying(rng, state, frame, observation, settings):
        calls.append(frame)
        if frame == 12 and calls.count(frame) == 1:
            raise KeyboardInterrupt
        return toy.step(rng, state, frame, observation, settings)

    tracker, journal = replace(toy, step=dying).tracker(), tmp_path / "journal"
    whole = resumable.track_recording(open_recording(folder), 0.08, toy.tracker())
    run = RunOptions(journal=journal)
    with pytest.raises(KeyboardInterrupt):
        resumable.track_recording(open_recording(folder), 0.08, tracker, run=run)
    assert same(resumable.track_recording(open_recording(folder), 0.08, tracker, run=run), whole)
    assert [calls.count(frame) for frame in (0, 9, 10, 12, 14)] == [1, 1, 2, 2, 1]


def test_the_command_line_knows_it(toy, folder, tmp_path, capsys):
    assert main(["track", str(folder), "--out", str(tmp_path / "out"), "--tracker", "toy", "--voxel", "0.08", "--quiet"]) == 0
    assert set(read_tracks(tmp_path / "out" / "tracks.csv").persons) == {0, 1}
    run = read_run(tmp_path / "out" / "run.toml")
    assert run["method"] == "toy" and run["parameters"]["tracker"]["reach_m"] == 0.5
    with pytest.raises(SystemExit):
        main(["track", "--help"])
    assert "toy: nearest components" in " ".join(capsys.readouterr().out.split())
    assert main(["track", str(folder), "--out", str(tmp_path / "x"), "--tracker", "toy", "--particles", "9"]) == 2
    assert "`toy` has no particles" in capsys.readouterr().err


def test_an_experiment_takes_it_by_name(toy, folder, tmp_path):
    source = source_of(folder)
    cells = [one for one in table_4_3.grid(Plan(quick=True, recordings=(source,))) if one["tracker"] == "toy"]
    assert {one["preset"] for one in cells} == {"default"} and len(cells) == len(runs.voxel_sizes(Plan(quick=True)))
    assert runs.method_name(cells[0]) == "toy"
    results = runs.cell(cells[1], Inputs(tmp_path, {source.label: Path(folder)}), np.random.default_rng(0))
    for errors in (results["head"], results["centroid"]):
        assert errors["objects"] == 2 * N and errors["matches"] == 2 * N and errors["mismatches"] == 0


def test_a_tracker_of_the_package_is_not_replaced(toy):
    with pytest.raises(InputError, match="'naive' already"):
        register_tracker(TrackerMethod("naive", "", "", toy.step, toy.presets))


def test_a_method_without_its_default_preset_is_refused(toy):
    with pytest.raises(InputError, match="no preset `default`"):
        register_tracker(TrackerMethod("half", "", "", toy.step, {"other": toy.presets["default"]}))
