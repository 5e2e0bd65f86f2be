"""Kernels of planning: ideal scans, pseudo-updates and predictions of a decision."""
