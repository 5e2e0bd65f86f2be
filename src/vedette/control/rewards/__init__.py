"""Rewards: the value of a planned update."""
