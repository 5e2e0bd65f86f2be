"""Warnings of modes of motion that change many times between two scans."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from vedette.kernels.base.types import LONGEST_MODE_STEP
from vedette.scenarios.diagnostics import Path
from vedette.scenarios.loading import Scenario

# A time between scans that takes more steps than this is far longer than a stay.
_MOST_STEPS = 10


def mode_warnings(scenario: Scenario) -> Iterator[tuple[Path, str]]:
    """Yield a warning if the shortest stay in a mode divides the usual time between scans into many steps."""
    model = scenario.model
    if not model.mode_names:
        return
    period = model.time.step_period
    if model.recording is not None:
        from vedette.scenarios.recorded_data import recorded_scans  # slow to import

        times = recorded_scans(model, scenario.folder).times
        period = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    stays = {name: mode.stay_s or math.inf for name, mode in getattr(model.motion, "modes", {}).items()}
    name = min(stays, key=stays.__getitem__)
    steps = math.ceil(period / (LONGEST_MODE_STEP * stays[name]))
    if steps > _MOST_STEPS:
        yield (
            ("motion", "modes", name, "stay_s"),
            f"motion.modes.{name}.stay_s: {stays[name]:g} s is short for scans {period:.3g} s apart: filters divide "
            f"the time between two scans into {steps} steps, each with a prediction of all modes. "
            f"Above {period / (_MOST_STEPS * LONGEST_MODE_STEP):.3g} s there are at most {_MOST_STEPS}",
        )
