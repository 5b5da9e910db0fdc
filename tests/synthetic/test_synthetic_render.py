"""The rendered world: recipes, pictures, and the recordings that are written."""

import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from hmc.cli import main
from hmc.errors import InputError
from hmc.io.recording import iterate_frames, open_recording
from hmc.io.results import read_centroids, read_joints
from hmc.io.shipped import shipped_folder
from hmc.landmarks import LANDMARKS
from hmc.synthetic.image import exposure, light_crowd, make_backdrop, picture, static_shadows
from hmc.synthetic.recipe import load_recipe, recipe_from, shipped_recipes
from hmc.synthetic.render import render_recording
from hmc.synthetic.rigs import RIGS, RigRecipe, make_rig
from hmc.synthetic.room import Room, cast_rays, furnish
from hmc.synthetic.scene import build_scene, crowd_at

TINY = shipped_folder() / "tiny"


def small(**changes):
    content = {
        "name": "small", "seed": 4, "fps": 10, "seconds": 0.4, "background_frames": 2, "silhouette_every": 2, "cell_m": 0.028,
        "rig": {"kind": "corners4", "size_px": [128, 96], "distorted": True},
        "room": {"size_m": [5.0, 4.4, 3.0]},
        "actor": [{"motion": "walk", "height_m": 1.7}],
    }  # fmt: skip
    content.update(changes)
    return content


def project_by_opencv(camera, points):
    uv, _ = cv2.projectPoints(points, cv2.Rodrigues(camera.rotation)[0], camera.translation, camera.matrix, camera.distortions)
    return uv[:, 0]


def files_of(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    out = tmp_path_factory.mktemp("rendered") / "small"
    calls = []
    render_recording(recipe_from(small()), out, workers=1, on_progress=lambda done, total: calls.append((done, total)))
    assert calls == [(k + 1, 6) for k in range(6)]
    return out


def test_two_workers_write_the_same_bytes_as_one(rendered, tmp_path):
    other = render_recording(recipe_from(small()), tmp_path / "again", workers=2)
    first, second = files_of(rendered), files_of(other)
    assert first.keys() == second.keys()
    # Containers may carry a time of writing: videos are compared by what they show.
    for name in first:
        if name.endswith(".mp4"):
            np.testing.assert_array_equal(frames_of(rendered / name), frames_of(other / name))
        else:
            assert first[name] == second[name], name
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def frames_of(path: Path) -> np.ndarray:
    capture, frames = cv2.VideoCapture(str(path)), []
    while True:
        more, image = capture.read()
        if not more:
            return np.array(frames)
        frames.append(image)


def test_another_seed_gives_another_recording(rendered, tmp_path):
    other = render_recording(recipe_from(small(seconds=0.1, background_frames=0)), tmp_path / "other", seed=5, workers=1)
    assert (other / "calibration.toml").read_bytes() != (rendered / "calibration.toml").read_bytes()
    assert not (other / "background").exists()


def test_the_written_recording_opens_and_has_its_truth(rendered):
    recording = open_recording(rendered)
    assert (recording.name, recording.fps, recording.n_frames, recording.persons) == ("small", 10, 4, 1)
    assert recording.subject_height_m == (1.7,)
    np.testing.assert_allclose(recording.room, [[-2.5, -2.2, 0], [2.5, 2.2, 3.0]])
    frames = list(iterate_frames(recording))
    assert len(frames) == 4
    assert all(image.shape == (96, 128, 3) for frame in frames for image in frame.images)
    joints, centroids = read_joints(rendered / "truth" / "joints.csv"), read_centroids(rendered / "truth" / "centroids.csv")
    assert joints.positions.shape == (4, len(LANDMARKS), 3)
    assert np.linalg.norm(joints.positions[:, 0] - centroids.positions, axis=1).max() < 0.2
    assert np.linalg.norm(joints.positions[:, 2] - centroids.heads, axis=1).max() < 0.25


@pytest.mark.parametrize("which", ["small", "tiny"])
def test_true_joints_lie_inside_the_true_silhouettes(rendered, which):
    folder = rendered if which == "small" else TINY
    recording = open_recording(folder)
    joints = read_joints(folder / "truth" / "joints.csv")
    checked = 0
    for row, frame in enumerate(joints.frames):
        for camera in recording.rig:
            path = folder / "truth" / "silhouettes" / camera.name / f"{frame:06d}.png"
            if not path.exists():
                continue
            mask = cv2.dilate((cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) == 255).astype(np.uint8), np.ones((3, 3), np.uint8))
            uv = np.rint(project_by_opencv(camera, joints.positions[row])).astype(int)
            inside = ((uv >= 0) & (uv < camera.size)).all(axis=1)
            assert mask[uv[inside, 1], uv[inside, 0]].all()
            checked += inside.sum()
    assert checked > 100


