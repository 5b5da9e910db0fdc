"""What is wrong with a recording, told before a run: every finding, and one picture of the rig.

`findings` looks each part over, `silhouettes` compares silhouettes with calibration, room and floor by the hulls of `hull`;
`hmc.camera.rig_picture` draws the rig and its views.
"""

from hmc.callable_package import make_callable
from hmc.check.findings import Finding, Inspection, check_opened, check_recording, inspect_recording

__all__ = ["Finding", "Inspection", "check_opened", "check_recording", "inspect_recording"]

make_callable(__name__)
