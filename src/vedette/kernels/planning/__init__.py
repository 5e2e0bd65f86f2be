"""Ideal scans, pseudo-updates and reward tables of a decision."""
