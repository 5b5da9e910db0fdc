"""A session of many trials: its file, what is kept of each trial, and the report."""
