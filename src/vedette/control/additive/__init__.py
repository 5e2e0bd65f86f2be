"""Rewards of joint actions that are sums over targets, from the information that each sensor adds about each target."""
