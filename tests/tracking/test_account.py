"""What a run says of itself: nothing of a good one, one line each of what is wrong."""

import numpy as np

from hmc.io.results import TrackTable
from hmc.tracking.account import Account, account_of, remarks
from hmc.tracking.blobs import observe
from hmc.tracking.state import TrackerInfo
from hmc.voxels.grid import VoxelGrid

GRID = VoxelGrid(np.zeros(3), 0.1, (20, 20, 20))


def table(*ways):
    """A table of persons who stay at places (x, y), for so many frames."""
    rows = [(frame, k, (x, y, 1.0)) for k, (x, y, n) in enumerate(ways) for frame in range(n)]
    frames, persons, places = zip(*rows, strict=True)
    return TrackTable(np.array(frames), np.array(persons), np.array(places))


def test_a_good_run_has_no_remark():
    assert remarks(Account(50, 100, 100 * 0.09, 0.5), table((0, 0, 50), (1, 0, 50)), 25.0, 2) == []


def test_a_frame_s_account_counts_the_strict_hull_and_what_is_nobody_s():
    occupied, certain = np.zeros((2, *GRID.shape), bool)
    occupied[:5, :5, :10] = True
    certain[:4, :5, :10] = True
    observation = observe(GRID, occupied, certain)
    owners = np.where(observation.indices[:, 0] < 3, 7, -1)
    one = account_of(observation, TrackerInfo((), owners))
    assert one.frames == 1 and one.persons == 1
    assert np.isclose(one.strict_m3, 0.2) and np.isclose(one.free_m3, 0.05)
    assert account_of(None, TrackerInfo(())) == Account()
    assert one.plus(one) == Account(2, 2, 2 * one.strict_m3, 2 * one.free_m3)


def test_fat_hulls_free_hulls_and_missing_people_are_told():
    lines = remarks(Account(10, 40, 40 * 0.95, 20.0), table((0, 0, 10), (1, 0, 10)), 25.0, 4)
    assert len(lines) == 3
    assert "950 litres a person" in lines[0] and "53 %" in lines[1] and "at most 2 were found" in lines[2]


def test_two_tracks_on_one_person_are_told():
    there = table((0, 0, 60), (0.1, 0.1, 60), (1, 0, 60))
    assert remarks(Account(), there, 25.0, None) == ["persons 0 and 1 are in one place for 2.4 s: they may be one person"]
    assert remarks(Account(), table((0, 0, 60), (0.1, 0.1, 20)), 25.0, None) == []


def test_nobody_to_look_for_is_told_as_such():
    empty = TrackTable(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 3)))
    (line,) = remarks(Account(15), empty, 25.0, 0)
    assert line.startswith("recording.toml says persons = 0")


def test_an_empty_result_says_where_to_look():
    empty = TrackTable(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 3)))
    (line,) = remarks(Account(15), empty, 25.0, 2)
    assert line.startswith("nobody was found") and "hmc check" in line
