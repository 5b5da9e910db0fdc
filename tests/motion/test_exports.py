"""Files for other programs, opened by other people's readers: the landmarks in them are those of the result."""

import importlib.util
import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hmc
from hmc.body.joints import DOF_NAMES, N_DOF, dof_index
from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.cli import main
from hmc.cli.export import FORMATS as SAID
from hmc.errors import InputError
from hmc.io.c3d import read_c3d
from hmc.io.export.c3d import write_c3d
from hmc.io.results import PoseStates, PoseTable, write_joints, write_pose
from hmc.landmarks import FOOT_POINTS, LANDMARKS
from hmc.motion.export import FORMATS, export_trajectories
from hmc.motion.gaps import fill_gaps, fill_trajectory
from hmc.motion.trajectory import read_trajectories, trajectories
from hmc.pose.follow import PosedPeople
from hmc.synthetic.bvh import bvh_positions, read_bvh

SCRIPT = Path(__file__).resolve().parents[2] / "docs" / "exports_elsewhere.py"
_spec = importlib.util.spec_from_file_location("exports_elsewhere", SCRIPT)
elsewhere = importlib.util.module_from_spec(_spec)
sys.modules["exports_elsewhere"] = elsewhere
_spec.loader.exec_module(elsewhere)


def moving(n=12, persons=(0,), first=5):
    """Somebody who turns every joint, and the room around them; each person a little otherwise."""
    rng = np.random.default_rng(3)
    body = default_body(1.71)
    tables = []
    for person in persons:
        ends = neutral_state("down") + np.where(np.arange(N_DOF) < 6, 1.0, 0.25) * rng.normal(size=(2, N_DOF))
        states = np.linspace(*np.clip(ends, body.limits.low, body.limits.high), n)
        tables.append((np.arange(first, first + n), np.full(n, person), states))
    frames, numbers, states = (np.concatenate(parts) for parts in zip(*tables, strict=True))
    table = PoseTable(frames, numbers, landmarks(body, states))
    kept = PoseStates(frames, numbers, states, DOF_NAMES, dict.fromkeys(persons, body.dimensions))
    return PosedPeople(table, kept, np.zeros(len(frames)), (), fps=50.0)


def with_gap(people, rows):
    positions = people.positions.copy()
    positions[rows] = np.nan
    return replace(people, poses=replace(people.poses, positions=positions))


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("kind,package,read", elsewhere.READERS, ids=lambda value: value if isinstance(value, str) else "")
def test_landmarks_elsewhere_are_ours(tmp_path, kind, package, read):
    pytest.importorskip(package)
    (one,) = moving().trajectories()
    export_trajectories([one], tmp_path / f"walk.{kind}")
    names, positions = one.points
    assert names[len(LANDMARKS) :] == FOOT_POINTS
    found = read(tmp_path / f"walk.{kind}", names)
    assert found.shape == positions.shape
    assert elsewhere.largest_difference_m(found, one) < 1e-5


def test_every_format_is_said_and_tried():
    assert tuple(FORMATS) == SAID
    assert set(SAID) == {kind for kind, _, _ in elsewhere.READERS}


@pytest.mark.parametrize("kind", ["trc", "c3d", "csv", "parquet"])
def test_a_gap_is_one_elsewhere(tmp_path, kind):
    people = with_gap(moving(), [4, 5])
    hmc.export(people, tmp_path / f"walk.{kind}")
    readers = [(package, read) for one, package, read in elsewhere.READERS if one == kind]
    for package, read in readers:
        if importlib.util.find_spec(package) is not None:
            empty = np.isnan(read(tmp_path / f"walk.{kind}", (*LANDMARKS, *FOOT_POINTS))).all(axis=(1, 2))
            assert np.flatnonzero(empty).tolist() == [4, 5], package


