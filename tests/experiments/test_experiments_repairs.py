"""What each repair of silhouettes adds: overlaps by a loop over pixels, a whole cell, and claims that follow the figures."""

from pathlib import Path

import numpy as np
import pytest

from hmc.errors import InputError
from hmc.experiments import repairs
from hmc.experiments.engine.experiment import Cell, Plan
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.library import find_experiment

TINY = Path(__file__).parents[2] / "data" / "synthetic" / "tiny"
LABEL = "tiny@0"


def cell(without, recording=TINY, frames=6):
    parameters = {"recording": LABEL, "without": without, "frames": frames}
    return repairs.cell(parameters, Inputs(Path("unused"), {LABEL: recording}), np.random.default_rng(0))


def test_overlap_is_that_of_a_loop_over_pixels():
    rng = np.random.default_rng(3)
    found, true = rng.random((2, 12, 9)) < 0.4
    both = sum(bool(a and b) for a, b in zip(found.ravel(), true.ravel(), strict=True))
    either = sum(bool(a or b) for a, b in zip(found.ravel(), true.ravel(), strict=True))
    assert repairs._overlap(found, true) == pytest.approx(both / either)
    assert repairs._overlap(~found & found, ~true & true) == 1


def test_a_cell_scores_the_frames_with_a_truth():
    whole, bare = cell(repairs.ALL), cell("all of these")
    assert whole["silhouettes"].shape == (2, 7) and whole["hulls"].shape == (2,)  # frames 0 and 5, seven cameras
    assert 0.7 < np.mean(whole["silhouettes"]) < 1 and 0.5 < np.mean(whole["hulls"]) < 1
    assert np.mean(bare["silhouettes"]) != np.mean(whole["silhouettes"])


def test_a_recording_without_true_silhouettes_is_refused(tmp_path):
    for name in ("calibration.toml", "recording.toml", "videos", "background"):
        (tmp_path / name).symlink_to(TINY / name)
    with pytest.raises(InputError, match="has no truth/silhouettes in these frames"):
        cell(repairs.ALL, tmp_path, 2)


def claims(added):
    """The claims where each repair adds so much on each recording."""
    cells = []
    for parameters in find_experiment("repairs").grid(Plan()):
        gain = added(parameters["without"], parameters["recording"].partition("@")[0])
        results = {"silhouettes": np.full((3, 4), 0.8 - gain), "hulls": np.full(3, 0.6)}
        cells.append(Cell(parameters, results))
    return {claim.text: claim.holds for claim in find_experiment("repairs").report(cells, Plan()).claims}


def test_claims_follow_the_figures():
    assert all(claims(lambda without, name: 0.02 * (without != repairs.ALL)).values())
    halo = "cutting of halos: {} 0.01 {}"
    takes, adds = (
        halo.format("takes no more than", "of overlap on any recording"),
        halo.format("adds", "on 2 recordings at least beyond two for each it takes that from"),
    )
    harmful = claims(lambda without, name: -0.02 if (without, name) == ("cutting of halos", "pale") else 0.02 * (without != repairs.ALL))
    assert not harmful.pop(takes) and all(harmful.values())
    idle = claims(lambda without, name: 0.0 if without == "cutting of halos" and name != "box" else 0.02 * (without != repairs.ALL))
    assert not idle.pop(adds) and all(idle.values())
    # Of what helps here and harms there nothing is shown, on however many recordings.
    by_turns = claims(lambda without, name: (0.03 if repairs.CLIPS.index(name) % 2 else -0.03) * (without == "cutting of halos"))
    assert not by_turns[adds] and not by_turns[takes]
