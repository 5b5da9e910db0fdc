"""`hmc evaluate`: scores of results whose errors we know because we made them."""

from __future__ import annotations

import csv
import tomllib
from dataclasses import replace

import numpy as np
import pytest

import hmc
from hmc.cli import main
from hmc.errors import InputError
from hmc.io.results import PoseTable, TrackTable, read_joints, write_joints, write_run, write_tracks
from hmc.landmarks import FOOT_POINTS, LANDMARKS, landmark_index
from hmc.metrics.persons import exchange_sides
from hmc.metrics.scores import evaluate_pose, evaluate_tracks, pelvis_tracks


@pytest.fixture
def truth() -> PoseTable:
    """Two persons, 2 m apart, who drift through 20 frames."""
    rng = np.random.default_rng(0)
    frames, persons = (grid.ravel() for grid in np.mgrid[:20, :2])
    body = rng.uniform([-0.4, -0.4, 0], [0.4, 0.4, 1.8], (2, 15, 3))
    place = np.stack([2.0 * persons, 0.02 * frames, 0 * frames], axis=1)
    return PoseTable(frames, persons, body[persons] + place[:, None])


def centroids(poses: PoseTable) -> TrackTable:
    points = poses.positions.mean(axis=1)
    return TrackTable(poses.frames, poses.persons, points, points + np.array([0, 0, 0.7]))


@pytest.fixture
def recording(tmp_path, truth):
    folder = tmp_path / "recording"
    write_joints(folder / "truth" / "joints.csv", truth)
    write_tracks(folder / "truth" / "centroids.csv", centroids(truth))
    return folder


@pytest.fixture
def result(tmp_path, truth):
    """Every landmark 30 mm off, the left wrist of the second person 80 mm; other person numbers."""
    positions = truth.positions + np.array([0.03, 0, 0])
    positions[truth.persons == 1, landmark_index("l_wrist"), 0] += 0.05
    folder = tmp_path / "result"
    names = np.array([7, 4])[truth.persons]
    write_joints(folder / "joints.csv", PoseTable(truth.frames, names, positions))
    tracks = centroids(truth)
    write_tracks(folder / "tracks.csv", TrackTable(tracks.frames, names, tracks.positions + np.array([0, 0.06, 0.4])))
    return folder


@pytest.mark.parametrize("known", ["views", "trust"])
def test_doubtful_landmarks_are_scored_apart(known, result, recording, capsys):
    found = read_joints(result / "joints.csv")
    values = np.full(found.positions.shape[:2], {"views": 3.0, "trust": 0.95}[known])
    values[found.persons == 4, landmark_index("l_wrist")] = {"views": 1, "trust": 0.6}[known]  # 80 mm off, all others 30
    write_joints(result / "joints.csv", replace(found, **{known: values}))
    assert main(["evaluate", str(result), str(recording)]) == 0
    report = tomllib.loads((result / "metrics.toml").read_text())["pose"]
    assert report["doubtful"] == pytest.approx({"landmarks": 20, "mean_mm": 80, "mmta_at_100mm": 1, "mmta_at_50mm": 0})
    assert report["trusted"] == pytest.approx({"landmarks": 580, "mean_mm": 30, "mmta_at_100mm": 1, "mmta_at_50mm": 1})
    assert "20 landmarks that are doubtful: mean 80.0 mm, 1.000 within 100 mm, 0.000 within 50 mm" in capsys.readouterr().out


def test_known_errors_come_out(result, recording, capsys):
    assert main(["evaluate", str(result), str(recording)]) == 0
    with open(result / "metrics.csv", newline="") as file:
        rows = {(row["person"], row["landmark"]): row for row in csv.DictReader(file)}
    assert len(rows) == 3 * 16
    neck, wrist, overall = rows["all", "neck"], rows["all", "l_wrist"], rows["all", "overall"]
    assert float(neck["mean_mm"]) == pytest.approx(30, abs=1e-3) and float(neck["mmta_at_50mm"]) == 1
    assert float(wrist["mean_mm"]) == pytest.approx(55, abs=1e-3)
    assert float(wrist["mmta_at_100mm"]) == 1 and float(wrist["mmta_at_50mm"]) == 0.5
    assert float(wrist["mmtp_mm_at_50mm"]) == pytest.approx(30, abs=1e-3)
    assert rows["1", "l_wrist"]["mmtp_mm_at_50mm"] == ""  # nothing matched, so there is no precision
    assert float(overall["mean_mm"]) == pytest.approx(30 + 50 / 30, abs=1e-3)
    assert (overall["frames"], rows["0", "overall"]["frames"]) == ("40", "20")
    with open(result / "metrics.toml", "rb") as file:
        report = tomllib.load(file)
    assert report["pose"]["coverage"] == 1 and report["notes"] == []
    assert report["pose"]["persons"]["0"]["estimated_as"] == [7]
    assert report["pose"]["initialisation_mean_mm"] == pytest.approx(30 + 50 / 30, abs=1e-3)
    assert report["tracks"]["mota"] == 1 and report["tracks"]["motp_mm"] == pytest.approx(60, abs=1e-3)
    out = capsys.readouterr().out
    assert "40 with an estimate (100.0%)" in out and "MOTP 60.0 mm, MOTA 1.0000" in out
    assert all(f"\n{name} " in out for name in (*LANDMARKS, "overall"))