def test_feet_are_those_of_feet_csv_and_left_out_where_few_cameras_show_them(tmp_path):
    people = moving()
    (one,) = people.trajectories()
    np.testing.assert_array_equal(one.feet, people.feet.positions)
    views = np.full(people.positions.shape[:2], 4)
    views[3:5, LANDMARKS.index("l_ankle")] = 1
    (one,) = replace(people, poses=replace(people.poses, views=views)).trajectories()
    empty = np.isnan(one.feet).all(axis=-1)
    assert empty[3:5, :2].all() and empty.sum() == 4
    export_trajectories([one], tmp_path / "walk.trc")
    found = elsewhere.trc_pandas(tmp_path / "walk.trc", FOOT_POINTS)
    np.testing.assert_allclose(found, one.feet, atol=1e-6)


def test_feet_that_are_held_are_not_told(tmp_path):
    """Methods whose body has no feet that turn hold them at 0."""
    people = moving()
    states = people.states.states.copy()
    states[:, [dof_index(f"{side}_ankle_{axis}")[0] for side in "lr" for axis in "yz"]] = 0
    (one,) = replace(people, states=replace(people.states, states=states)).trajectories()
    assert one.feet is None and one.points[0] == LANDMARKS
    for kind in ("trc", "csv"):
        export_trajectories([one], tmp_path / f"walk.{kind}")
        assert "heel" not in (tmp_path / f"walk.{kind}").read_text()


def test_times_are_those_of_the_recording(tmp_path):
    people = moving(first=25)
    for kind in ("trc", "mot", "csv"):
        hmc.export(people, tmp_path / f"walk.{kind}")
    rows = (tmp_path / "walk.trc").read_text().splitlines()[6:]
    assert rows[0].split("\t")[:2] == ["26", "0.500000"] and rows[-1].split("\t")[1] == f"{36 / 50:.6f}"
    assert (tmp_path / "walk.mot").read_text().split("endheader\n")[1].splitlines()[1].startswith("0.50000000\t")
    assert (tmp_path / "walk.csv").read_text().splitlines()[1].startswith("25,0.500000,0,")


def test_our_own_reader_of_c3d_agrees(tmp_path):
    pytest.importorskip("ezc3d")
    people = with_gap(moving(persons=(0, 3)), [2])
    hmc.export(people, tmp_path / "two.c3d")
    data = read_c3d(tmp_path / "two.c3d")
    assert data.rate == 50 and len(data.labels) == 38
    first, second = people.trajectories()
    assert np.allclose(data.positions, np.hstack([first.points[1], second.points[1]]), atol=1e-6, equal_nan=True)


