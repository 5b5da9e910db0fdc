"""The rendered world: surfaces, skeletons, motions, motion files and the rasteriser."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hmc.errors import InputError
from hmc.io.shipped import shipped_folder
from hmc.landmarks import landmark_index
from hmc.synthetic import actions, everyday, gait, ground
from hmc.synthetic.actor import PARTS, make_actor, pose_mesh
from hmc.synthetic.bvh import bvh_motion, bvh_positions, read_bvh
from hmc.synthetic.feet import true_foot_points
from hmc.synthetic.motions import angles, place
from hmc.synthetic.rasterise import rasterise
from hmc.synthetic.skeleton import BONE_NAMES, PARENTS, joint_positions, landmark_positions, make_skeleton, reach
from hmc.synthetic.surface import Sweep, mesh_of, volume_centroid

MOTIONS = {
    "walk": gait.walk, "jog": gait.jog, "stand": actions.stand, "box": actions.box, "gesture": actions.gesture,
    "throw_catch": actions.throw_catch, "sit": actions.sit, "pick_up": actions.pick_up,
}  # fmt: skip
TIMES = np.arange(0, 4, 1 / 25)


@pytest.fixture(scope="module")
def actor():
    return make_actor(1.72, "average", np.random.default_rng(3), "man", cell_m=0.025)


def edges_of(triangles):
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def is_closed(triangles):
    """Every edge is walked as often in one direction as in the other."""
    edges = Counter(tuple(edge) for edge in edges_of(triangles))
    return all(edges[b, a] == times for (a, b), times in edges.items())


def test_mesh_of_an_ellipsoid_has_its_volume_and_centroid():
    s = np.cos(np.linspace(np.pi, 0, 60))
    ring = np.sqrt(np.maximum(1 - s**2, 1e-6))
    stations = np.column_stack([0.3 * s, 0.2 * ring, 0.1 * ring, np.zeros((60, 2))])
    mesh = mesh_of([Sweep(0, np.array([1.0, 2.0, 3.0]), np.eye(3), stations)], 0.012)
    volume, centroid = volume_centroid(mesh.vertices, mesh.triangles)
    assert volume == pytest.approx(4 / 3 * np.pi * 0.3 * 0.2 * 0.1, rel=0.02)
    np.testing.assert_allclose(centroid, [1, 2, 3], atol=1e-3)
    assert is_closed(mesh.triangles)


def test_rasteriser_equals_a_loop_over_pixels_and_triangles():
    rng = np.random.default_rng(0)
    width, height = 23, 17
    points = rng.uniform(-4, 26, (60, 2))
    depth = rng.uniform(1, 5, 60)
    triangles = rng.integers(0, 60, (40, 3))
    got = rasterise(points, depth, triangles, (width, height), cull=False)
    expected = {}
    for v in range(height):
        for u in range(width):
            for t, (i, j, k) in enumerate(triangles):
                matrix = np.array([[*points[i], 1], [*points[j], 1], [*points[k], 1]]).T
                if abs(np.linalg.det(matrix)) < 1e-9:
                    continue
                weights = np.linalg.solve(matrix, [u, v, 1])
                if weights.min() >= 0:
                    z = 1 / (weights / depth[[i, j, k]]).sum()
                    if z < expected.get(v * width + u, (np.inf, 0, 0))[0]:
                        expected[v * width + u] = (z, t, weights / depth[[i, j, k]] * z)
    assert list(got.pixels) == sorted(expected)
    for pixel, triangle, weights, z in zip(got.pixels, got.triangles, got.weights, got.depth, strict=True):
        assert triangle == expected[pixel][1]
        np.testing.assert_allclose(z, expected[pixel][0], rtol=1e-9)
        np.testing.assert_allclose(weights, expected[pixel][2], atol=1e-9)


def test_rasteriser_culls_what_is_seen_from_behind():
    points = np.array([[0.0, 0], [10, 0], [0, 10]])
    one, other = np.array([[0, 1, 2]]), np.array([[0, 2, 1]])
    sizes = [rasterise(points, np.ones(3), triangles, (12, 12)).pixels.size for triangles in (one, other)]
    assert sorted(sizes) == [0, 66]


@pytest.mark.parametrize(
    ("height", "build", "sex"), [(1.55, "thin", "woman"), (1.75, "average", "man"), (1.95, "heavy", "man"), (1.65, 0.4, "woman")]
)
def test_an_actor_is_a_closed_body_of_human_size(height, build, sex):
    actor = make_actor(height, build, np.random.default_rng(1), sex, cell_m=0.022)
    assert is_closed(actor.triangles)
    assert actor.vertices[:, 2].min() == pytest.approx(0, abs=0.01)
    assert actor.vertices[:, 2].max() == pytest.approx(height, abs=0.015)
    volume, _ = volume_centroid(actor.vertices, actor.triangles)
    assert 0.03 < volume / (height / 1.75) ** 3 < 0.12
    np.testing.assert_allclose(actor.weights.sum(axis=1), 1)
    assert set(np.unique(actor.parts)) == set(range(len(PARTS)))
    left = actor.parts == list(PARTS).index("l_arm")
    assert actor.vertices[left, 1].min() > 0


def test_builds_differ_in_volume_and_seeds_in_proportions():
    volumes = [
        volume_centroid(a.vertices, a.triangles)[0]
        for a in (make_actor(1.7, b, np.random.default_rng(0), cell_m=0.025) for b in (-1, 0, 1))
    ]
    assert volumes[0] < 0.85 * volumes[1] < 0.7 * volumes[2]
    arms = [make_skeleton(1.7, "man", np.random.default_rng(seed)).length("l_forearm") for seed in range(20)]
    assert 0.005 < np.std(arms) / 1.7 / 0.162 < 0.05


def test_fists_are_shorter_than_open_hands_and_nothing_else_changes():
    def reach_and_rest(fists: bool):
        one = make_actor(1.75, "average", np.random.default_rng(0), cell_m=0.02, fists=fists)
        assert is_closed(one.triangles)
        wrist, elbow = (one.bind_joints[BONE_NAMES.index(f"l_{bone}")] for bone in ("hand", "forearm"))
        outwards = (wrist - elbow) / np.linalg.norm(wrist - elbow)
        left = one.vertices[one.parts == list(PARTS).index("l_arm")]
        return float(((left - wrist) @ outwards).max()) / 1.75, one.vertices[one.parts == list(PARTS).index("l_leg")]

    (open_hand, leg), (fist, same_leg) = reach_and_rest(False), reach_and_rest(True)
    assert 0.09 < open_hand < 0.115
    assert 0.05 < fist < 0.065
    np.testing.assert_allclose(leg.max(axis=0), same_leg.max(axis=0), atol=0.015)  # the same but for the mesh's cells


@pytest.mark.parametrize(("height", "build"), [(0.4, "average"), (1.7, "enormous"), (1.7, 3.0)])
def test_impossible_bodies_are_refused(height, build):
    with pytest.raises(InputError, match=r"height_m|build"):
        make_actor(height, build, np.random.default_rng(0))


def test_a_rigid_motion_of_the_bones_moves_the_skin_rigidly(actor):
    turn = Rotation.from_euler("zyx", [0.7, -0.2, 0.4]).as_matrix()
    vertices, normals = pose_mesh(actor, turn @ actor.bind_joints[0] + [1, 2, 3], turn @ actor.bind_frames)
    np.testing.assert_allclose(vertices, actor.vertices @ turn.T + [1, 2, 3], atol=1e-9)
    np.testing.assert_allclose(normals, actor.normals @ turn.T, atol=1e-9)


@given(st.tuples(*[st.floats(-1, 1)] * 3), st.tuples(*[st.floats(-1, 1)] * 3), st.floats(0.1, 0.5), st.floats(0.1, 0.5))
def test_reach_arrives_where_it_can(start, target, first, second):
    start, target = np.array([start]), np.array([target])
    a, b = reach(start, target, first, second, np.array([0.3, 0.5, -0.8]))
    np.testing.assert_allclose(np.linalg.norm(np.concatenate([a, b]), axis=1), 1, atol=1e-6)
    distance = np.linalg.norm(target - start)
    end = start + first * a + second * b
    if abs(first - second) + 0.01 < distance < 0.99 * (first + second):
        np.testing.assert_allclose(end, target, atol=1e-6)
    elif distance > first + second:
        assert np.linalg.norm(end - start) > 0.99 * (first + second)


@pytest.mark.parametrize("name", MOTIONS)
def test_motions_keep_bones_rigid_and_feet_on_the_floor(name, actor):
    motion = MOTIONS[name](actor.skeleton, TIMES, np.random.default_rng(5))
    again = MOTIONS[name](actor.skeleton, TIMES, np.random.default_rng(5))
    np.testing.assert_array_equal(motion.orientations, again.orientations)
    frames = motion.orientations
    np.testing.assert_allclose(frames @ frames.transpose(0, 1, 3, 2), np.broadcast_to(np.eye(3), frames.shape), atol=1e-9)
    assert np.linalg.det(frames).min() > 0.99
    marks = landmark_positions(actor.skeleton, motion.root, frames)
    for a, b in (("l_shoulder", "l_elbow"), ("r_elbow", "r_wrist"), ("l_hip", "r_hip"), ("l_hip", "l_knee"), ("r_knee", "r_ankle")):
        length = np.linalg.norm(marks[:, landmark_index(a)] - marks[:, landmark_index(b)], axis=1)
        assert np.ptp(length) < 1e-9
    # Bones move smoothly: no joint jumps from frame to frame (12 m/s is a fast punch).
    assert np.linalg.norm(np.diff(marks, axis=0), axis=2).max() * 25 < 12
    lowest = []
    for frame in range(0, len(TIMES), 6):
        lowest.append(pose_mesh(actor, motion.root[frame], frames[frame])[0][:, 2].min())
    assert min(lowest) > -0.015
    if name != "jog":
        assert max(lowest) < 0.015
    # Knees and elbows bend one way only.
    local = angles(motion)
    for bone, axis, sign in (("l_shank", 1, 1), ("r_shank", 1, 1), ("l_forearm", 2, -1), ("r_forearm", 2, 1)):
        assert (sign * local[:, BONE_NAMES.index(bone), axis]).min() > -0.05


def test_angles_rebuild_the_motion(actor):
    motion = gait.walk(actor.skeleton, TIMES, np.random.default_rng(0))
    local = Rotation.from_rotvec(angles(motion).reshape(-1, 3)).as_matrix().reshape(motion.orientations.shape)
    world = local.copy()
    for bone, parent in enumerate(PARENTS[1:], start=1):
        world[:, bone] = world[:, parent] @ local[:, bone]
    np.testing.assert_allclose(world, motion.orientations, atol=1e-9)


@pytest.mark.parametrize(("radius", "longer_left"), [(0.0, 0.0), (1.5, 0.0), (-1.2, 0.0), (1.5, 0.05), (-1.2, -0.05)])
def test_planted_feet_do_not_slide_and_the_walker_gets_ahead(radius, longer_left):
    skeleton = make_skeleton(1.72, "man", np.random.default_rng(3), (-longer_left, longer_left))
    motion = gait.walk(skeleton, TIMES, np.random.default_rng(0), 1.2, radius)
    marks = landmark_positions(skeleton, motion.root, motion.orientations)
    for bones, share in ((("hip", "knee", "ankle"), longer_left), (("shoulder", "elbow", "wrist"), -longer_left)):
        at = np.array([[marks[0, landmark_index(f"{side}_{bone}")] for bone in bones] for side in "lr"])
        left, right = np.linalg.norm(np.diff(at, axis=1), axis=2)
        np.testing.assert_allclose(left - right, share * (left + right) / 2, atol=1e-9)
    speed = np.linalg.norm(np.diff(motion.root[:, :2], axis=0), axis=1).sum() / TIMES[-1]
    assert speed == pytest.approx(1.2, rel=0.05)
    flat = np.array([motion.orientations[:, BONE_NAMES.index(f"{side}_foot"), 2, 0] for side in "lr"]).T  # sine of the foot's pitch
    for s, side in enumerate("lr"):
        ankle = marks[:, landmark_index(f"{side}_ankle")]
        down = (np.abs(flat[:, s]) < 0.01) & (ankle[:, 2] < skeleton.ankle_height + 0.01)
        planted = down[1:] & down[:-1]
        assert planted.mean() > 0.15
        assert np.linalg.norm(np.diff(ankle, axis=0), axis=1)[planted].max() < 0.005


def test_place_puts_a_motion_where_it_is_wanted(actor):
    motion = place(gait.walk(actor.skeleton, TIMES, np.random.default_rng(0)), [1.0, -2.0], 90)
    np.testing.assert_allclose(motion.root[0, :2], [1, -2], atol=0.03)
    ahead = motion.root[-1] - motion.root[0]
    assert ahead[1] > 4
    assert abs(ahead[0]) < 0.1


def test_throwing_and_sitting_do_what_they_say(actor):
    seated = actions.sit(actor.skeleton, TIMES, np.random.default_rng(0))
    assert seated.root[:, 2].min() == pytest.approx(0.45 + 0.105 * 1.72 / 1.75, abs=0.01)
    lifted = landmark_positions(
        actor.skeleton, *(lambda m: (m.root, m.orientations))(actions.pick_up(actor.skeleton, TIMES, np.random.default_rng(0)))
    )
    assert lifted[:, landmark_index("r_wrist"), 2].min() < 0.3


def test_who_jumps_falls_as_bodies_do_and_stands_again(actor):
    times = np.arange(0, 2, 0.01)
    motion = everyday.jump(actor.skeleton, times, np.random.default_rng(0))
    marks = landmark_positions(actor.skeleton, motion.root, motion.orientations)
    ankles = marks[:, [landmark_index("l_ankle"), landmark_index("r_ankle")], 2]
    assert ankles.min() == pytest.approx(actor.skeleton.ankle_height, abs=0.01)
    aloft = np.flatnonzero((ankles > actor.skeleton.ankle_height + 0.1).all(axis=1))
    assert np.all(np.diff(aloft) == 1)
    assert ankles.max() - actor.skeleton.ankle_height == pytest.approx(9.81 * 0.55**2 / 8, abs=0.01)
    falling = np.diff(ankles[aloft].mean(axis=1), n=2) / 0.01**2
    assert np.median(falling) == pytest.approx(-9.81, rel=0.1)


def test_hands_that_are_laid_behind_the_back_lie_there(actor):
    motion = everyday.behind_back(actor.skeleton, np.arange(0, 3, 0.04), np.random.default_rng(0))
    marks = landmark_positions(actor.skeleton, motion.root, motion.orientations)
    wrists = marks[:, [landmark_index("l_wrist"), landmark_index("r_wrist")]]
    behind = wrists[:, :, 0].max(axis=1) < marks[:, landmark_index("pelvis"), 0] - 0.1  # the person faces X
    together = np.linalg.norm(wrists[:, 0] - wrists[:, 1], axis=1) < 0.15
    assert (behind & together).sum() * 0.04 > 0.8


def test_who_does_push_ups_is_level_and_keeps_hands_and_toes_in_their_place(actor):
    motion = ground.push_ups(actor.skeleton, np.arange(0, 5, 0.04), np.random.default_rng(0))
    marks = landmark_positions(actor.skeleton, motion.root, motion.orientations)[50:]  # two seconds after the beginning
    for name in ("l_wrist", "r_wrist", "l_ankle", "r_ankle"):
        place = marks[:, landmark_index(name)]
        assert np.ptp(place, axis=0).max() < 0.16 and 0.05 < place[:, 2].min() and place[:, 2].max() < 0.18, name
    trunk = marks[:, landmark_index("neck")] - marks[:, landmark_index("pelvis")]
    assert np.all(trunk[:, 2] < 0.4 * np.linalg.norm(trunk, axis=1))
    assert np.ptp(marks[:, landmark_index("neck"), 2]) > 0.25


def test_who_lunges_keeps_the_back_heel_up_and_the_front_foot_flat(actor):
    motion = actions.lunge(actor.skeleton, TIMES, np.random.default_rng(0))
    feet = true_foot_points(actor, motion.root, motion.orientations).reshape(len(TIMES), 2, 2, 3)
    assert np.ptp(feet, axis=0).max() < 1e-6  # both stay where they are
    assert np.abs(feet[:, 0, :, 2]).max() < 0.02 and feet[:, 1, 0, 2].min() > 0.15 and np.abs(feet[:, 1, 1, 2]).max() < 0.03
    knees = landmark_positions(actor.skeleton, motion.root, motion.orientations)[:, landmark_index("r_knee"), 2]
    assert knees.max() > 0.35 and 0.08 < knees.min() < 0.25


@pytest.mark.parametrize("name", ["sit_ups", "lie"])
def test_who_lies_down_is_on_the_back_and_above_the_floor(actor, name):
    motion = getattr(ground, name)(actor.skeleton, np.arange(0, 7, 0.04), np.random.default_rng(0))
    marks = landmark_positions(actor.skeleton, motion.root, motion.orientations)
    assert marks[..., 2].min() > 0.03
    lies = marks[:, landmark_index("neck"), 2] < 0.25
    assert lies.mean() > (0.2 if name == "sit_ups" else 0.99)
    facing = motion.orientations[lies, BONE_NAMES.index("chest"), :, 0]
    assert np.all(facing[:, 2] > 0.9)


BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Chest
  {
    OFFSET 0 10 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 5 0
    }
  }
  JOINT LeftUpLeg
  {
    OFFSET 3 -1 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT LeftLeg
    {
      OFFSET 0 -8 0
      CHANNELS 3 Yrotation Zrotation Xrotation
      End Site
      {
        OFFSET 0 -8 0
      }
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.04
1 2 3 0 0 0 0 0 0 0 0 0 0 0 0
1 2 3 90 0 0 0 0 0 0 90 0 0 0 0
"""


