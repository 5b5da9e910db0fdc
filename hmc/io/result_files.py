"""Which files make a result, by name. It imports nothing, so that the command line may ask it before anything else is loaded."""

from __future__ import annotations

__all__ = ["BESIDE", "RESULT", "UNFINISHED"]

#: What `hmc pose` always leaves; the last is written last.
RESULT = ("joints.csv", "tracks.csv", "pose.npz", "run.toml")
#: What is beside them where there is something to write: the feet's points, what trust rests on, what a method tells of each frame, and
#: cameras that were turned back.
BESIDE = ("feet.csv", "evidence.csv", "fits.csv", "turned_cameras.toml")
#: Patterns of the files of a run that is not finished: what its stages keep, by which it goes on.
UNFINISHED = (".*.journal*", ".masks*")