@pytest.mark.parametrize("first", [0, 32_760, 65_523, 65_524, 70_000])
def test_a_c3d_has_the_frames_of_the_recording_however_late(tmp_path, first):
    """Frames 65,523 to 65,534 are the last that the header's 16 bits can number, from 1."""
    ezc3d = pytest.importorskip("ezc3d")
    late = first > 65_523
    found = moving(n=12, first=first).trajectories()
    written = export_trajectories(found, tmp_path / "late.c3d")
    file = ezc3d.c3d(str(tmp_path / "late.c3d"))
    start, end = (file["parameters"]["TRIAL"][f"ACTUAL_{name}_FIELD"] for name in ("START", "END"))
    assert start["type"] == end["type"] == 2
    assert [word % 65536 for word in start["value"]] == [(first + 1) % 65536, (first + 1) // 65536]
    assert [word % 65536 for word in end["value"]] == [(first + 12) % 65536, (first + 12) // 65536]
    points = file["header"]["points"]
    assert (points["first_frame"], points["last_frame"]) == ((0, 11) if late else (first, first + 11))
    assert file["data"]["points"].shape[2] == 12
    assert len(written.notes) == late and all(f"is frame {first} of the recording" in note for note in written.notes)
    data = read_c3d(tmp_path / "late.c3d")
    assert data.first_frame == first and np.allclose(data.positions, found[0].points[1], atol=1e-6)


def test_more_frames_than_a_c3d_holds_are_refused(tmp_path):
    with pytest.raises(
        InputError, match=r"long\.c3d: 65536 frames, and a C3D file holds 65535; write TRC, or split: .*--start and --frames"
    ):
        write_c3d(tmp_path / "long.c3d", ["a"], 0, np.ones((65_536, 1, 3)), 50.0)
    assert not (tmp_path / "long.c3d").exists()


def test_our_own_reader_of_bvh_agrees(tmp_path):
    (one,) = moving().trajectories()
    export_trajectories([one], tmp_path / "walk.bvh")
    file = read_bvh(tmp_path / "walk.bvh")
    points = bvh_positions(file)[0][:, [file.names.index(name) for name in LANDMARKS]] / 100
    assert np.allclose(elsewhere.from_z_forward(points), one.positions, atol=1e-6)
    assert file.frame_time_s == pytest.approx(1 / 50)


def test_bvh_files_of_several_persons_begin_and_end_together(tmp_path):
    """Who comes later and leaves earlier holds their pose: a row of a BVH file has no time, so the first rows are played together."""
    (whole,), (late,) = moving(n=12, first=5).trajectories(), moving(persons=(1,), n=4, first=9).trajectories()
    written = export_trajectories([whole, late], tmp_path / "two.bvh")
    assert written.paths == tuple(tmp_path / f"two_person_{k}.bvh" for k in (0, 1))
    (note,) = written.notes
    assert note.startswith("person 1: is there in frames 9 to 12 of the recording, which are rows 5 to 8 of 12;")
    for path, one, rows in zip(written.paths, (whole, late), (range(12), [0] * 4 + [0, 1, 2, 3] + [3] * 4), strict=True):
        file = read_bvh(path)
        points = bvh_positions(file)[0][:, [file.names.index(name) for name in LANDMARKS]] / 100
        assert np.allclose(elsewhere.from_z_forward(points), one.positions[rows], atol=1e-6)
    alone = export_trajectories([late], tmp_path / "one.bvh")
    assert alone.paths == (tmp_path / "one.bvh",) and not alone.notes
    assert len(bvh_positions(read_bvh(tmp_path / "one.bvh"))[0]) == 4


def test_gaps_and_held_poses_are_said_each_by_itself(tmp_path):
    (whole,), (late,) = moving(n=12, first=5).trajectories(), with_gap(moving(persons=(1,), n=5, first=9), [2]).trajectories()
    gap, held = export_trajectories([whole, late], tmp_path / "two.bvh").notes
    assert "in 1 of 5 frames" in gap and "frames 9 to 13" in held


def test_formats_without_gaps_are_filled_and_say_so(tmp_path):
    (whole,), (one,) = moving().trajectories(), with_gap(moving(), [4, 5]).trajectories()
    written = export_trajectories([one], tmp_path / "walk.bvh")
    assert "2 of 12 frames" in written.notes[0]
    file = read_bvh(tmp_path / "walk.bvh")
    points = bvh_positions(file)[0][:, [file.names.index(name) for name in LANDMARKS]] / 100
    # Every angle of these people moves straight, so what is put between is what was there.
    assert np.allclose(elsewhere.from_z_forward(points), whole.positions, atol=1e-6)


def test_gaps_are_filled_up_to_a_length():
    (one,) = with_gap(moving(n=20), [3, 4, 10, 11, 12]).trajectories()
    filled = fill_trajectory(one, "spline", max_gap_s=2 / 50)
    assert np.flatnonzero(np.isnan(filled.positions).any(axis=(1, 2))).tolist() == [10, 11, 12]
    (whole,) = moving(n=20).trajectories()
    assert np.abs(filled.positions[3:5] - whole.positions[3:5]).max() < 0.01
    assert np.isfinite(fill_trajectory(one, "linear").positions).all()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        *(({"fps": fps}, f"`fps` must be a number above 0; got {fps}") for fps in (0, -5, np.nan, np.inf, "fast")),
        ({"max_gap_s": 0.1}, "max_gap_s (--max-gap) is of fill (--fill) linear or spline: give that too, or take it out"),
        *(({"fill": "spline", "max_gap_s": gap}, f"`max_gap_s` must be a number above 0; got {gap}") for gap in (0, -1, np.nan)),
        ({"fill": "cubic"}, "`fill` must be one of none, linear, spline; got 'cubic'"),
    ],
)
@pytest.mark.parametrize("folder", [True, False], ids=["folder", "poses"])
def test_python_refuses_what_the_command_does(tmp_path, given, words, folder):
    """Times ran backwards at -5 frames a second, 0 was the recording's rate, and `cubic` was linear."""
    people = with_gap(moving(), [4, 5])
    people.save(tmp_path / "two")
    with pytest.raises(ValueError, match=f"^{re.escape(words)}$"):
        hmc.export(tmp_path / "two" if folder else people, tmp_path / "walk.csv", **given)
    assert not (tmp_path / "walk.csv").exists()