def test_bvh_positions_of_a_small_file_by_hand(tmp_path):
    path = tmp_path / "small.bvh"
    path.write_text(BVH)
    motion = read_bvh(path)
    assert motion.names == ("Hips", "Chest", "LeftUpLeg", "LeftLeg")
    assert motion.parents == (-1, 0, 0, 2)
    assert motion.frame_time_s == 0.04
    positions, rotations = bvh_positions(motion)
    np.testing.assert_allclose(positions[0], [[1, 2, 3], [1, 12, 3], [4, 1, 3], [4, -7, 3]], atol=1e-12)
    # Turned 90 degrees about z, x becomes y and y becomes -x; the thigh turns 90 degrees about its own x besides: -y becomes -z.
    np.testing.assert_allclose(positions[1], [[1, 2, 3], [-9, 2, 3], [2, 5, 3], [2, 5, -5]], atol=1e-12)
    np.testing.assert_allclose(rotations[1, 3], (Rotation.from_euler("ZX", [90, 90], degrees=True)).as_matrix(), atol=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("hello", "HIERARCHY"),
        (BVH.replace("Frames: 2", "Frames: 9"), "9 frames of 15 numbers"),
        (BVH.replace("OFFSET 0 10 0", "OFFSET 0 ten 0"), "ten"),
        (BVH.replace("Frame Time: 0.04", ""), "frame time"),
    ],
)
def test_broken_bvh_files_are_refused(tmp_path, text, words):
    path = tmp_path / "broken.bvh"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        read_bvh(path)
    with pytest.raises(InputError, match="no such motion file"):
        read_bvh(tmp_path / "missing.bvh")


