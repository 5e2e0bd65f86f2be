"""Rewards of joint actions that are sums over targets, of what each sensor's scans say of each target."""

from vedette.control.additive.rewards import AdditiveRewards
from vedette.control.additive.situation import Samples, SensorGroup, Start, starts_of
from vedette.control.additive.table import lay_out_changes
from vedette.control.additive.valuations import valuation_of

__all__ = ["AdditiveRewards", "Samples", "SensorGroup", "Start", "lay_out_changes", "starts_of", "valuation_of"]