def test_each_step_of_an_export_refuses_by_itself(tmp_path):
    people = with_gap(moving(), [4, 5])
    people.save(tmp_path)
    (one,) = people.trajectories()
    for wrong in (
        lambda: people.trajectories(0),
        lambda: read_trajectories(tmp_path, -5),
        lambda: fill_trajectory(one, "cubic"),
        lambda: fill_trajectory(one, "none", 0.1),
        lambda: fill_gaps(one.positions, "cubic"),
    ):
        with pytest.raises(InputError):
            wrong()
    assert people.trajectories(np.float32(25))[0].fps == 25 and read_trajectories(tmp_path, 25)[0].fps == 25


def test_half_a_turn_is_followed_through():
    people = moving(n=9)
    yaw = dof_index("root_rz")[0]
    states = people.states.states.copy()
    states[:, yaw] = np.radians([170, 174, 178, 0, 0, -170, -166, -162, -158])
    people = replace(people, states=replace(people.states, states=states))
    (one,) = with_gap(people, [3, 4]).trajectories()
    assert np.allclose(np.degrees(fill_trajectory(one, "linear").states[3:5, yaw]), [182, 186])


def test_a_glb_is_as_the_specification_has_it(tmp_path):
    hmc.export(moving(persons=(0, 1)), tmp_path / "two.glb")
    content = (tmp_path / "two.glb").read_bytes()
    assert content[:4] == b"glTF" and int.from_bytes(content[8:12], "little") == len(content)
    length = int.from_bytes(content[12:16], "little")
    text = json.loads(content[20 : 20 + length])
    assert len(text["scenes"][0]["nodes"]) == 2 and length % 4 == 0
    assert text["buffers"][0]["byteLength"] <= int.from_bytes(content[20 + length : 24 + length], "little")
    assert all(view["byteOffset"] % 4 == 0 for view in text["bufferViews"])


def test_triangles_of_the_flesh_look_outwards():
    from hmc.motion.body_tree import flesh_meshes

    for mesh in flesh_meshes(default_body(1.8)).values():
        a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
        faces, normals = np.cross(b - a, c - a), mesh.normals[mesh.triangles].sum(axis=1)
        assert ((faces * normals).sum(axis=1) > 0).all()