def test_a_skeleton_without_known_names_is_refused(tmp_path, actor):
    path = tmp_path / "small.bvh"
    path.write_text(BVH)
    with pytest.raises(InputError, match="could be the l_ankle"):
        bvh_motion(read_bvh(path), actor.skeleton, TIMES)


def test_a_bvh_file_plays_on_an_actor_in_any_unit_and_naming(tmp_path, actor):
    source = shipped_folder() / "wave.bvh"
    motion = read_bvh(source)
    played = bvh_motion(motion, actor.skeleton, TIMES[:75])
    file_positions, _ = bvh_positions(motion)
    wrist, elbow = (file_positions[:75, motion.names.index(n)] for n in ("RightHand", "RightForeArm"))
    marks = landmark_positions(actor.skeleton, played.root, played.orientations)
    ours = marks[:, landmark_index("r_wrist")] - marks[:, landmark_index("r_elbow")]
    theirs = (wrist - elbow)[:, [2, 0, 1]]
    # Directions agree up to the heading, which is turned to X in the first frame.
    np.testing.assert_allclose(ours[:, 2] / np.linalg.norm(ours, axis=1), theirs[:, 2] / np.linalg.norm(theirs, axis=1), atol=1e-6)
    feet = joint_positions(actor.skeleton, played.root, played.orientations)[:, BONE_NAMES.index("l_foot"), 2]
    np.testing.assert_allclose(feet, actor.skeleton.ankle_height, atol=0.02)
    values = motion.values.copy()
    values[:, :3] *= 0.01
    metres = replace(motion, offsets=motion.offsets * 0.01, values=values, names=tuple("mixamorig:" + name for name in motion.names))
    np.testing.assert_allclose(bvh_motion(metres, actor.skeleton, TIMES[:75]).root, played.root, atol=1e-6)


