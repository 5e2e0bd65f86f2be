"""Metrics of estimates against the truth: distances between sets of points and of tracks, breaks, consistency."""
