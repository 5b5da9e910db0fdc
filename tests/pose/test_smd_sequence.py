"""Multi-cue descent through a whole recording: a stopped run goes on to the same result, with silhouettes kept or made."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from stopped import Stopped, noting, stopping

from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.io.masks import keep_masks
from hmc.io.recording import open_recording
from hmc.io.results import TrackTable, read_centroids
from hmc.pose.methods import smd_sequence as sequence
from hmc.pose.methods.smd import smd_preset
from hmc.pose.methods.smd_sequence import SmdTask
from hmc.pose.starts.settle import FirstPose
from hmc.voxels.hulls import stream_masks

TINY = Path(__file__).resolve().parents[2] / "data" / "synthetic" / "tiny"
VOXEL_M, FRAMES = 0.05, 6


@pytest.fixture(scope="module", autouse=True)
def short_window():
    """People are watched for three frames, so that frames are left to follow them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sequence, "WINDOW_S", 0.2)
        yield


@pytest.fixture(scope="module")
def tracks():
    """The true centroids, and from the second frame on a track of nobody."""
    truth = read_centroids(TINY / "truth" / "centroids.csv")
    truth = truth.where(truth.frames < FRAMES)
    ghost = np.arange(1, FRAMES)
    return TrackTable(
        np.r_[truth.frames, ghost],
        np.r_[truth.persons, 0 * ghost + 7],
        np.vstack([truth.positions, np.tile([2.2, 2.0, 0.9], (len(ghost), 1))]),
    )


@pytest.fixture(scope="module")
def task(tracks):
    def any_start(frame_rng, targets, velocities):
        """Standing with the arms down in the middle one of the frames, of whoever has a hull."""
        if targets[1] is None:
            return None
        state = neutral_state("down")
        state[:3] = (*targets[1].surface[:, :2].mean(0), 0.93)
        return FirstPose(1, default_body(1.74), state, is_fitted=True)

    recording = open_recording(TINY, ["cam_00", "cam_02", "cam_03", "cam_05"], frames=FRAMES)
    return SmdTask(recording, smd_preset("default"), 3, 1.76, any_start)


@pytest.fixture(scope="module")
def run(task, tracks):
    return partial(sequence.pose_by_descent, task, tracks, VOXEL_M)


@pytest.fixture(scope="module")
def masks(task, tmp_path_factory):
    """Silhouettes that the tracker would have kept: without images, which are read again."""
    path = tmp_path_factory.mktemp("kept") / "masks"
    for _ in keep_masks(path, "k", 0, stream_masks(task.recording), pytest.fail):
        pass
    return path


@pytest.fixture(scope="module")
def whole(run):
    return run()


def equal(one, other):
    for a, b in ((one.poses, other.poses), (one.states, other.states)):
        assert_array_equal(a.frames, b.frames)
        assert_array_equal(a.persons, b.persons)
    assert_array_equal(one.poses.positions, other.poses.positions)
    assert_array_equal(one.states.states, other.states.states)
    assert_array_equal(one.costs, other.costs)
    assert one.states.bodies == other.states.bodies and one.notes == other.notes


def test_everybody_has_a_row_a_frame(whole):
    assert whole.poses.frames.tolist() == [0, *np.repeat(np.arange(1, FRAMES), 2)]
    assert np.isfinite(whole.poses.of(0).positions).all() and np.isnan(whole.poses.of(7).positions).all()
    assert whole.notes == ("person 7: 5 frames without a pose: no hull to start from",) and set(whole.states.bodies) == {0}


@pytest.mark.parametrize(("after", "first"), [(3, 1), (4, 4)])
def test_a_stopped_run_goes_on_and_comes_to_the_same(run, masks, whole, tmp_path, after, first):
    """Stopped when one is followed and one not yet started, and when it is known that one cannot start."""
    kept = {"journal": tmp_path / "journal", "masks": masks, "key": "k"}
    with pytest.raises(Stopped):
        run(**kept, progress=stopping(after))
    with open(kept["journal"], "a") as file:
        file.write('{"person":0,"frames":[2],"sta')  # the power went while a line was written
    seen: list[int] = []
    equal(run(**kept, progress=noting(seen)), whole)
    assert seen == list(range(first, FRAMES))
    # Nothing is left to do of a run that was finished.
    seen.clear()
    equal(run(**kept, progress=noting(seen)), whole)
    assert seen == []
