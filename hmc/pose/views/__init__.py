"""What one frame shows of one person."""