def test_the_committed_clip_is_small_and_agrees_with_its_recipe():
    recipe = load_recipe("tiny")
    recording = open_recording(TINY)
    assert (recording.n_frames, recording.fps, len(recording.rig)) == (recipe.n_frames, recipe.fps, 7)
    assert sum(path.stat().st_size for path in TINY.rglob("*") if path.is_file()) < 3e6
    rig = build_scene(replace(recipe, cell_m=0.03)).rig
    for camera, other in zip(recording.rig, rig, strict=True):
        np.testing.assert_allclose(camera.projection, other.projection, atol=1e-9)


def test_people_darken_the_floor_and_nothing_that_is_hidden_from_them():
    scene = build_scene(recipe_from(small()))
    camera, furniture = scene.rig[0], static_shadows(scene)
    backdrop = make_backdrop(scene, camera, furniture, np.random.default_rng(0))
    radiance, labels = picture(scene, camera, backdrop, light_crowd(scene, crowd_at(scene, 0), furniture))
    outside = labels.ravel() == 0
    ratio = radiance[outside] / backdrop.radiance[outside]
    person = cv2.dilate(labels, np.ones((3, 3), np.uint8)).ravel()[outside] > 0  # anti-aliased border
    assert ratio[~person].max() <= 1.0 + 1e-5
    darker = (ratio[~person] < 0.9).any(axis=1).mean()
    assert 0.005 < darker < 0.3
    assert 0.01 < (labels > 0).mean() < 0.2


def test_lamps_that_are_dimmed_and_less_exposure_darken_the_action_only(tmp_path):
    def levels(name, **changes):
        folder = render_recording(recipe_from(small(**changes)), tmp_path / name)
        return [frames_of(folder / part / "cam_00.mp4").astype(float) for part in ("background", "videos")]

    empty, action = levels("plain")
    for name, changes in {"dimmed": {"light": {"dimmed": 0.4}}, "exposed": {"image": {"exposure": 0.8}}}.items():
        same, darker = levels(name, **changes)
        assert np.abs(same - empty).mean() < 0.2
        assert darker.mean() < action.mean() - 3


def test_auto_exposure_keeps_the_mean_and_a_glossy_floor_mirrors_people():
    scene = build_scene(recipe_from(small(image={"auto_exposure": 1.0}, room={"size_m": [5.0, 4.4, 3.0], "gloss": 0.5})))
    plain = build_scene(recipe_from(small()))
    furniture, camera = static_shadows(scene), scene.rig[0]
    backdrop = make_backdrop(scene, camera, furniture, np.random.default_rng(0))
    lit = light_crowd(scene, crowd_at(scene, 0), furniture)
    glossy, labels = picture(scene, camera, backdrop, lit)
    matt, _ = picture(plain, camera, backdrop, lit)
    changed = (np.abs(glossy - matt).sum(axis=1) > 1e-4).reshape(labels.shape)
    inside = cv2.erode(labels, np.ones((3, 3), np.uint8)) > 0  # away from the anti-aliased border
    assert changed.any() and not changed[inside].any() and (backdrop.floor.reshape(labels.shape)[changed] >= 0).all()
    # Below the feet, where the mirror image begins.
    assert np.argwhere(changed)[:, 0].max() > np.argwhere(labels > 0)[:, 0].max()
    gain = exposure(glossy, backdrop, scene)
    assert gain != 1 and exposure(glossy, backdrop, plain) == 1
    assert np.isclose(np.minimum(glossy[::7], 1).mean() * gain, np.minimum(backdrop.radiance[::7], 1).mean())


