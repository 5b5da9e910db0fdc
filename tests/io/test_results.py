"""What a run leaves on disk comes back as it was, and what is damaged is refused in one clear line."""

from __future__ import annotations

import os
import pickle
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass, replace

import numpy as np
import pandas
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.errors import InputError
from hmc.io.files import atomic_write, real_path, to_toml
from hmc.io.journal import append_journal, read_journal
from hmc.io.results import (
    PoseStates,
    PoseTable,
    TrackTable,
    read_centroids,
    read_joints,
    read_pose,
    read_run,
    read_tracks,
    run_selection,
    write_joints,
    write_pose,
    write_run,
    write_tracks,
)
from hmc.landmarks import LANDMARKS


def make_poses(n_frames: int = 5, persons=(0, 2), seed: int = 0) -> PoseTable:
    rng = np.random.default_rng(seed)
    frames, names = (grid.ravel() for grid in np.meshgrid(np.arange(7, 7 + n_frames), persons, indexing="ij"))
    positions = rng.normal(0, 1, (len(frames), 15, 3))
    positions[rng.random((len(frames), 15)) < 0.1] = np.nan
    return PoseTable(frames, names, positions)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), n_frames=st.integers(0, 6))
def test_joints_come_back(tmp_path_factory, seed, n_frames):
    path = tmp_path_factory.mktemp("joints") / "joints.csv"
    table = make_poses(n_frames, seed=seed)
    order = np.random.default_rng(seed).permutation(len(table.frames))
    write_joints(path, table.where(order))
    back = read_joints(path)
    np.testing.assert_array_equal(back.frames, table.frames)
    np.testing.assert_array_equal(back.persons, table.persons)
    np.testing.assert_allclose(back.positions, table.positions, atol=6e-7)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_views_and_trust_come_back(tmp_path_factory, seed):
    path, table, rng = tmp_path_factory.mktemp("joints") / "joints.csv", make_poses(seed=seed), np.random.default_rng(seed)
    views = rng.integers(0, 9, table.positions.shape[:2]).astype(float)
    views[rng.random(views.shape) < 0.1] = np.nan
    trust = np.round(rng.random(views.shape), 3)
    trust[rng.random(views.shape) < 0.1] = np.nan
    write_joints(path, replace(table, trust=trust))
    np.testing.assert_array_equal(read_joints(path).trust, trust)
    assert read_joints(path).views is None
    write_joints(path, replace(table, views=views, trust=trust))
    np.testing.assert_array_equal(read_joints(path).views, views)
    np.testing.assert_array_equal(read_joints(path).of(2).trust, trust[table.persons == 2])
    np.testing.assert_array_equal(read_joints(path).of(2).views, views[table.persons == 2])


def test_views_that_are_no_number_are_refused_with_the_line(tmp_path):
    (tmp_path / "joints.csv").write_text("frame,person,joint,x,y,z,views\n0,0,neck,1,2,3,4\n0,0,pelvis,1,2,3,many\n")
    with pytest.raises(InputError, match=r"joints.csv, line 3: `views` must be a number of cameras; got 'many'"):
        read_joints(tmp_path / "joints.csv")


def test_joints_are_the_long_table_that_pandas_reads(tmp_path):
    table = make_poses()
    write_joints(tmp_path / "joints.csv", table)
    data = pandas.read_csv(tmp_path / "joints.csv")
    assert list(data.columns) == ["frame", "person", "joint", "x", "y", "z"]
    wide = data.set_index(["frame", "person", "joint"]).loc[(8, 2)].loc[list(LANDMARKS)]
    row = np.flatnonzero((table.frames == 8) & (table.persons == 2))[0]
    np.testing.assert_allclose(wide.to_numpy(), table.positions[row], atol=6e-7)


def test_a_landmark_without_a_row_is_missing(tmp_path):
    path = tmp_path / "joints.csv"
    path.write_text("frame,person,joint,x,y,z,note\n3,1,neck,1,2,3,ok\n\n3,1,pelvis,,2,3,no x\n", encoding="utf-8-sig")
    table = read_joints(path)
    assert table.frames.tolist() == [3] and table.positions.shape == (1, 15, 3)
    np.testing.assert_array_equal(table.positions[0, 1], [1, 2, 3])
    assert np.isnan(table.positions[0, 0, 0]) and np.isnan(table.positions[0, 2:]).all()


