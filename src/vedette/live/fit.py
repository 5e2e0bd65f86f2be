"""Fit of the assumed model to the latest scans of a stream."""

import math
import re
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from operator import attrgetter

from vedette.densities import Estimator
from vedette.evaluation.fit import NOTHING, Finding, Fit, fit_of
from vedette.evaluation.innovations import Assumed, Compared, Instant, compared
from vedette.tracking import Timeline

_WINDOW = 120  # latest scans of each sensor, which is the length of the runs that levels are measured with
_EVERY = 20  # scans of each sensor on average, between two tests
_SETTLED = 5.0  # s behind the latest scan, after which scans are tested; still later ones do not change the tests
_LASTING = _WINDOW // _EVERY  # tests without a finding until it is gone, as the window then has none of its scans


@dataclass(frozen=True, slots=True, eq=False)
class LiveFit:
    """Window of the latest instants, and what the model does not explain in it."""

    before: Instant | None = None  # the latest instant, or None before the first
    compared: tuple[Compared, ...] = ()  # the instants of the window
    num_scans: int = 0  # scans since the last test
    found: tuple[tuple[Finding, int], ...] = ()  # findings, each with the number of tests since it was found
    searched: str = NOTHING  # as in `Fit`

    @property
    def fit(self) -> Fit:
        """Present findings."""
        return Fit(tuple(finding for finding, _ in self.found), self.searched)

    def continued(self, before: Timeline, after: Timeline, estimate: Estimator, assumed: Assumed) -> "LiveFit":
        """Return the window with the instants between two timelines, tested if enough scans arrived."""
        last = -math.inf if self.before is None else self.before.time
        entries = [each for each in before.entries if last < each.time < after.entries[0].time]
        end = bisect_right(after.entries, after.entries[-1].time - _SETTLED, key=attrgetter("time"))
        entries += [each for each in after.entries[:end] if each.time > last]
        if not entries:
            return self
        num = len(assumed.sensors)
        instants = [
            Instant(
                each.time,
                each.poses,
                tuple(each.scans[s].measurements if s in each.scans else None for s in range(num)),
                estimate(each.state.fused, each.state.step),
            )
            for each in entries
        ]
        pairs = pairwise(instants if self.before is None else [self.before, *instants])
        window = (*self.compared, *(compared(*pair, assumed) for pair in pairs))
        num_scans = self.num_scans + sum(len(each.scans) for each in entries)
        found, searched = self.found, self.searched
        if num_scans >= _EVERY * num:
            num_scans, window = 0, _latest(window, num)
            fit = fit_of(window, assumed)
            earlier = self.without(fit.findings)
            found = tuple((each, age + 1) for each, age in found if age + 1 < _LASTING and each in earlier)
            found, searched = (*found, *((each, 0) for each in fit.findings)), fit.searched
        return LiveFit(instants[-1], window, num_scans, found, searched)

    def without(self, others: Sequence[Finding]) -> list[Finding]:
        """Return the findings that are not among others. Numbers, which change from test to test, do not count."""
        names = [(each.test, each.sensor, re.sub(r"\d+", "", each.text)) for each in (*others, *self.fit.findings)]
        own, known = names[len(others) :], names[: len(others)]
        return [each for each, name in zip(self.fit.findings, own, strict=True) if name not in known]


def _latest(window: Sequence[Compared], num_sensors: int) -> tuple[Compared, ...]:
    """Return the instants with one of the latest scans of a sensor."""
    numbers, kept = [0] * num_sensors, list[Compared]()
    for each in reversed(window):
        scanned = [s for s, fit in enumerate(each.fits) if fit is not None]
        if any(numbers[s] < _WINDOW for s in scanned):
            kept.append(each)
        for s in scanned:
            numbers[s] += 1
    return tuple(reversed(kept))
