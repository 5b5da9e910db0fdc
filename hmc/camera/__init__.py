"""Image space: camera model, rigs, epipolar geometry, calibration formats, segmentation."""
