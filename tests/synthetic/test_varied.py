"""Recipes drawn at random: whole, reproducible, unlike one another, and as the command names them."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from hmc.cli import main
from hmc.errors import InputError
from hmc.io.results import PoseTable
from hmc.landmarks import LANDMARKS
from hmc.synthetic.recipe import load_recipe
from hmc.synthetic.scene import build_scene
from hmc.synthetic.truth import through_one_another


def test_every_seed_gives_a_whole_recipe_of_its_own():
    recipes = [load_recipe(f"varied-{seed}") for seed in range(150)]
    assert len({(recipe.room, recipe.actors) for recipe in recipes}) == len(recipes)
    for recipe in recipes:
        places = np.array([actor.start_m for actor in recipe.actors])
        assert 1 <= len(places) <= 3 and (np.abs(places) < np.array(recipe.room.size_m[:2]) / 2).all()
    assert len({recipe.rig.kind for recipe in recipes}) == 5
    assert 0.2 < np.mean([bool(recipe.furniture) for recipe in recipes]) < 0.6


def test_a_seed_always_gives_the_same():
    assert load_recipe("varied-7") == load_recipe("varied-7")


def test_half_of_all_garments_have_a_color_of_the_room():
    like = []
    for seed in range(100):
        recipe = load_recipe(f"varied-{seed}")
        room = np.array([recipe.room.floor_color, *recipe.room.wall_colors])
        for actor in recipe.actors:
            gains = np.linspace(0.4, 1.3, 50)[:, None, None]
            like.append(np.abs(gains * room - np.array(actor.trousers)).max(axis=-1).min() < 0.06)
    assert 0.45 < np.mean(like) < 0.75  # others may be like it by chance


@pytest.mark.parametrize("name", ["varied-", "varied--1", "varied-1.5", "varied-1234567890", "varied"])
def test_what_has_no_seed_is_no_recipe(name):
    with pytest.raises(InputError, match="neither a file nor a shipped recipe"):
        load_recipe(name)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [11, 29, 30])  # who walks or jogs does not walk into a wall
def test_people_have_room_to_move(seed):
    recipe = replace(load_recipe(f"varied-{seed}"), cell_m=0.03, fps=5)
    assert any(actor.motion in ("walk", "jog") for actor in recipe.actors)
    assert len(build_scene(recipe).actors) == len(recipe.actors)


@pytest.mark.slow
def test_it_is_rendered_as_the_command_asks(tmp_path):
    out = tmp_path / "room"
    assert main(["synth", "tiny", "--fps", "2", "--silhouette-every", "1", "--out", str(out), "--quiet", "--workers", "1"]) == 0
    recipe = load_recipe("tiny")
    masks = sorted((out / "truth" / "silhouettes" / "cam_00").glob("*.png"))
    assert len(masks) == round(2 * recipe.seconds)
    assert cv2.imread(str(masks[0]), cv2.IMREAD_GRAYSCALE).any()


def test_rates_that_no_recipe_may_have_are_refused(tmp_path, capsys):
    assert main(["synth", "tiny", "--fps", "0.1", "--out", str(tmp_path / "room")]) == 2
    assert "fps must lie between 1 and 240" in capsys.readouterr().err


def test_people_who_pass_through_each_other_are_told():
    """Nobody keeps a recipe from it; what comes of such frames says nothing of a method."""
    frames, along = np.arange(9), np.linspace(-1, 1, 9)
    positions = np.zeros((2, 9, len(LANDMARKS), 3))
    positions[0, :, :, 0], positions[1, :, :, 0] = along[:, None], -along[:, None]
    positions[1, :, :, 1] = 0.15
    table = PoseTable(np.tile(frames, 2), np.repeat([0, 3], 9), positions.reshape(18, -1, 3))
    (line,) = through_one_another(table)
    assert line.startswith("persons 0 and 3 are in one another in 1 frame (15 cm from pelvis to pelvis in frame 4)")
    positions[1, :, :, 1] = 0.25
    assert not through_one_another(PoseTable(table.frames, table.persons, positions.reshape(18, -1, 3)))
    alone = np.tile(frames, 2)[:9]
    assert not through_one_another(PoseTable(np.r_[alone, alone + 9], table.persons, 0 * table.positions))
