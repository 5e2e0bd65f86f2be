"""Ideal scans, pseudo-updates and prediction of a decision."""
