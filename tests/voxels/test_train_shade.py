"""The training of the network of shades, as a command."""

from pathlib import Path

import numpy as np
import pytest

from hmc.camera.shade import FEATURES, read_net
from hmc.io.recording import open_recording
from hmc.voxels.train_shade import main, shade_examples

TINY = Path(__file__).parents[2] / "data" / "synthetic" / "tiny"


@pytest.mark.slow
def test_a_network_is_trained_on_rendered_people(tmp_path):
    out = tmp_path / "net.csv"
    assert main([str(TINY), "--out", str(out), "--frames", "6", "--most", "4000"]) == 0
    assert "trained on tiny" in out.read_text(encoding="utf-8")
    assert read_net(out).inner.shape[0] == len(FEATURES)
    features, people = shade_examples(open_recording(TINY), np.random.default_rng(0), every=4)
    assert len(features) == len(people) and 0 < people.mean() < 1


@pytest.mark.parametrize("missing", ["truth", "recording"])
def test_what_cannot_be_learnt_from_is_told(tmp_path, recording_folder, missing, caplog):
    folder = recording_folder if missing == "truth" else tmp_path / "nothing"
    assert main([str(folder), "--out", str(tmp_path / "net.csv")]) == 2
    assert "error:" in caplog.text and str(folder) in caplog.text and not (tmp_path / "net.csv").exists()
