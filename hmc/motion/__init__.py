"""What is done with a finished result: gaps filled, trajectories smoothed, clinical angles, files for other programs."""
