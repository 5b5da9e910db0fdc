"""Which way is up, where the floor is and how long a metre: of drawn people in calibrations of any world."""

import re
import tomllib
from itertools import pairwise

import cv2
import numpy as np
import pytest
from drawn import HEIGHT_M, draw_recording, floor_patch, post, walk
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from hmc.camera.model import Rig, look_at, project
from hmc.camera.world import World, in_world
from hmc.check import check_recording, inspect_recording
from hmc.check.find_world import Known, find_world
from hmc.check.given_points import board_points, read_points
from hmc.check.hidden import find_legs, hidden_below, shown_below
from hmc.check.upright import Figure, find_figures, find_ground
from hmc.check.world_findings import floor_lines
from hmc.cli import main
from hmc.errors import InputError
from hmc.io.calibration import read_calibration, write_calibration
from hmc.io.new_world import without_old_terms, write_new_world

FIRST = Rotation.from_euler("zyx", (100, 25, 110), degrees=True).as_matrix()
WORLDS = {
    "first camera": World(FIRST, np.array([3.5, 0, 2.0]), 1.0),
    "board squares": World(FIRST, np.array([3.5, 0, 2.0]), 20.0),
    "y up, millimetres": World(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), np.zeros(3), 1000.0),
    "z down": World(np.diag([1.0, -1, -1]), np.zeros(3), 1.0),
}


@pytest.fixture(scope="module")
def moments(ring):
    """Silhouettes of one who walks in a circle."""
    return [[post(camera, 0.7 * np.cos(a), 0.7 * np.sin(a)) for camera in ring] for a in np.linspace(0, 5, 8)]


def tilt_deg(one, other):
    return np.rad2deg(np.arccos(np.clip(one @ other, -1, 1)))


@pytest.mark.parametrize("name", WORLDS)
def test_up_floor_and_stature_are_found_in_any_world(ring, moments, name):
    world = WORLDS[name]
    rig = in_world(ring, world)
    ground = find_ground(rig, find_figures(rig, moments))
    assert tilt_deg(world.rotation.T @ ground.up, [0, 0, 1]) < 1.0
    assert abs(world.old_points(ground.middle)[2]) < 0.06
    assert ground.stature / world.scale == pytest.approx(HEIGHT_M, abs=0.08)
    assert (ground.standing, ground.figures) == (8, 8)
    lines = world.old_points(floor_lines(ground).reshape(-1, 3)).reshape(-1, 2, 3)
    assert lines.shape == (10, 2, 3) and np.abs(lines[..., 2]).max() < 0.12
    assert_allclose([np.linalg.norm(a[0] - b[0]) for a, b in pairwise(lines[:5])], HEIGHT_M / 1.72, atol=0.06)


def standing_still(world, rng, n_moments=12):
    """Hulls of three who hardly move and lean alike: each one's end too high or too low in all moments, as the same cameras see them."""
    lean = np.array([*np.tan(rng.normal(0, np.deg2rad(2), 2)), 1])
    figures = []
    for x, y in ((-1.2, -0.4), (0.9, -0.8), (0.2, 1.1)):
        low = rng.normal(0, 0.03)
        for moment in range(n_moments):
            radius, angle = 0.15 * np.sqrt(rng.uniform(size=4000)), rng.uniform(0, 2 * np.pi, 4000)
            height = rng.uniform(low + rng.normal(0, 0.005), HEIGHT_M, 4000)
            points = np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle), height])
            figures.append(Figure(world.points(points), world.rotation @ lean / np.linalg.norm(lean), 4.0, moment))
    return figures


def test_up_is_as_near_as_is_said(ring):
    world, near = WORLDS["first camera"], []
    rig = in_world(ring, world)
    for seed in range(20):
        ground = find_ground(rig, standing_still(world, np.random.default_rng(seed)))
        (said,) = re.findall(r"to within (\S+) deg \(19 times in 20\)", find_world(rig, ground, None, Known(unit_m=1.0)).lines[0])
        near.append(tilt_deg(world.rotation.T @ ground.up, [0, 0, 1]) <= float(said))
    assert sum(near) >= 18


