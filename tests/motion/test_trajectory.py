"""Trajectories of tables: what lies between frames."""

import numpy as np
import pytest

from hmc.errors import InputError
from hmc.io.results import PoseTable
from hmc.landmarks import LANDMARKS
from hmc.motion.trajectory import trajectories


def test_a_frame_that_is_far_from_all_others_is_told():
    """Else the frames between take gigabytes."""
    table = PoseTable(np.array([0, 1, 9_999_999]), np.zeros(3, int), np.zeros((3, len(LANDMARKS), 3)))
    with pytest.raises(InputError, match="person 0 has a pose in 3 of the frames 0 to 9999999; remove the line"):
        trajectories(table, None, 15.0)