def test_furniture_hides_people():
    def visible(furniture):
        scene = build_scene(recipe_from(small(furniture=furniture, rig={"kind": "corners4", "size_px": [128, 96]})))
        shadows = static_shadows(scene)
        backdrop = make_backdrop(scene, scene.rig[0], shadows, np.random.default_rng(0))
        return (picture(scene, scene.rig[0], backdrop, light_crowd(scene, crowd_at(scene, 0), shadows))[1] > 0).sum()

    free, hidden = visible([]), visible([{"kind": "box", "at_m": [-0.8, -0.7], "size_m": [0.9, 0.9, 1.0], "heading_deg": 45}])
    assert 0 < hidden < 0.8 * free


def test_rays_meet_walls_and_boxes_where_geometry_says():
    box = furnish("box", (1.0, 0.0), size_m=(0.5, 0.5, 1.0))
    room = Room(np.array([[-2.0, -2, 0], [2, 2, 3]]), (("plain", (0.5, 0.5, 0.5)),) * 4, ("plain", (0.5, 0.5, 0.5)), box)
    hits = cast_rays(room, np.array([0.0, 0.0, 0.5]), np.array([[1.0, 0, 0], [-1, 0, 0], [0, 0, -1], [0, 0.6, 0.8]]))
    np.testing.assert_allclose(hits.distance, [0.75, 2, 0.5, 2.5 / 0.8], atol=1e-9)
    np.testing.assert_allclose(hits.normal, [[-1, 0, 0], [1, 0, 0], [0, 0, 1], [0, 0, -1]], atol=1e-12)


@pytest.mark.parametrize("name", RIGS)
def test_rigs_stand_in_the_room_and_see_its_middle(name):
    room = np.array([[-3.0, -2.5, 0], [3, 2.5, 3]])
    rig = make_rig(RigRecipe(name, distorted=True), room, np.random.default_rng(0))
    assert len(rig) == sum(RIGS[name])
    for camera in rig:
        assert np.all((camera.centre > room[0]) & (camera.centre < room[1]))
        uv = project_by_opencv(camera, np.array([[0, 0, 0.9]]))[0]
        assert np.all((uv > 0) & (uv < camera.size))
        assert camera.distortions[0] < 0


@pytest.mark.parametrize("name", shipped_recipes())
def test_shipped_recipes_build(name):
    recipe = load_recipe(name)
    assert recipe.name == name
    scene = build_scene(replace(recipe, cell_m=0.03, seconds=min(recipe.seconds, 5)))
    free = scene.room.corners[1, :2] - 0.29
    for actor, motion in zip(recipe.actors, scene.motions, strict=True):
        near_wall = (np.abs(motion.root[:, :2]) > free).any(axis=1)
        doors = [(np.abs(motion.root[:, 1 - wall // 2] - along) < 0.5) for wall, along in recipe.room.doors]
        assert not near_wall.any() or (actor.motion == "script" and np.any(doors, axis=0)[near_wall].all())
    first, last = crowd_at(scene, 0), crowd_at(scene, scene.recipe.n_frames - 1)
    assert np.isfinite(last.vertices).all()
    assert first.vertices[:, 2].min() > -0.02


def test_the_shipped_recipes_cover_the_motions():
    assert {"demo", "tiny", "jog", "box", "gesture", "throw_catch", "sit", "pick_up", "crossing", "pale", "bvh"} <= set(shipped_recipes())


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"secnods": 3}, "unknown key 'secnods'; did you mean 'seconds'"),
        ({"actor": [{"hieght_m": 1.7}]}, r"\[\[actor\]\] number 1: unknown key 'hieght_m'; did you mean 'height_m'"),
        ({"rig": {"kind": "ring77"}}, "rig kind 'ring77' is unknown; did you mean 'ring7'"),
        ({"actor": [{"motion": "wlak"}]}, "did you mean 'walk'"),
        ({"actor": [{"hands": "paws"}]}, "hands 'paws' is unknown; use one of open, fists"),
        ({"room": {"floor": "lava"}}, "texture 'lava' is unknown; use one of"),
        ({"fps": "fast"}, "'fps' has a value of the wrong kind"),
        ({"actor": [{"start_m": [1, 2, 3]}]}, "'start_m' has a value of the wrong kind"),
        ({"room": {"wall_colors": [[0.1, 0.2]]}}, "'wall_colors' has a value of the wrong kind"),
        ({"furniture": [{"kind": "table"}]}, "'at_m' is missing"),
        ({"actor": [{"height_m": 17}]}, "height_m must lie between"),
        ({"seed": -3}, "seed must lie between 0 and"),
        ({"room": {"size_m": [2147483648, 4, 3]}}, r"each side of the room, size_m, must lie between 1 and 60\.0; got 2147483648"),
        ({"room": {"size_m": [5, float("nan"), 3]}}, "each side of the room, size_m, must lie between"),
        ({"room": {"posters": 10**9}}, "posters must lie between"),
        ({"furniture": [{"kind": "table", "at_m": [0, 0], "size_m": [1, 1e9, 1]}]}, "each side of a piece of furniture, size_m, must lie"),
        ({"rig": {"size_px": [10**6, 480]}}, "each side of the images, size_px, must lie between"),
        ({"actor": [{"loose_m": 1e6}]}, "loose_m must lie between"),
        ({"actor": [{"longer_left": [0.0, 0.5]}]}, r"longer_left \(leg\) must lie between"),
        ({"actor": [{"motion": "bvh"}]}, "go together"),
        ({"actor": [{}] * 6}, "at most 5 actors"),
        ({"rig": 3}, r"\[rig\]: must be a table"),
        ({"actor": 3}, r"each under its own line \[\[actor\]\]"),
        ({"fps": True}, "'fps' has a value of the wrong kind"),
        ({"seed": 1.5}, "'seed' has a value of the wrong kind"),
    ],
)
def test_wrong_recipes_get_one_clear_line(changes, words):
    with pytest.raises(InputError, match=words):
        recipe_from(small(**changes))


