"""Pictures and videos of a result over its recording: people drawn into every camera's image, and a 3-D panel. OpenCV only."""
