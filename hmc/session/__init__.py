"""Live use, and images in memory: one frame of every camera in, people out (`hmc.session.step`)."""
