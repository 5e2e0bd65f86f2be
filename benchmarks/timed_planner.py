"""A planner that takes the time of its decisions."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from vedette.control import Plan, Planner
from vedette.simulation import RequiresTruth, Truth


class Timed:
    """A planner with a clock of the process's CPU time, that keeps the bounds of its plans."""

    def __init__(self, planner: Planner) -> None:
        self.planner = planner
        self.seconds: list[float] = []
        self.short: list[float] = []

    @property
    def name(self) -> str:
        """As of the planner."""
        return self.planner.name

    def with_truth(self, truth: Truth) -> Timed:
        """As of the planner."""
        if isinstance(self.planner, RequiresTruth):
            self.planner = self.planner.with_truth(truth)
        return self

    def plan(self, *situation: Any, rng: np.random.Generator) -> Plan:
        """As of the planner."""
        begin = time.process_time()
        plan = self.planner.plan(*situation, rng=rng)
        self.seconds.append(time.process_time() - begin)
        if plan.bound is not None and not plan.bound.unbounded:
            self.short.append(plan.bound.relative)
        return plan
