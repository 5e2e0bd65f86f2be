"""Sections about the times of a sensor's scans, their delays, and errors that last from scan to scan."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from vedette.errors import InputError
from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import NonNegative, Positive, Probability, Section, Share, Step, check

if TYPE_CHECKING:  # importing the models imports the compiler, which a check does not need
    from vedette.kernels.base.types import Bools
    from vedette.scenarios.sections.world import Time
    from vedette.tracking import Delay


class LateSection(Section):
    """Scans that come late, and are put in their places when they do."""

    probability: Probability = Field(default=1.0, description="Probability that a scan is late [-].")
    max_delay: Positive = Field(description="By how much, uniform from 0 [s].")
    start: float | None = Field(default=None, description="Scans taken before come at once; none: none does [s].")
    end: float | None = Field(default=None, description="Scans taken after it come at once; none: none does [s].")
    window: NonNegative | None = Field(
        default=None, description="A scan that is later than this is lost; none: none is [s]."
    )

    @check
    def _in_order(self) -> Iterator[Finding]:
        if self.start is not None and self.end is not None and self.start > self.end:
            yield ("end",), f"a time from start on, {self.start:g} s", describe(self.end)

    def build(self) -> Delay:
        """Return the delay of the scans for a tracker."""
        from vedette.tracking import Delay

        given = {name: value for name, value in self.model_dump().items() if value is not None}
        return Delay(**given)


class ScanTimes(Section):
    """When a sensor scans: at the first step and every so many after it, by steps or by seconds."""

    every: Step = Field(default=1, description="Steps from one scan to the next [-].")
    first: Step = Field(default=1, description="Step of the first scan [-].")
    period: Positive | None = Field(
        default=None, description="Time from one scan to the next, a whole number of steps, instead of every [s]."
    )
    offset: NonNegative | None = Field(
        default=None, description="Time of the first scan after the first step, instead of first [s]."
    )
    scan_loss_probability: Share | None = Field(
        default=None,
        description="Probability that a scan does not take place, of which decisions know nothing; none: all do [-].",
    )
    late: LateSection | None = Field(default=None, description="How its scans come late; none: all at once [-].")

    @check
    def _within_the_first_round(self) -> Iterator[Finding]:
        if self.first > self.every:
            yield ("first",), f"a step up to every, {self.every}", describe(self.first)

    @check
    def _steps_or_seconds(self) -> Iterator[Finding]:
        if self.period is not None and (self.every, self.first) != (1, 1):
            yield ("period",), "either every and first, or period and offset", "both"
        elif self.offset is not None and (self.period is None or self.offset >= self.period):
            wanted = "a time below that of period, with it" if self.period else "a period with it"
            yield ("offset",), wanted, describe(self.offset)

    def findings_beside(self, step_period: float) -> Iterator[Finding]:
        """Yield faults for steps of this period, s."""
        for name in ("period", "offset"):
            value = getattr(self, name)
            if value is not None and abs(value - round(value / step_period) * step_period) > 1e-6 * step_period:
                yield (name,), f"a multiple of time.step_period, {step_period:g} s", describe(value)
        if self.period is not None and self.period < 0.5 * step_period:
            yield ("period",), f"at least time.step_period, {step_period:g} s", describe(self.period)

    def steps(self, step_period: float) -> tuple[int, int]:
        """Return the steps from one scan to the next, and the first of them."""
        if self.period is None:
            return self.every, self.first
        return round(self.period / step_period), 1 + round((self.offset or 0.0) / step_period)

    def build(self, time: Time) -> Bools:
        """Return True for each step with a scan, (num_steps,), before drop-outs."""
        every, first = self.steps(time.step_period)
        return np.asarray((np.arange(1, time.num_steps + 1) - first) % every == 0)


class Correlation(Section):
    """Correlation times of the errors of a sensor, and for how long it sees a target or not.

    Filters, which take errors as independent, count each scan for less. They keep for each target whether it is visible
    or hidden, in place of a probability of detection of each scan by itself.
    """

    noise_s: NonNegative = Field(default=0.0, description="Correlation time of the errors of a target [s].")
    interval_s: Positive | None = Field(
        default=None,
        description="Time between two scans; none: `scans.period`, or the median of a recording; needed live [s].",
    )
    visible_s: Positive | None = Field(
        default=None,
        description="Mean time for which a target stays visible; `detection` is its detection meanwhile; none: it is "
        "never hidden [s].",
    )
    hidden_s: Positive | None = Field(
        default=None, description="Mean time for which a target stays hidden, with visible_s [s]."
    )

    @check
    def _both_stays(self) -> Iterator[Finding]:
        if (self.visible_s is None) != (self.hidden_s is None):
            missing = "visible_s" if self.visible_s is None else "hidden_s"
            yield (missing,), "a time in s, as of visible_s and hidden_s both or none are given", "none"

    @property
    def stays_s(self) -> tuple[float, float] | None:
        """Mean times for which a target is visible and hidden, s, or None if it is never hidden."""
        return None if self.visible_s is None or self.hidden_s is None else (self.visible_s, self.hidden_s)

    def interval(self, scans: ScanTimes, step_period: float | None) -> float:
        """Return the time between two scans, s. step_period: of a simulation, s; None: of recorded or live scans.

        Raises `InputError` if it is not known.
        """
        if self.interval_s is not None:
            return self.interval_s
        if step_period is None:
            wanted = "the time between two scans, in s, where errors last and scans are not simulated"
            raise InputError(f"correlation.interval_s: expected {wanted}; got none")
        return scans.steps(step_period)[0] * step_period
