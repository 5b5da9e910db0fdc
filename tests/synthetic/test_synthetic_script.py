"""Scripts: people come through doors, walk where they are told, sit on chairs, hug; furniture that moves; truth only inside the room."""

import cv2
import numpy as np
import pytest

from hmc.errors import InputError
from hmc.io.results import read_centroids, read_joints
from hmc.synthetic.recipe import ActorRecipe, FurnitureRecipe, StepRecipe, load_recipe, recipe_from
from hmc.synthetic.render import render_recording
from hmc.synthetic.room import furnish, paint_boxes
from hmc.synthetic.scene import build_scene, crowd_at
from hmc.synthetic.script import furniture_place, script_motion, smooth_way
from hmc.synthetic.skeleton import BONE_NAMES, make_skeleton

TIMES = np.arange(0, 12, 1 / 15)


@pytest.fixture(scope="module")
def skeleton():
    return make_skeleton(1.75, "man", np.random.default_rng(0))


def play(skeleton, *steps, start=(0.0, 0.0), heading=0.0, furniture=(), times=TIMES):
    actor = ActorRecipe(motion="script", start_m=start, heading_deg=heading, script=steps)
    return script_motion(actor, skeleton, times, np.random.default_rng(3), furniture)


def heading_of(motion):
    forward = motion.orientations[:, BONE_NAMES.index("pelvis"), :, 0]
    return np.degrees(np.arctan2(forward[:, 1], forward[:, 0]))


def test_a_way_keeps_its_ends_and_rounds_its_corners():
    points = np.array([[0, 0], [2, 0], [2, 2]], float)
    way, length = smooth_way(points)
    places, headings = way(np.array([0.0, length / 2, length]))
    assert places[[0, 2]] == pytest.approx(points[[0, 2]], abs=0.01)
    assert headings == pytest.approx([0, np.pi / 4, np.pi / 2], abs=0.02)
    assert 3.4 < length < 4.0 and np.linalg.norm(places[1] - points[1]) > 0.05
    s = np.linspace(-1, length + 1, 400)
    steps = np.linalg.norm(np.diff(way(s)[0], axis=0), axis=1)
    assert steps == pytest.approx(np.full(399, s[1] - s[0]), rel=0.02)  # also before its start and beyond its end


def test_walkers_get_where_they_are_sent_at_the_pace_they_are_told(skeleton):
    motion = play(skeleton, StepRecipe("walk", to_m=((1.5, 0.0), (2.0, 1.5)), speed_m_s=1.0), StepRecipe("stand", seconds=1))
    assert motion.root[-1, :2] == pytest.approx([2.0, 1.5], abs=0.06)
    speed = np.linalg.norm(np.diff(motion.root[:, :2], axis=0), axis=1) * 15
    assert np.median(speed[10:35]) == pytest.approx(1.0, abs=0.05) and speed.max() < 1.3
    assert heading_of(motion)[-1] == pytest.approx(72, abs=12)


def test_who_must_go_back_turns_round_first(skeleton):
    motion = play(skeleton, StepRecipe("walk", to_m=((-2.0, 0.0),)))
    assert np.abs(heading_of(motion)[-1]) > 165
    turning = np.abs(heading_of(motion)) < 150
    assert np.linalg.norm(motion.root[turning, :2], axis=1).max() < 0.4
    still = np.diff(np.unwrap(np.radians(heading_of(motion))))
    assert np.degrees(np.abs(still).max()) * 15 < 300


def test_motion_has_no_jumps_and_keeps_limbs(skeleton):
    steps = (
        StepRecipe("gesture", seconds=1.0), StepRecipe("walk", to_m=((1.0, 0.5),)), StepRecipe("turn", to_deg=-90),
        StepRecipe("hug", seconds=1.5),
        StepRecipe("sit", seconds=4.0), StepRecipe("box", seconds=0.3),
    )  # fmt: skip
    motion = play(skeleton, *steps, times=np.arange(0, 14, 0.02))
    assert np.abs(np.diff(motion.root, axis=0)).max() < 0.06
    assert np.abs(np.diff(motion.orientations, axis=0)).max() < 0.35
    product = motion.orientations @ motion.orientations.swapaxes(-1, -2)
    assert np.abs(product - np.eye(3)).max() < 1e-6


def test_sitting_down_on_a_chair_that_was_moved(skeleton):
    chair = FurnitureRecipe("chair", (1.0, 0.0), 90.0, moves=((0.0, 1.0, 1.0, 0.6),))
    assert furniture_place(chair, 0.0) == pytest.approx([1.0, 0.0]) and furniture_place(chair, 5.0) == pytest.approx([1.0, 0.6])
    assert furniture_place(chair, 0.5) == pytest.approx([1.0, 0.3])
    motion = play(skeleton, StepRecipe("walk", to_m=((0.4, 0.8),)), StepRecipe("sit", chair=1, until_s=30.0), furniture=(chair,))
    seated = motion.root[-30:]
    assert np.ptp(seated, axis=0).max() < 0.03
    assert seated[-1, 2] == pytest.approx(0.45 + 0.105, abs=0.05)
    assert seated[-1, :2] == pytest.approx([1.0, 0.6], abs=0.12) and heading_of(motion)[-1] == pytest.approx(90, abs=5)