@pytest.mark.parametrize("heads", [False, True])
def test_tracks_come_back(tmp_path, heads):
    rng = np.random.default_rng(0)
    points = rng.normal(size=(4, 3))
    table = TrackTable(np.array([1, 1, 2, 2]), np.array([0, 1, 0, 1]), points, points + np.array([0, 0, 0.7]) if heads else None)
    write_tracks(tmp_path / "tracks.csv", table.where(np.array([2, 0, 3, 1])))
    back = read_tracks(tmp_path / "tracks.csv")
    np.testing.assert_array_equal(back.persons, table.persons)
    np.testing.assert_allclose(back.positions, table.positions, atol=6e-7)
    if heads:
        np.testing.assert_allclose(read_centroids(tmp_path / "tracks.csv").heads, table.heads, atol=6e-7)
    else:
        assert back.heads is None
        with pytest.raises(InputError, match=r"tracks\.csv: the header line has no column 'head_x'"):
            read_centroids(tmp_path / "tracks.csv")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("frame,person,joint,x,y\n", "no column 'z'"),
        ("", "no column 'frame'"),
        ("frame,person,joint,x,y,z\n0,0,neck,1,2\n", "line 2: 5 values where the header names 6"),
        ("frame,person,joint,x,y,z\n0,0,neck,1,2,3\n0,0,nose,1,2,3\n", "line 3: no landmark named 'nose'"),
        ("frame,person,joint,x,y,z\n0,0,neck,1,oops,3\n", "line 2: `y` must be a number of metres; got 'oops'"),
        ("frame,person,joint,x,y,z\n0.5,0,neck,1,2,3\n", "line 2: `frame` must be a whole number; got '0.5'"),
        ("frame,person,joint,x,y,z\n0,9999999999999999999999,neck,1,2,3\n", "line 2: `person` must be a whole number"),
        ("frame,person,joint,x,y,z\n0,0,neck,1,2,inf\n", "line 2: an infinite coordinate"),
        ("frame,person,joint,x,y,z\n0,0,neck,1,2,1e300\n", "line 2: a coordinate beyond any room"),
        ("frame,person,joint,x,y,z\n0,0,neck,1,2,3\n\n0,0,neck,1,2,3\n", "line 4: this frame, person and joint stood in an earlier line"),
    ],
)
def test_bad_tables_are_refused_with_file_and_line(tmp_path, text, says):
    path = tmp_path / "joints.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_joints(path)
    assert says in str(caught.value) and str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_missing_and_binary_tables_are_refused(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        read_joints(tmp_path / "none.csv")
    (tmp_path / "x.csv").write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match=r"x\.csv: not a table"):
        read_tracks(tmp_path / "x.csv")
    (tmp_path / "t.csv").write_text("frame,person,x,y,z\n0,0,1,1,1\n0,0,1,1,1\n")
    with pytest.raises(InputError, match="line 3: this frame and person"):
        read_tracks(tmp_path / "t.csv")


def test_tables_check_their_shapes():
    with pytest.raises(InputError, match=r"PoseTable: `positions` must be \(2, 15, 3\); got \(2, 14, 3\)"):
        PoseTable(np.arange(2), np.zeros(2, int), np.zeros((2, 14, 3)))
    with pytest.raises(InputError, match="TrackTable: `frames` has 2 rows and `persons` 3"):
        TrackTable(np.arange(2), np.zeros(3, int), np.zeros((2, 3)))
    with pytest.raises(InputError, match="PoseTable: `frames` must be a row of whole numbers"):
        PoseTable(np.array([0.5]), np.zeros(1, int), np.zeros((1, 15, 3)))


