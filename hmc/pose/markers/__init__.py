"""Pose from markers: 2-D detections in all views, an annealed particle filter with the epipolar likelihood (Canton 2009, 6.4, 6.6)."""
