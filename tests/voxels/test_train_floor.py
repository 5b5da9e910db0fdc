"""What the floor says of shades, fitted: numbers known beforehand are found again, and bad input is told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sklearn.metrics import log_loss

from hmc.io.recording import open_recording
from hmc.synthetic.recipe import load_recipe
from hmc.synthetic.render import render_recording
from hmc.voxels.floor_light import LIGHT, FloorEvidence, person_by_floor
from hmc.voxels.train_floor import FloorExamples, fit_floor, floor_examples, floor_loss, main

TINY = Path(__file__).parents[2] / "data" / "synthetic" / "tiny"


def drawn(rng, spread, unlike, n=20000):
    """Shades as the model has them: a guess that is right as often as it says, and others who see the spot as it is or anything."""
    guess, light = rng.normal(0, 1.5, n), rng.uniform(-0.6, -0.2, n)
    is_person = rng.random(n) < 1 / (1 + np.exp(-guess))
    told = spread * np.sqrt(2 * np.pi)
    as_it_is = rng.random(n) < told / (told + unlike * (LIGHT[1] - LIGHT[0]))
    others = np.where(as_it_is, np.where(is_person, 0, light) + rng.normal(0, spread, n), rng.uniform(*LIGHT, n))
    guess, light, others = (column.astype(np.float32) for column in (guess, light, others))
    return FloorExamples(FloorEvidence(np.arange(n), guess, light, others), is_person)


@pytest.mark.parametrize("numbers", [(0.04, 0.02), (0.1, 0.15)])
def test_known_numbers_are_found_again(numbers):
    rng = np.random.default_rng(0)
    assert fit_floor([drawn(rng, *numbers), drawn(rng, *numbers)]) == pytest.approx(numbers, rel=0.15)


def test_the_loss_is_the_mean_of_the_recordings():
    rng = np.random.default_rng(1)
    one, other = drawn(rng, 0.05, 0.05, 300), drawn(rng, 0.2, 0.3, 3000)
    expected = [log_loss(some.is_person, person_by_floor(some.evidence).astype(float)) for some in (one, other)]
    assert floor_loss([one, other]) == pytest.approx(np.mean(expected), rel=1e-4)


@pytest.mark.slow
def test_a_rendered_room_is_learnt_from(tmp_path, caplog):
    recipe = replace(load_recipe("varied-1000"), fps=2.0, seconds=1.0, silhouette_every=1)
    room = render_recording(recipe, tmp_path / "room")
    examples = floor_examples(open_recording(room), np.random.default_rng(0))
    assert len(examples.is_person) > 1000 and 0 < examples.is_person.mean() < 1
    untold = replace(examples, evidence=replace(examples.evidence, others=np.zeros_like(examples.evidence.others)))
    assert floor_loss([examples]) < floor_loss([untold])  # it is of use
    with caplog.at_level("INFO"):
        assert main([str(room), str(room)]) == 0
    assert "fitted to all: spread" in caplog.text


@pytest.mark.parametrize("missing", ["truth", "recording", "shades"])
def test_what_cannot_be_learnt_from_is_told(tmp_path, recording_folder, missing, caplog, monkeypatch):
    monkeypatch.setattr("hmc.camera.segmentation.MOST_ZOOM", 1)  # of images as small as tiny's the network then knows nothing
    folder = {"truth": recording_folder, "recording": tmp_path / "nothing", "shades": TINY}[missing]
    assert main([str(folder)]) == 2
    assert "error:" in caplog.text and str(folder) in caplog.text