def test_missing_frames_count_against_coverage_and_mmta(truth):
    kept = ~((truth.persons == 0) & (truth.frames >= 15))
    found = evaluate_pose(truth.where(kept), truth)
    overall = found.rows[len(LANDMARKS)]
    assert overall["mean_mm"] == 0 and overall["mmta_at_100mm"] == pytest.approx(35 / 40)
    assert found.summary["coverage"] == pytest.approx(35 / 40)
    assert any("person 0: no estimate in frames 15-19 (5 frames)" in note for note in found.notes)


def test_swapped_legs_lost_frames_and_strangers_are_told(truth):
    positions = truth.positions.copy()
    swapped = (truth.persons == 1) & (truth.frames >= 4) & (truth.frames < 9)
    positions[swapped] = exchange_sides(positions[swapped], "legs")
    lost = (truth.persons == 0) & (truth.frames == 12)
    positions[lost] += [0, 0.4, 0]
    stranger = np.arange(3), np.full(3, 9), np.full((3, 15, 3), 50.0)
    estimate = PoseTable(*(np.concatenate([a, b]) for a, b in zip((truth.frames, truth.persons, positions), stranger, strict=True)))
    notes = evaluate_pose(estimate, truth).notes
    assert any(note.startswith("person 1: left and right legs seem swapped in frames 4-8 (5 frames)") for note in notes)
    assert "person 0: mean error above 150 mm in frame 12" in notes
    assert "estimated person 9 (3 frames) matches no true person" in notes
    assert not any("arms" in note for note in notes)


def test_a_person_who_was_never_estimated_counts(truth):
    found = evaluate_pose(truth.of(0), truth)
    assert "person 1 was never estimated" in found.notes
    assert found.summary["mmta_at_100mm"] == pytest.approx(0.5)
    nothing = evaluate_pose(truth.where(np.zeros(0, int)), truth)
    assert nothing.summary["coverage"] == 0 and np.isnan(nothing.summary["mean_mm"])
    assert evaluate_tracks(centroids(truth).of(0), centroids(truth)).misses == 20


def test_only_the_frames_of_the_run_count(result, recording, truth, capsys):
    part = (truth.frames >= 5) & (truth.frames < 10)
    write_joints(result / "joints.csv", truth.where(part))
    assert main(["evaluate", str(result), str(recording), "--quiet"]) == 0
    assert "10 with an estimate (25.0%)" in capsys.readouterr().out
    write_run(result / "run.toml", "x", {"start": 5, "frames": 5}, 0)
    assert main(["evaluate", str(result), str(recording), "--quiet"]) == 0
    assert "10 with an estimate (100.0%)" in capsys.readouterr().out
    assert main(["evaluate", str(result), str(recording), "--quiet", "--start", "8", "--frames", "1"]) == 0
    assert "2 with an estimate (100.0%)" in capsys.readouterr().out
    for asked, n in ((["--start", "8"], 4), (["--frames", "1"], 2)):  # what is not asked for is as the run had it
        assert main(["evaluate", str(result), str(recording), "--quiet", *asked]) == 0
        assert f"{n} with an estimate (100.0%)" in capsys.readouterr().out
    assert main(["evaluate", str(result), str(recording), "--start", "100"]) == 2


def test_a_reference_elsewhere_and_tracks_without_centroids(result, truth, tmp_path, capsys):
    write_joints(tmp_path / "reference.csv", truth)
    assert main(["evaluate", str(result), "--truth", str(tmp_path / "reference.csv")]) == 0
    assert "against the true pelvis" in capsys.readouterr().out
    write_tracks(tmp_path / "where.csv", centroids(truth))
    assert main(["evaluate", str(result), "--truth", str(tmp_path / "where.csv")]) == 0
    out = capsys.readouterr().out
    assert "MOTP 60.0 mm" in out and "poses" not in out