def test_waiting_for_what_is_over_is_told(skeleton):
    with pytest.raises(InputError, match=r"step 2 waits until 0\.5 s"):
        play(skeleton, StepRecipe("walk", to_m=((2.0, 0.0),)), StepRecipe("stand", until_s=0.5))


def small(**changes):
    content = {
        "name": "small", "seed": 4, "fps": 5, "seconds": 2.0, "background_frames": 2, "silhouette_every": 5, "cell_m": 0.028,
        "rig": {"kind": "corners4_overhead", "size_px": [128, 96]},
        "room": {"size_m": [4.0, 3.6, 2.8], "doors": [[1, 0.0]]},
        "furniture": [{"kind": "box", "at_m": [-1.2, 0.8], "moves": [[0.4, 1.2, -1.2, -0.8]]}],
        "actor": [
            {
                "motion": "script", "start_m": [2.6, 0.0], "heading_deg": 180,
                "script": [{"do": "walk", "to_m": [[0.4, 0.0]], "speed_m_s": 1.6}],
            },
            *({"motion": "stand", "start_m": [x, 1.2]} for x in (-0.6, 0.0, 0.6)),
        ],
    }  # fmt: skip
    return content | changes


def test_truth_begins_where_somebody_is_in_the_room(tmp_path):
    out = render_recording(recipe_from(small()), tmp_path / "small")
    centroids, joints = read_centroids(out / "truth" / "centroids.csv"), read_joints(out / "truth" / "joints.csv")
    assert (centroids.frames == joints.frames).all() and (centroids.persons == joints.persons).all()
    frames = centroids.frames[centroids.persons == 0]
    assert 2 <= frames[0] <= 5 and (np.diff(frames) == 1).all() and frames[-1] == 9
    assert centroids.positions[centroids.persons == 0, 0].max() < 2.0
    assert (np.bincount(centroids.persons)[1:] == 10).all()
    late = cv2.imread(str(out / "truth" / "silhouettes" / "cam_04" / "000005.png"), cv2.IMREAD_UNCHANGED)
    assert set(np.unique(late)) <= {0, 51, 102, 153, 204} and 204 in late
    # Nobody is seen before the first one has come in, and the box is where the empty room was filmed.
    empty = cv2.VideoCapture(str(out / "background" / "cam_00.mp4")).read()[1].astype(int)
    assert empty.std() > 5


def test_furniture_moves_in_the_pictures_and_is_nobody():
    scene = build_scene(recipe_from(small()))
    places = [crowd_at(scene, frame) for frame in (-1, 0, 9)]
    boxes = [crowd.vertices[crowd.persons == -1].mean(axis=0) for crowd in places]
    assert boxes[0] == pytest.approx(boxes[1]) and boxes[0][:2] == pytest.approx([-1.2, 0.8], abs=0.02)
    assert boxes[2][:2] == pytest.approx([-1.2, -0.8], abs=0.02)
    assert set(np.unique(places[0].persons)) == {-1} and not scene.room.boxes
    vertices, normals, albedo, triangles = paint_boxes(furnish("box", (0, 0)), 0.05, 1)
    corners = vertices[triangles]
    outward = np.einsum("ij,ij->i", normals[triangles[:, 0]], corners.mean(axis=1) - vertices.mean(axis=0))
    assert (outward > 0).all() and ((albedo >= 0) & (albedo <= 1)).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"room": {"size_m": [4.0, 3.6, 2.8], "doors": [[1, 1.4]]}}, "through a door"),
        ({"room": {"doors": [[4, 0.0]]}}, "wall of a door"),
        ({"actor": [{"motion": "script"}]}, "go together"),
        ({"actor": [{"script": [{"do": "turn"}]}]}, "go together"),
        ({"actor": [{"motion": "script", "script": [{"do": "wlak"}]}]}, "did you mean 'walk'"),
        ({"actor": [{"motion": "script", "script": [{"do": "walk"}]}]}, "needs 'to_m'"),
        ({"actor": [{"motion": "script", "script": [{"do": "sit", "chair": 1}]}]}, "needs 'seconds' or 'until_s'"),
        ({"actor": [{"motion": "script", "script": [{"do": "sit", "chair": 2, "seconds": 1}]}]}, "chair"),
        (
            {"actor": [{"motion": "script", "script": [{"do": "sit", "secnds": 1}]}]},
            "step 1 of the script: unknown key 'secnds'; did you mean",
        ),
    ],
)
def test_wrong_scripts_are_told(changes, words):
    with pytest.raises(InputError, match=words):
        build_scene(recipe_from(small(**changes)))


def test_the_meeting_has_five_people_at_once_who_never_walk_through_each_other():
    from dataclasses import replace

    scene = build_scene(replace(load_recipe("meeting"), cell_m=0.03))
    inside = np.array([scene.in_room(k) for k in range(5)])
    assert inside.sum(axis=0).max() == 5 and not inside[:, 0].any() and inside.sum(axis=0)[-1] < 5
    roots = np.array([motion.root for motion in scene.motions])
    for a in range(5):
        for b in range(a):
            apart = np.linalg.norm(roots[a, :, :2] - roots[b, :, :2], axis=1)[inside[a] & inside[b]]
            assert apart.min() > 0.3
    assert len(scene.props) == 2
