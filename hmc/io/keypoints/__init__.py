"""What a 2-D keypoint detector left beside a recording: found, read frame by frame, and brought to one list of names."""

from hmc.io.keypoints.layouts import KEYPOINTS
from hmc.io.keypoints.source import KeypointSource, open_keypoints
from hmc.io.keypoints.writing import write_openpose

__all__ = ["KEYPOINTS", "KeypointSource", "open_keypoints", "write_openpose"]
