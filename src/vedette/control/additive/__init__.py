"""Rewards of joint actions that are sums over targets, of what each sensor's scans say of each target."""