def test_cameras_upside_down_and_on_their_sides_do_not_turn_the_world(ring, moments):
    turned = []
    for camera, degrees in zip(ring, (180, 90, 180, 180, 5), strict=True):
        roll = Rotation.from_euler("z", degrees, degrees=True).as_matrix()
        size = camera.size
        matrix = camera.matrix.copy()
        turned.append(type(camera)(camera.name, size, matrix, np.zeros(5), roll @ camera.rotation, roll @ camera.translation))
    rig = Rig(tuple(turned))
    masks = [[post(camera, 0.7 * np.cos(a), 0.7 * np.sin(a)) for camera in rig] for a in np.linspace(0, 5, 6)]
    assert tilt_deg(find_ground(rig, find_figures(rig, masks)).up, [0, 0, 1]) < 2.5


def without_legs(moments, n_cameras):
    """So many cameras see nothing below the thighs."""
    cut = []
    for masks in moments:
        cut.append([mask.copy() for mask in masks])
        for mask in cut[-1][:n_cameras]:
            rows = np.flatnonzero(mask.any(axis=1))
            mask[(rows[0] + 3 * rows[-1]) // 4 :] = False
    return cut


@pytest.mark.parametrize("name", WORLDS)
def test_legs_that_furniture_hides_are_found_by_the_cameras_that_see_them(ring, moments, name):
    world = WORLDS[name]
    rig, cut = in_world(ring, world), without_legs(moments, 2)
    figures = find_figures(rig, cut)
    lower, ground, hidden = find_legs(rig, figures, cut, find_ground(rig, figures))
    assert hidden == () and ground.by == ring.names[2:] and len(lower) == len(figures)
    assert abs(world.old_points(ground.middle)[2]) < 0.06
    assert ground.stature / world.scale == pytest.approx(HEIGHT_M, abs=0.08)
    said = find_world(rig, ground, None, Known(height_m=HEIGHT_M))
    assert said.world.scale * world.scale == pytest.approx(1.0, abs=0.05)
    assert "cam_02, cam_03, cam_04 alone" in " ".join(said.lines)


def test_legs_that_two_cameras_alone_see_are_told(ring, moments):
    """Hulls end at the thighs, and a stature must not tell the scale."""
    cut = without_legs(moments, 3)
    figures = find_figures(ring, cut)
    ground = find_ground(ring, figures)
    assert find_legs(ring, figures, cut, ground) == (figures, ground, ring.names[3:])
    with pytest.raises(InputError, match="tells no scale"):
        find_world(ring, ground, None, Known(height_m=HEIGHT_M), ring.names[3:])


def test_legs_that_furniture_hides_are_noticed(ring, moments):
    """Two of five cameras see nothing below the thighs: hulls end there, and a stature must not tell the scale."""
    cut = without_legs(moments, 2)
    figures = find_figures(ring, cut)
    ground = find_ground(ring, figures)
    assert ground.floor > 0.25
    assert hidden_below(ring, figures, cut, ground.up) == ring.names[2:]
    whole = find_figures(ring, moments)
    assert np.abs(shown_below(ring, whole, moments, find_ground(ring, whole).up)).max() < 0.05
    with pytest.raises(InputError, match="tells no scale"):
        find_world(ring, ground, None, Known(height_m=HEIGHT_M), ring.names[2:])
    told = find_world(ring, ground, None, Known(unit_m=1.0), ring.names[2:])
    assert "so the floor is lower" in " ".join(told.lines)


def test_a_session_gets_a_calibration_beside_its_file(ring, moments, tmp_path, capsys):
    lab = tmp_path / "lab"
    turned = in_world(ring, WORLDS["y up, millimetres"])
    draw_recording(lab / "trials" / "walk", ring, walk(12), shape=post)
    (lab / "trials" / "walk" / "calibration.toml").unlink()
    (lab / "trials" / "walk" / "recording.toml").unlink()
    write_calibration(lab / "calibration.toml", turned)
    text = 'calibration = "calibration.toml"\ntrials = "trials/*"\n[recording]\nunits = "cm"\n'
    (lab / "session.toml").write_text(text)
    words = ["world", str(lab / "trials" / "walk"), "--session", str(lab / "session.toml"), "--out", str(tmp_path / "a.png")]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert 'calibration = "calibration_world.toml"' in said and "`units`" in said
    assert said.endswith(f"next: hmc check {lab / 'trials' / 'walk'} --session {lab / 'session.toml'}\n")
    assert (lab / "session.toml").read_text() == text and not (lab / "trials" / "walk" / "calibration.toml").exists()
    found = read_calibration(lab / "calibration_world.toml")
    apart = [np.linalg.norm(rig[0].centre - rig[2].centre) for rig in (found, ring)]
    assert apart[0] == pytest.approx(apart[1], rel=1e-3)


def test_nothing_is_found_of_noise(ring):
    rng = np.random.default_rng(0)
    noise = [[rng.random(camera.size[::-1]) < 0.3 for camera in ring] for _ in range(3)]
    assert find_ground(ring, find_figures(ring, noise)) is None
    with pytest.raises(InputError, match="nobody is seen to stand"):
        find_world(ring, None, None, Known())


def found(ring, moments, world, known=None):
    rig = in_world(ring, world)
    return find_world(rig, find_ground(rig, find_figures(rig, moments)), None, known or Known())


def test_an_axis_and_a_unit_that_are_meant_are_taken_as_they_are(ring, moments):
    one = found(ring, moments, WORLDS["y up, millimetres"])
    assert_allclose(one.world.rotation, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-12)
    assert (one.world.scale, one.as_it_was) == (0.001, False) and not one.world.origin.any()
    assert found(ring, moments, World()).as_it_was


def test_the_scale_is_asked_for_where_nothing_tells_it(ring, moments):
    squares = WORLDS["board squares"]
    with pytest.raises(InputError, match=r"36.1 units tall.*--unit METRES.*--distance.*--height"):
        found(ring, moments, squares)
    assert found(ring, moments, squares, Known(unit_m=0.05)).world.scale == 0.05
    apart = float(np.linalg.norm(ring[0].centre - ring[2].centre))
    by_distance = found(ring, moments, squares, Known(distance=("cam_00", "cam_02", apart)))
    assert by_distance.world.scale == pytest.approx(0.05, rel=1e-6)
    assert found(ring, moments, squares, Known(height_m=HEIGHT_M)).world.scale == pytest.approx(0.05, rel=0.05)
    assert found(ring, moments, World(), Known(height_m=HEIGHT_M)).as_it_was  # metres, near enough


def test_points_of_the_floor_tell_up_and_their_places_everything(ring, tmp_path):
    world = WORLDS["board squares"]
    rig = in_world(ring, world)
    places = np.array([[-0.5, -0.5, 0], [0.6, -0.4, 0], [0.5, 0.7, 0], [-0.6, 0.4, 0]])
    rows = [
        (k, camera.name, *project(camera, world.points(place))[0], *place) for k, place in enumerate(places) for camera in (rig[0], rig[1])
    ]
    file = tmp_path / "points.csv"
    write_csv(file, "point,camera,u,v", [row[:4] for row in rows])
    points = read_points(file, rig)
    assert tilt_deg(world.rotation.T @ points.up, [0, 0, 1]) < 1e-3
    assert find_world(rig, None, points, Known(unit_m=0.05)).world.points(world.points([0.0, 0, 1.0]))[2] == pytest.approx(1.0, abs=1e-5)
    with pytest.raises(InputError, match="nothing tells the scale"):
        find_world(rig, None, points, Known())
    write_csv(file, "point,camera,u,v,x,y,z", rows)
    assert_allclose(find_world(rig, None, read_points(file, rig), Known()).world.points(world.points(places)), places, atol=1e-5)


def write_csv(file, header, rows):
    file.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([], "no column"),
        ([(0, "cam_00", 1, 2)], "in one camera only"),
        ([(0, "cam_99", 1, 2)], "no camera named 'cam_99'"),
        ([(0, "cam_00", "x", 2)], "line 2: u, v"),
        ([(0, "cam_00", "nan", 2)], "line 2: u, v must be numbers below"),
        ([(0, "cam_00", 1, 2, 0, "inf", 0)], "line 2: x, y, z must be numbers below"),
        ([(0, "cam_00", 1, 2, 0, 1e300, 0)], "line 2: x, y, z must be numbers below"),
    ],
)
def test_points_that_are_no_points_are_told(ring, tmp_path, rows, said):
    write_csv(tmp_path / "points.csv", "point,camera,u,v,x,y,z", rows)
    with pytest.raises(InputError, match=said):
        read_points(tmp_path / "points.csv", ring)