def test_command_line(tmp_path, capsys):
    people = moving(persons=(0, 1))
    replace(people, fps=None).save(tmp_path / "result")
    assert main(["export", str(tmp_path / "result"), "--to", "trc"]) == 2
    assert "give --fps" in capsys.readouterr().err
    people.save(tmp_path / "saved")  # without run.toml
    assert main(["export", str(tmp_path / "saved"), "--to", "csv"]) == 0
    times = np.loadtxt(tmp_path / "saved" / "motion.csv", delimiter=",", skiprows=1, usecols=1)
    assert np.isclose(times[1] - times[0], 1 / people.fps, atol=2e-6)
    assert main(["export", str(tmp_path / "result"), "--to", "trc", "--fps", "50", "--person", "7"]) == 2
    assert "there are 0, 1" in capsys.readouterr().err
    (tmp_path / "result" / "run.toml").write_text("[parameters]\nfps = 50.0\n")
    assert main(["export", str(tmp_path / "result"), "--to", "mot", "--smooth", "butterworth"]) == 0
    names = [f"motion_person_{k}.{suffix}" for k in (0, 1) for suffix in ("mot", "osim")]
    assert all((tmp_path / "result" / name).is_file() for name in names)
    (tmp_path / "result" / "pose.npz").unlink()
    assert main(["export", str(tmp_path / "result"), "--to", "bvh"]) == 2
    assert "needs the body's angles" in capsys.readouterr().err
    assert main(["export", str(tmp_path / "result"), "--to", "csv"]) == 0
    assert main(["export", str(tmp_path / "none"), "--to", "csv"]) == 2
    capsys.readouterr()
    assert main(["export", str(tmp_path / "result"), "--to", "trc", "--out", str(tmp_path / "walk.csv")]) == 2
    assert "ends as csv does, and trc is asked for" in capsys.readouterr().err and not (tmp_path / "walk.csv").exists()
    assert main(["export", str(tmp_path / "result"), "--to", "trc", "--out", str(tmp_path / "walk.txt")]) == 0


def test_a_model_that_is_not_ours_is_not_written_over(tmp_path):
    """A laboratory's scaled model is called as its motion is."""
    people, model = moving(), tmp_path / "subject01.osim"
    model.write_text('<OpenSimDocument Version="40000"><Model name="scaled"/></OpenSimDocument>')
    with pytest.raises(InputError, match=re.escape(f"{model}: is another model")):
        hmc.export(people, tmp_path / "subject01.mot")
    assert "scaled" in model.read_text() and not (tmp_path / "subject01.mot").exists()
    for _ in range(2):  # one of ours is
        hmc.export(people, tmp_path / "walk.mot")


def test_tables_have_the_trust_of_landmarks_where_it_is_known(tmp_path):
    people = moving()
    trust = np.linspace(0.5, 1.0, people.positions[..., 0].size).reshape(people.positions.shape[:2]).round(3)
    hmc.export(replace(people, poses=replace(people.poses, trust=trust)), tmp_path / "walk.csv")
    hmc.export(people, tmp_path / "without.csv")
    heads = [(tmp_path / name).read_text().split("\n", 1)[0].split(",") for name in ("walk.csv", "without.csv")]
    assert [name for name in heads[0] if name not in heads[1]] == [f"{name}_trust" for name in LANDMARKS]
    first = (tmp_path / "walk.csv").read_text().splitlines()[1].split(",")
    assert [float(first[heads[0].index(f"{name}_trust")]) for name in LANDMARKS] == trust[0].tolist()


def test_wrong_input(tmp_path):
    with pytest.raises(InputError, match="no format of that suffix"):
        hmc.export(moving(), tmp_path / "walk.fbx")
    with pytest.raises(InputError, match="give fps"):
        hmc.export(replace(moving(), fps=None), tmp_path / "walk.trc")


@pytest.mark.parametrize("package,kind", [("ezc3d", "c3d"), ("pyarrow", "parquet")])
def test_a_missing_package_is_named(tmp_path, monkeypatch, package, kind):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=rf"needs {package}.*`biomech`"):
        hmc.export(moving(), tmp_path / f"walk.{kind}")


def test_a_result_on_disk_is_the_same(tmp_path):
    people = moving()
    write_joints(tmp_path / "joints.csv", people.poses)
    write_pose(tmp_path / "pose.npz", people.states)
    (read,), (kept,) = read_trajectories(tmp_path, fps=50), trajectories(people.poses, people.states, 50)
    assert np.allclose(read.positions, kept.positions, atol=1e-6) and (read.states == kept.states).all()