def test_state_vectors_come_back_exactly(tmp_path):
    rng = np.random.default_rng(0)
    bodies = {0: {"height_m": np.array(1.8), "lengths_m": rng.random(10)}, 3: {"girths_m": rng.random((10, 2))}}
    poses = PoseStates(np.arange(4), np.array([0, 0, 3, 3]), rng.normal(size=(4, 3)), ("x", "y", "twist/left"), bodies)
    write_pose(tmp_path / "pose.npz", poses)
    back = read_pose(tmp_path / "pose.npz")
    np.testing.assert_array_equal(back.states, poses.states)
    assert back.dof_names == poses.dof_names and set(back.bodies) == {0, 3}
    assert back.bodies[0]["height_m"] == 1.8
    np.testing.assert_array_equal(back.bodies[3]["girths_m"], bodies[3]["girths_m"])


def test_pose_files_never_run_code(tmp_path):
    np.savez(tmp_path / "pose.npz", frames=np.array([print], dtype=object))
    with pytest.raises(InputError, match=r"not a (pose file|file of arrays)"):
        read_pose(tmp_path / "pose.npz")
    (tmp_path / "pickle.npz").write_bytes(pickle.dumps({"frames": 1}))
    with pytest.raises(InputError, match=r"not a (pose file|file of arrays)"):
        read_pose(tmp_path / "pickle.npz")


@pytest.mark.parametrize(
    "damage", [lambda data: data[: len(data) // 2], lambda data: b"", lambda data: data[:100] + b"\0" * (len(data) - 100)]
)
def test_damaged_pose_files_are_refused(tmp_path, damage):
    path = tmp_path / "pose.npz"
    write_pose(path, PoseStates(np.arange(4), np.arange(4), np.ones((4, 2)), ("a", "b")))
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(InputError, match=r"pose\.npz"):
        read_pose(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_pose(tmp_path / "none.npz")


@dataclass(frozen=True)
class Settings:
    voxel_size_m: float = 0.03
    limit: int | None = None


def test_run_comes_back(tmp_path):
    parameters = {
        "settings": Settings(),
        "scale": np.float32(0.5),
        "offsets": np.arange(6).reshape(2, 3),
        "name with space": 'a"b\\\n\x7f é',
    }
    write_run(tmp_path / "run.toml", "apf", parameters, 7, recording=tmp_path, start=3)
    run = read_run(tmp_path / "run.toml")
    assert (run["method"], run["seed"], run["start"], run["recording"]) == ("apf", 7, 3, str(tmp_path))
    assert run["parameters"]["settings"] == {"voxel_size_m": 0.03}
    assert run["parameters"]["offsets"] == [[0, 1, 2], [3, 4, 5]]
    assert run["parameters"]["name with space"] == 'a"b\\\n\x7f é'
    assert run["versions"]["numpy"] == np.__version__


plain = st.recursive(
    st.booleans() | st.integers(-(2**62), 2**62) | st.floats(allow_nan=False) | st.text(st.characters(codec="utf-8")),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(st.characters(codec="utf-8")), inner, max_size=3),
    max_leaves=12,
)


@settings(max_examples=150, deadline=None)
@given(st.dictionaries(st.text(st.characters(codec="utf-8")), plain, max_size=4))
def test_toml_text_is_read_back_by_the_standard_library(values):
    assert tomllib.loads(to_toml(values)) == values


def test_a_name_that_is_no_text_is_written_by_its_numbers():
    assert tomllib.loads(to_toml({"notes": ["cam_\udce9.mp4"], "b\udce9": 1})) == {"notes": ["cam_\\udce9.mp4"], "b\\udce9": 1}


def test_toml_refuses_what_it_cannot_write(tmp_path):
    with pytest.raises(TypeError, match="object has no form in TOML"):
        to_toml({"x": object()})
    (tmp_path / "run.toml").write_text("a = = 1\n")
    with pytest.raises(InputError, match=r"run\.toml: not a TOML file"):
        read_run(tmp_path / "run.toml")


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "folder" / "x.txt"
    with atomic_write(path) as file:
        file.write("old")
    with pytest.raises(RuntimeError, match="midway"), atomic_write(path) as file:
        file.write("half")
        raise RuntimeError("midway")
    assert path.read_text() == "old" and list(path.parent.iterdir()) == [path]


def test_what_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match=r"x\.toml: cannot be written"):
        write_run(tmp_path / "file" / "x.toml", "x", {}, 0)
    (tmp_path / "tracks.csv").mkdir()
    with pytest.raises(InputError, match=r"tracks\.csv: cannot be written"):
        write_tracks(tmp_path / "tracks.csv", TrackTable(np.zeros(1, int), np.zeros(1, int), np.zeros((1, 3))))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "tracks.csv"]


