"""Scores against truth: landmarks, tracks, persons, time. Plain arrays in, plain numbers out."""