def test_walking_into_a_wall_is_refused():
    with pytest.raises(InputError, match=r"actor 1 walks into a wall after 1\.\d s"):
        build_scene(recipe_from(small(seconds=5, actor=[{"motion": "walk"}])))


def test_a_missing_name_and_a_broken_file_are_refused(tmp_path):
    with pytest.raises(InputError, match="'name' is missing"):
        recipe_from({})
    broken = tmp_path / "broken.toml"
    broken.write_text("name = ")
    with pytest.raises(InputError, match="not a TOML file"):
        load_recipe(broken)


def test_the_command_renders_and_explains(tmp_path, capsys):
    text = 'name = "quick"\nfps = 5\nseconds = 0.2\nbackground_frames = 1\ncell_m = 0.03\n[rig]\nkind = "corners4"\nsize_px = [64, 48]\n'
    (tmp_path / "quick.toml").write_text(text)
    assert main(["synth", str(tmp_path / "quick.toml"), "--out", str(tmp_path / "out"), "--quiet", "--workers", "1"]) == 0
    assert open_recording(tmp_path / "out").n_frames == 1
    said = f"{tmp_path / 'out'}: a recording of 4 cameras, 1 frames each, with truth\nnext: hmc check {tmp_path / 'out'}\n"
    assert capsys.readouterr().out == said
    assert main(["synth", "demmo", "--out", str(tmp_path / "none"), "--quiet"]) == 2
    assert "did you mean 'demo'" in capsys.readouterr().err


def test_an_interrupted_render_leaves_nothing_and_foreign_folders_stay(tmp_path):
    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render_recording(recipe_from(small()), tmp_path / "out", workers=1, on_progress=stop)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    with pytest.raises(InputError, match="is no rendered recording"):
        render_recording(recipe_from(small()), tmp_path / "mine", workers=1)
    assert (tmp_path / "mine" / "thesis.txt").exists()


def test_an_empty_room_is_a_recording_too(tmp_path):
    out = render_recording(recipe_from(small(actor=[], seconds=0.2)), tmp_path / "empty", workers=1)
    recording = open_recording(out)
    assert (recording.persons, recording.n_frames) == (0, 2)
    mask = cv2.imread(str(out / "truth" / "silhouettes" / "cam_00" / "000000.png"), cv2.IMREAD_GRAYSCALE)
    assert mask.shape == (96, 128)
    assert not mask.any()


def test_a_rendered_recording_is_replaced(rendered, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(rendered, copy)
    (copy / "truth" / "old.txt").write_text("from before")
    render_recording(recipe_from(small(seconds=0.1, background_frames=0)), copy, workers=1)
    assert open_recording(copy).n_frames == 1
    assert not (copy / "truth" / "old.txt").exists()