def test_tracks_beyond_the_truth_are_told(result, truth, tmp_path, capsys):
    for last, told in ((truth.frames.max(), False), (12, True)):
        write_joints(tmp_path / "reference.csv", truth.where(truth.frames <= last))
        assert main(["evaluate", str(result), "--truth", str(tmp_path / "reference.csv")]) == 0
        out = capsys.readouterr().out
        assert ("rows of the tracks are outside the truth's frames 0 to 12 and count as false positives" in out) == told


def test_a_result_of_another_recording_is_told(result, recording, tmp_path, capsys):
    for made, told in ((tmp_path / "elsewhere" / recording.name, False), (tmp_path / "other_take", True)):
        write_run(result / "run.toml", "apf", {}, 0, recording=made)
        assert main(["evaluate", str(result), str(recording)]) == 0
        assert (f"the result was made from {made}" in capsys.readouterr().out) == told


def test_wrong_input_is_one_line_and_exit_code_2(result, tmp_path, capsys):
    empty = tmp_path / "empty"
    empty.mkdir()
    for arguments, says in [
        ([str(result), str(empty)], "no truth/joints.csv and no truth/centroids.csv"),
        ([str(result), str(tmp_path / "none")], "none: no such folder"),
        ([str(tmp_path / "none"), str(empty)], "none: no such folder"),
        ([str(result)], "give the RECORDING"),
        ([str(result), "--truth", str(tmp_path / "none.csv")], "none.csv: no such file"),
    ]:
        assert main(["evaluate", *arguments]) == 2
        captured = capsys.readouterr()
        assert says in captured.err and captured.err.count("\n") == 1 and captured.out == ""


def test_a_result_without_tables_is_refused(recording, tmp_path, capsys):
    (tmp_path / "nothing").mkdir()
    assert main(["evaluate", str(tmp_path / "nothing"), str(recording)]) == 2
    assert "neither joints.csv nor tracks.csv" in capsys.readouterr().err


def test_empty_truth_is_refused(truth):
    with pytest.raises(InputError, match="the truth has no row in these frames"):
        evaluate_pose(truth, truth.where(np.zeros(0, int)))


def test_tracks_are_compared_where_the_truth_says_where_people_are(result, truth, tmp_path, capsys):
    """Without a pelvis by the middle of the hips, without these not at all; of every second frame: not between."""
    pelvis, hips = landmark_index("pelvis"), [landmark_index("l_hip"), landmark_index("r_hip")]
    true_pelvis = TrackTable(truth.frames, truth.persons, truth.positions[:, hips].mean(axis=1))
    names = np.array([7, 4])[truth.persons]
    write_tracks(result / "tracks.csv", TrackTable(truth.frames, names, true_pelvis.positions + np.array([0.02, 0, 0])))
    every_row = np.ones(len(truth.frames), bool)
    cases = [
        ([pelvis], every_row, "MOTP 20.0 mm, MOTA 1.0000, 0 misses, 0 false positives, 0 mismatches in 40 person-frames", None),
        ([pelvis, *hips], truth.frames < 5, "in 30 person-frames", "tracks are not compared in frames 0-4 (5 frames)"),
        ([pelvis, *hips], every_row, None, "tracks are not compared in frames 0-19 (20 frames)"),
    ]
    for without, where, says, note in cases:
        positions = truth.positions.copy()
        positions[np.ix_(where, without)] = np.nan
        write_joints(tmp_path / "reference.csv", replace(truth, positions=positions))
        assert main(["evaluate", str(result), "--truth", str(tmp_path / "reference.csv")]) == 0
        out = capsys.readouterr().out
        assert says in out if says else "MOTA" not in out
        assert note in out if note else "not compared" not in out
    positions = truth.positions.copy()
    positions[:, pelvis] = np.nan
    write_joints(tmp_path / "reference.csv", replace(truth, positions=positions).where(truth.frames % 2 == 1))
    assert main(["evaluate", str(result), "--truth", str(tmp_path / "reference.csv")]) == 0
    out = capsys.readouterr().out
    assert "MOTA 1.0000" in out and "20 person-frames" in out and "the truth is of one frame in 2" in out


