"""Time between cameras: shifts, drifts and dropped frames, by what all cameras see.

`barcodes` and `evidence` say how unlike two cameras' views are at any two frames, `shifts` and `courses` find the frames that belong
together, `find` brings both together.
"""

from hmc.check.sync.report import inspect_synchrony, sync_lines

__all__ = ["inspect_synchrony", "sync_lines"]