def test_a_board_on_the_floor_tells_up_and_scale():
    world = WORLDS["board squares"]
    rig = Rig(
        tuple(look_at(f"cam_{k}", (640, 480), [2.2 * np.cos(a), 2.2 * np.sin(a), 1.6], [0, 0, 0], 40) for k, a in enumerate((0, 2, 4)))
    )
    rows, columns, square = 6, 8, 0.1
    board = np.kron(np.indices((rows, columns)).sum(axis=0) % 2, np.ones((40, 40))).astype(np.uint8) * 255
    board = cv2.copyMakeBorder(board, 40, 40, 40, 40, cv2.BORDER_CONSTANT, value=255)
    corners = np.array([[-1, -1], [columns + 1, -1], [columns + 1, rows + 1], [-1, rows + 1]]) * square - 0.3
    pixels = np.array([[0, 0], [board.shape[1], 0], [board.shape[1], board.shape[0]], [0, board.shape[0]]]) - 0.5
    images = []
    for camera in rig:
        uv, _ = project(camera, np.column_stack([corners, np.zeros(4)]))
        turn = cv2.getPerspectiveTransform(pixels.astype(np.float32), uv.astype(np.float32))
        images.append(cv2.cvtColor(cv2.warpPerspective(board, turn, (640, 480), flags=cv2.INTER_AREA, borderValue=120), cv2.COLOR_GRAY2BGR))
    odd = in_world(rig, world)
    points = board_points(odd, images, (columns - 1, rows - 1), square)
    assert tilt_deg(world.rotation.T @ points.up, [0, 0, 1]) < 0.5
    assert points.unit_m == pytest.approx(0.05, rel=0.01)
    with pytest.raises(InputError, match="found by no camera"):
        board_points(odd, [np.zeros_like(image) for image in images], (7, 5))


