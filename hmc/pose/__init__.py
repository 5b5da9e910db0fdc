"""Pose estimation; ``hmc.pose(recording)`` estimates poses (`hmc.api.pose`)."""

from hmc.callable_package import make_callable

make_callable(__name__)
