"""Constraints on sensors: which of their courses, and which pairs of courses, are allowed."""