def test_centroids_that_are_never_known_and_results_of_nobody_are_told(result, truth, tmp_path, capsys):
    write_tracks(tmp_path / "where.csv", replace(centroids(truth), positions=np.full((40, 3), np.nan)))
    assert main(["evaluate", str(result), "--truth", str(tmp_path / "where.csv")]) == 2
    assert "where.csv: nothing can be scored: tracks are not compared in frames 0-19" in capsys.readouterr().err
    # Poses are scored all the same, of which alone the report then tells.
    positions = truth.positions.copy()
    positions[:, [landmark_index(name) for name in ("pelvis", "l_hip", "r_hip")]] = np.nan
    write_joints(tmp_path / "joints.csv", replace(truth, positions=positions))
    given = ["--truth", str(tmp_path / "joints.csv")]
    assert main(["evaluate", str(result), *given]) == 0
    report = tomllib.loads((result / "metrics.toml").read_text())
    assert "tracks" not in report and report["pose"] and "tracks are not compared in frames 0-19" in report["notes"][-1]
    (result / "joints.csv").unlink()
    assert main(["evaluate", str(result), *given]) == 2
    assert "joints.csv: nothing can be scored: tracks are not compared" in capsys.readouterr().err
    write_joints(tmp_path / "reference.csv", truth)
    write_joints(result / "joints.csv", truth.where(np.zeros(0, int)))
    assert main(["evaluate", str(result), "--truth", str(tmp_path / "reference.csv")]) == 0
    assert "note: nobody has a pose in the estimate" in capsys.readouterr().out


def test_a_person_without_any_landmark_is_not_there(truth):
    positions = truth.positions.copy()
    positions[truth.persons == 1] = np.nan
    assert set(pelvis_tracks(replace(truth, positions=positions)).persons.tolist()) == {0}


def test_true_centroids_need_no_heads(result, truth, tmp_path, capsys):
    write_tracks(tmp_path / "where.csv", replace(centroids(truth), heads=None))
    assert main(["evaluate", str(result), "--truth", str(tmp_path / "where.csv")]) == 0
    assert "MOTP 60.0 mm" in capsys.readouterr().out


def test_from_python_only_the_frames_of_the_recording_count_and_the_pelvis_will_do(recording, truth):
    part = replace(hmc.sample(), path=recording, start=5, n_frames=5)
    assert hmc.evaluate(centroids(truth), part).mota == 1
    (recording / "truth" / "centroids.csv").unlink()
    scores = hmc.evaluate(TrackTable(truth.frames, truth.persons, truth.positions[:, landmark_index("pelvis")]), part)
    assert scores.mota == 1 and scores.objects == 10
    with pytest.raises(InputError, match="none in common"):
        hmc.evaluate(centroids(truth), replace(part, start=500))


def test_a_truth_of_other_frames_or_another_world_is_told(result, truth, tmp_path, capsys):
    reference = tmp_path / "reference.csv"
    write_run(result / "run.toml", "x", {"start": 0, "frames": 20}, 0)
    write_joints(reference, replace(truth, frames=truth.frames + 1000))
    assert main(["evaluate", str(result), "--truth", str(reference)]) == 2
    assert f"{reference}: has frames 1000 to 1019, and compared are frames 0 to 19: none in common" in capsys.readouterr().err
    write_joints(reference, replace(truth, positions=truth.positions + np.array([0, 50.0, 0])))
    assert main(["evaluate", str(result), "--truth", str(reference)]) == 0
    assert "the nearest estimated and true person are 50.00 m apart" in capsys.readouterr().out


def test_what_is_no_table_of_the_truth_is_told_with_its_first_line(result, tmp_path, capsys):
    table = tmp_path / "truth.csv"
    for first in ("frame;person;joint;x;y;z", "PathFileType\t4\t(X/Y/Z)\ttruth.trc", "frame,pelvis_x,pelvis_y,pelvis_z"):
        table.write_text(first + "\n0\n")
        assert main(["evaluate", str(result), "--truth", str(table)]) == 2
        said = capsys.readouterr().err
        assert "the first line must be frame,person,joint,x,y,z (joints)" in said and repr(first) in said and said.count("\n") == 1


def test_the_ends_of_the_soles_count_in_the_frames_that_are_compared(result, recording, truth, capsys):
    feet = np.zeros((len(truth.frames), 4, 3))
    write_joints(recording / "truth" / "feet.csv", PoseTable(truth.frames, truth.persons, feet, names=FOOT_POINTS))
    feet[truth.frames >= 10, :, 2] = 0.1
    write_joints(result / "feet.csv", PoseTable(truth.frames, np.array([7, 4])[truth.persons], feet, names=FOOT_POINTS))
    for start, apart in ((0, 50), (10, 100)):
        assert main(["evaluate", str(result), str(recording), "--quiet", "--start", str(start)]) == 0
        assert f"heels {apart}.0 mm, toes {apart}.0 mm" in capsys.readouterr().out