def test_the_command_writes_a_calibration_that_check_finds_right(ring, tmp_path, capsys):
    folder = draw_recording(tmp_path / "take", ring, walk(9), silhouettes=True, shape=post)
    write_calibration(folder / "calibration.toml", in_world(ring, WORLDS["first camera"]))
    errors = [one.sentence for one in check_recording(folder) if one.severity == "error"]
    assert len(errors) == 1 and re.search(r"people stand .* degrees.*hmc world", errors[0])
    assert main(["check", str(folder), "--out", str(tmp_path / "check.png")]) == 2
    picture = cv2.imread(str(tmp_path / "check.png")).astype(int)
    assert ((picture[..., 1] > 200) & (picture[..., [0, 2]].max(axis=-1) < 60)).sum() > 1000  # the floor on which people stand, in green
    assert main(["world", str(folder), "--out", str(tmp_path / "world.png"), "--dry-run"]) == 0
    assert not list(folder.glob("*_before*"))
    assert main(["world", str(folder), "--out", str(tmp_path / "world.png")]) == 0
    assert (tmp_path / "world.png").stat().st_size > 10_000
    said = capsys.readouterr().out
    assert "by 9 hulls of people who stand" in said and "calibration_before.toml" in said
    rig = read_calibration(folder)
    # Distances are as they were, and every camera as high above the floor as it is.
    assert_allclose([np.linalg.norm(a.centre - b.centre) for a, b in pairwise(rig)], 2 * 3.5 * np.sin(np.pi / 5), rtol=1e-6)
    assert_allclose(rig.centres[:, 2], 2.0, atol=0.15)
    assert "room" not in tomllib.loads((folder / "recording.toml").read_text())
    inspection = inspect_recording(folder)
    assert inspection.usable and inspection.floor is None
    assert main(["world", str(folder), "--out", str(tmp_path / "world.png")]) == 0


