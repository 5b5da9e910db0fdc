"""First poses, and the person's own dimensions."""