@pytest.mark.parametrize("name", ["12_01", "avatar_006_05"])
def test_captured_bvh_files_play(shared_data, actor, name):
    played = bvh_motion(read_bvh(shared_data / "cmu" / "bvh" / f"{name}.bvh"), actor.skeleton, TIMES[:50], start_s=0.5)
    marks = landmark_positions(actor.skeleton, played.root, played.orientations)
    assert np.abs(marks[:, landmark_index("head_top"), 2] - 1.70).max() < 0.12
    assert marks[:, [landmark_index("l_ankle"), landmark_index("r_ankle")], 2].min() > 0.02


@pytest.mark.parametrize(("name", "flat"), [("12_01", 5), ("avatar_002_05", 5), ("avatar_005_09", 8)])
def test_feet_of_captured_files_stand_flat_and_are_turned_as_ankles_go(shared_data, actor, name, flat):
    motion = read_bvh(shared_data / "cmu" / "bvh" / f"{name}.bvh")
    played = bvh_motion(motion, actor.skeleton, np.arange(0, len(motion.values), 4) * motion.frame_time_s)
    lowered, tilts = [], []
    for side in "lr":
        shank, foot = (played.orientations[:, BONE_NAMES.index(f"{side}_{bone}")] for bone in ("shank", "foot"))
        ahead = foot[:, :, 0]
        lowered.append(np.degrees(np.arctan2(np.sum(-shank[:, :, 2] * ahead, axis=1), np.sum(shank[:, :, 0] * ahead, axis=1))))
        tilts.append(np.degrees(np.arcsin(ahead[:, 2])))
    assert np.min(lowered) > -30.01 and np.max(lowered) < 70.01  # the dancer's file has feet that are bent by 61 degrees towards the shin
    assert abs(np.median(tilts)) < flat