def test_shadows_do_not_sink_the_floor(ring, tmp_path, monkeypatch, capsys):
    """Shadows are told from people where the floor is known: once it is found, people are looked at again in that world."""
    places = [(0.7 * np.cos(a), 0.7 * np.sin(a)) for a in np.linspace(0, 5, 8)]
    folder = draw_recording(tmp_path / "take", ring, [[place] for place in places], shape=post)
    write_calibration(folder / "calibration.toml", in_world(ring, WORLDS["first camera"]))
    heights = []

    def masks(recording, frames, medians=False):
        heights.append(recording.rig.centres[:, 2])
        known = abs(heights[-1] - 2.0).max() < 0.5
        shown = [[post(camera, *places[frame.index]) for camera in ring] for frame in frames]
        for frame, views in zip(() if known else frames, shown, strict=False):
            x, y = places[frame.index]
            for camera, view in zip(ring, views, strict=True):
                view |= floor_patch(camera, ((x - 0.15, x + 0.15), (y, y + 0.9)))
        return shown

    monkeypatch.setattr("hmc.check.moments.probe_masks", masks)
    assert main(["world", str(folder), "--out", str(tmp_path / "world.png")]) == 0
    assert len(heights) == 2
    assert_allclose(heights[0], in_world(ring, WORLDS["first camera"]).centres[:, 2])
    off = [abs(found - 2.0).max() for found in (heights[1], read_calibration(folder).centres[:, 2])]
    assert off[0] > 0.1 and off[1] < 0.08, (off, capsys.readouterr().out)


def test_a_recording_that_is_right_stays_as_it_is(ring, tmp_path, capsys):
    folder = draw_recording(tmp_path / "take", ring, walk(9), silhouettes=True, shape=post)
    before = {file.name: file.read_bytes() for file in folder.glob("*.toml")}
    assert main(["world", str(folder), "--out", str(tmp_path / "world.png")]) == 0
    assert "nothing is written" in capsys.readouterr().out
    assert before == {file.name: file.read_bytes() for file in folder.glob("*.toml")}


def test_units_and_rooms_that_do_not_fit_are_errors(ring, tmp_path):
    folder = draw_recording(tmp_path / "take", ring, walk(3), silhouettes=True, shape=post)
    write_calibration(folder / "calibration.toml", in_world(ring, World(scale=4.0)))
    assert any("7" in one.sentence and "m tall" in one.sentence for one in check_recording(folder) if one.severity == "error")
    write_calibration(folder / "calibration.toml", in_world(ring, World(origin=np.array([8.0, 0, 0]))))
    assert any(one.sentence.startswith("people are not in the room") for one in check_recording(folder) if one.severity == "error")


def test_old_terms_become_comments():
    text = 'name = "a"  # room = 1\nroom = [\n  [0, 0, 0],\n  [1, 1, 2],\n]\nunits = "mm"\nfps = 30\n[first_frame]\nup = 3\n'
    new, taken = without_old_terms(text)
    assert taken == ["room", "units"]
    assert tomllib.loads(new) == {"name": "a", "fps": 30, "first_frame": {"up": 3}}
    assert all(line.removeprefix("# of the world before: ") == old for line, old in zip(new.splitlines(), text.splitlines(), strict=True))


def test_old_terms_end_where_their_value_ends(ring, tmp_path):
    """Brackets in quotes and comments are none, and tables of any form end what holds for all of the recording."""
    text = "up = '[' # [\nroom = [ # ]\n  [0, 0, 0], [1, 1, 2]]\nfps = 30\n[[\"x\"]]\nroom = 3\n"
    new, taken = without_old_terms(text)
    assert taken == ["up", "room"] and tomllib.loads(new) == {"fps": 30, "x": [{"room": 3}]}
    (tmp_path / "recording.toml").write_text('"r\\u006fom" = [[0, 0, 0], [1, 1, 2]]\n')
    with pytest.raises(InputError, match=r"recording\.toml: `room`, `units`, `up` of the old world cannot be taken out"):
        write_new_world(tmp_path, ring)
    assert [file.name for file in tmp_path.iterdir()] == ["recording.toml"]
