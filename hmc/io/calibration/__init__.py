"""Calibration files: one module a format, one function that reads them all.

The recording's own form is the Anipose / Pose2Sim TOML (`write_calibration` writes it). The other formats are read as they are
and are returned in the same conventions: world to camera, pixel centres on integers, metres and Z up where the file has them so or
recording.toml says how to get there.
"""

from hmc.io.calibration.entry import CalibrationEntry, build_camera, natural_key
from hmc.io.calibration.read import find_calibration, read_calibration, read_entries
from hmc.io.calibration.toml import write_calibration

__all__ = ["CalibrationEntry", "build_camera", "find_calibration", "natural_key", "read_calibration", "read_entries", "write_calibration"]
