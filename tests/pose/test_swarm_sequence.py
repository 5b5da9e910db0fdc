"""Swarms on the small rendered clip: a stopped run goes on, the command's files and options, and frames without a person."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from stopped import Stopped, noting, stopping

from hmc.cli import main
from hmc.io.recording import open_recording
from hmc.io.results import TrackTable, read_joints, read_run
from hmc.pose.methods import pso as sequence
from hmc.pose.methods.pso import SwarmPreset, SwarmTask, pose_by_swarm, swarm_preset
from hmc.pose.steps.swarm.fit import FitSettings
from hmc.pose.steps.swarm.temporal import SwarmSettings
from hmc.tracking.resumable import person_grid, track_recording
from hmc.voxels.hulls import stream_hulls

TINY = Path(__file__).resolve().parents[2] / "data" / "synthetic" / "tiny"
VOXEL_M = 0.04


@pytest.fixture(scope="module")
def task():
    fit = FitSettings(stages=((6, 3),) * 5, tune_particles=6, tune_iterations=2)
    return SwarmTask(
        open_recording(TINY, frames=6), SwarmPreset(swarm=SwarmSettings(fit, particles=8, iterations=2), window_s=0.2), 3, 1.76
    )


@pytest.fixture(scope="module")
def masks(tmp_path_factory):
    """Silhouettes that the tracker kept: without images, which are read again."""
    return tmp_path_factory.mktemp("kept") / "masks"


@pytest.fixture(scope="module")
def tracks(task, masks):
    return track_recording(task.recording, 0.05, masks=masks, key="k")


def watched(patch):
    """The states from which steps are taken from now on."""
    states = []
    step = sequence.swarm_step

    def watching(rng, model, state, *more):
        states.append(state)
        return step(rng, model, state, *more)

    patch.setattr(sequence, "swarm_step", watching)
    return states


@pytest.fixture(scope="module")
def whole(task, tracks):
    """A run from beginning to end, and the states on its way."""
    with pytest.MonkeyPatch.context() as patch:
        states = watched(patch)
        return *pose_by_swarm(task, tracks, VOXEL_M), states


@pytest.mark.parametrize("after", [4])
def test_a_stopped_run_goes_on_and_comes_to_the_same(task, tracks, masks, whole, tmp_path, monkeypatch, after):
    people, rows, states = whole
    kept = {"journal": tmp_path / "journal", "masks": masks, "key": "k"}
    with pytest.raises(Stopped):
        pose_by_swarm(task, tracks, VOXEL_M, **kept, progress=stopping(after))
    seen, resumed = [], watched(monkeypatch)
    again, lines = pose_by_swarm(task, tracks, VOXEL_M, **kept, progress=noting(seen))
    assert seen == list(range(0 if after < task.window else after, 6))
    assert_array_equal(again.poses.positions, people.poses.positions)
    for line, row in zip(lines, rows, strict=True):
        assert (line.frame, line.person, line.info.status, line.info.started) == (row.frame, row.person, row.info.status, row.info.started)
        assert_array_equal(line.state, row.state)
    # What is known besides the pose is taken up too: the evidence for the heading, the usual cost, the velocity.
    for one, other in zip(resumed[::-1], states[::-1], strict=False):
        assert (one is None) == (other is None)
        if one is not None:
            assert (one.facing, one.usual_m, one.missed) == (other.facing, other.usual_m, other.missed)
            assert_array_equal(one.velocity, other.velocity)
    assert any(one is not None and one.facing != 0 for one in resumed)
    # Nothing is left to do of a run that was finished.
    assert_array_equal(pose_by_swarm(task, tracks, VOXEL_M, **kept)[0].poses.positions, people.poses.positions)
    assert len(resumed) <= len(states)


@pytest.mark.parametrize(("every", "taken"), [(3, "strict"), (40, "tolerant")])
def test_a_strict_hull_that_is_whole_is_taken_however_fat_the_tolerant_one(task, tracks, every, taken):
    """Of few cameras it is less than half of the tolerant one; only where nearly nothing is left of it a camera lost the person."""
    grid = person_grid(task.recording, VOXEL_M)
    hull = next(stream_hulls(task.recording, grid, last=1))
    strict = np.zeros_like(hull.tolerant)
    few = np.argwhere(hull.tolerant)[::every]
    strict[tuple(few.T)] = True
    (seen,) = sequence._seen(task.recording, grid, tracks, replace(hull, strict=strict)).values()
    voxels = seen[0]
    assert len(voxels) > 0 and len(voxels) <= (len(few) if taken == "strict" else hull.tolerant.sum())
    assert strict[tuple(voxels.T)].all() == (taken == "strict")


def test_notes_of_one_reason_are_one_line(task, tracks):
    """Somebody who is tracked where nobody is has no pose, and one line says so."""
    elsewhere = TrackTable(tracks.frames, tracks.persons, tracks.positions + [1.9, -1.9, 0])
    people, rows = pose_by_swarm(task, elsewhere, VOXEL_M)
    assert all(row.info.status.startswith("no fit: ") for row in rows)
    assert np.isnan(people.poses.positions).all()
    assert len(people.notes) == 1 and people.notes[0].startswith(f"person {tracks.persons[0]}: 6 frames without a pose: no fit: ")


def run(out, *more):
    return main(["pose", str(TINY), "--out", str(out), "--quiet", "--method", "pso", "--frames", "5", "--voxel", "0.04", *more])


def test_the_command_leaves_a_row_a_frame(tmp_path):
    assert run(tmp_path / "out", "--height", "recording") == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["fits.csv", "joints.csv", "pose.npz", "run.toml", "tracks.csv"]
    with open(tmp_path / "out" / "fits.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["frame", "person", "status", "error_m", "started", "turned", "doubts"]
    joints = read_joints(tmp_path / "out" / "joints.csv")
    fitted = [int(row["frame"]) for row in rows if row["status"] == "fitted"]
    assert [int(row["frame"]) for row in rows] == list(range(5)) and fitted == sorted(set(joints.frames.tolist()))
    assert all(0 < float(row["error_m"]) < 0.3 for row in rows if row["status"] == "fitted")
    told = read_run(tmp_path / "out" / "run.toml")
    assert told["method"] == "pso" and told["parameters"]["preset"]["swarm"]["voxels"] is True


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--init", "spectral"], "--init: not for --method pso"),
        (["--smooth", "0.2"], "--smooth: not for --method pso"),
        (["--preset", "canton2009"], "there is no preset 'canton2009' of --method pso; use default or hsiao2008"),
    ],
)
def test_options_of_other_methods_are_refused(tmp_path, capsys, more, told):
    assert run(tmp_path / "out", *more) == 2
    assert told in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_thesis_s_preset_fits_curves_alone():
    preset = swarm_preset("hsiao2008")
    assert preset.thesis and preset.swarm.always_check and not preset.swarm.voxels
    assert replace(preset.swarm, always_check=False, voxels=True) == swarm_preset("default").swarm
