"""A skeleton of 23 parameters fitted to skeleton curves by particle swarm optimisation. Hsiao (2008), section 3.2."""