def test_the_frames_of_a_run(tmp_path):
    assert run_selection(tmp_path) == (0, None)
    write_run(tmp_path / "run.toml", "x", {"start": 3, "frames": 7}, 0)
    assert run_selection(tmp_path) == (3, 7)
    assert run_selection(tmp_path, start=5) == (5, 5) and run_selection(tmp_path, start=0) == (0, 10)
    assert run_selection(tmp_path, frames=2) == (3, 2) and run_selection(tmp_path, 0, 2) == (0, 2)
    assert run_selection(tmp_path, start=10) == (10, None)
    (tmp_path / "run.toml").write_text("parameters = 3\n")
    assert run_selection(tmp_path) == (0, None)


def test_a_journal_survives_a_run_that_dies_while_it_writes(tmp_path):
    path = tmp_path / "run" / "frames.jsonl"
    assert read_journal(path) == []
    append_journal(path, {"frame": 0, "state": np.array([0.1, 1 / 3])})
    append_journal(path, {"frame": np.int64(1), "cost": np.nan})
    with open(path, "a") as file:
        file.write('{"frame": 2, "sta')
    records = read_journal(path)
    assert [record["frame"] for record in records] == [0, 1]
    assert records[0]["state"] == [0.1, 1 / 3] and np.isnan(records[1]["cost"])
    append_journal(path, {"frame": 2})
    assert [record["frame"] for record in read_journal(path)] == [0, 1, 2]
    path.write_text("not json\n" + path.read_text())
    told: list[str] = []
    assert read_journal(path, told.append) == [] and "damaged in line 1" in told[0]


def test_real_paths_are_resolved_but_for_links_to_themselves(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "link").symlink_to("there")
    (tmp_path / "loop").symlink_to("loop")
    for name in (".", "link", "link/../x", "there/none", "there/./a"):
        assert real_path(tmp_path / name) == (tmp_path / name).resolve()
    assert real_path(tmp_path / "loop") == tmp_path.resolve() / "loop"


def test_what_a_killed_process_left_half_written_is_removed_by_the_next(tmp_path):
    work = tmp_path / "a"
    program = (
        "import os, sys; from hmc.io.files import sibling\nwith sibling(sys.argv[1]) as part: part.write_text('x'); os.kill(os.getpid(), 9)"
    )
    subprocess.run([sys.executable, "-c", program, str(work / "t.csv")], check=False)
    (left,) = work.iterdir()
    mine = left.with_name(re.sub(r"-\d+\.part", f"-{os.getppid()}.part", left.name))
    elsewhere = left.with_name(re.sub(r"[0-9a-f]{8}-", "00000000-", left.name))
    folder = left.with_name(left.name.removesuffix(".csv"))
    folder.mkdir()
    (folder / "x").write_text("x")
    for other in (mine, elsewhere):  # of a process that is alive, and of another machine
        other.write_text("x")
    with atomic_write(work / "u.csv") as file:
        file.write("y")
    assert {one.name for one in work.iterdir()} == {"u.csv", mine.name, elsewhere.name}


def test_landmarks_in_millimetres_are_refused(tmp_path):
    people = PoseTable(np.arange(4), np.zeros(4, int), np.random.default_rng(0).uniform(0, 1.8, (4, len(LANDMARKS), 3)))
    people.positions[1, 3] = np.nan
    people.positions[2, 5] += 500  # one that is astray makes no other unit
    write_joints(tmp_path / "metres.csv", people)
    assert read_joints(tmp_path / "metres.csv").positions.shape == people.positions.shape
    write_joints(tmp_path / "millimetres.csv", replace(people, positions=1000 * people.positions))
    with pytest.raises(InputError, match=r"millimetres\.csv: a person's landmarks are .* apart; they are to be metres"):
        read_joints(tmp_path / "millimetres.csv")
