"""The tracker on recordings that another program rendered, and on real ones; skipped where they are not on this machine."""

import numpy as np

from hmc.io.recording import open_recording
from hmc.io.results import read_centroids
from hmc.metrics.mot import clear_mot
from hmc.tracking.resumable import track_recording


def test_three_people_who_cross(shared_data):
    path = shared_data / "rendered" / "r3"
    table = track_recording(open_recording(path, start=40, frames=45), 0.08)
    truth = read_centroids(path / "truth" / "centroids.csv")
    scores = clear_mot(truth.where((truth.frames >= 40) & (truth.frames < 85)), table)
    assert scores.mota > 0.99
    assert scores.motp < 0.06
    assert scores.mismatches == 0


def test_noisy_silhouettes_of_a_real_person(shared_data):
    table = track_recording(open_recording(shared_data / "bodytrack"))
    assert list(table.frames) == [0, 1] and set(table.persons) == {0}
    # An annealed particle filter in C++ puts the root at (.139, .942, .868) and (.152, .944, .867) m.
    assert np.linalg.norm(table.positions[:, :2] - [(0.139, 0.942), (0.152, 0.944)], axis=1).max() < 0.08
