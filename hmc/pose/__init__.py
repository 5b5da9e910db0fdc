"""What pose each body takes: the body model, the annealed filters that fit it, and their start."""
