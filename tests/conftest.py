"""Settings that hold for every test."""

from __future__ import annotations

import matplotlib
from hypothesis import HealthCheck, settings

matplotlib.use("Agg")

# The same examples every time: a failure is the change's doing, never the dice's. No deadline: a first call compiles.
settings.register_profile(
    "vedette", derandomize=True, deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("vedette")
