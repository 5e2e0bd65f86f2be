"""What is to be found of the sensors of a recording, and how likely the recording is where they are such."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.recorded import RecordedScans, Site, without_biases
from vedette.tracking import Tracker

Kind = Literal["bias", "noise", "detection", "clutter"]
_AT_ONCE = 1e-6  # s; scans nearer than this are of one instant
Scale = Literal["plain", "log", "logit"]


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number that says what a sensor is like.

    Attributes:
        sensor: its number, from 0.
        kind: what it is of.
        component: what of: of a bias a field of `vedette.models.Bias`, of noise a component of the measurement.
        name: as in the sensors file: "range", "noise.sigma_range".
        unit: "m", "deg", "s", "per scan", "".
        start: what it is taken for before anything is known.
        per_si: its value where the SI value is 1; negative where it counts the other way.
        scale: of what its intervals are symmetric: itself, its logarithm or its log-odds.
        unknown: standard deviation, on that scale, from which on nothing is known of it.
    """

    sensor: int
    kind: Kind
    component: str
    name: str
    unit: str
    start: float
    per_si: float
    scale: Scale
    unknown: float

    @property
    def label(self) -> str:
        """The name in words, such as "range bias"."""
        component = self.component.replace("_", " ")
        if self.kind == "bias":
            return "clock offset" if self.component == "clock" else f"{component} bias"
        return {"noise": f"{component} noise std", "detection": "detection prob.", "clutter": "clutter rate"}[self.kind]

    def to_free(self, value: float) -> float:
        """On the scale."""
        if self.scale == "plain":
            return value
        return math.log(value) if self.scale == "log" else math.log(value) - math.log1p(-value)

    def from_free(self, free: float) -> float:
        """The value of what is so on the scale."""
        if self.scale == "plain":
            return free
        bounded = min(max(free, -30.0), 30.0)
        return math.exp(bounded) if self.scale == "log" else 1.0 / (1.0 + math.exp(-bounded))


def with_biases(sites: Sequence[Site], parameters: Sequence[Parameter], values: Floats) -> list[Site]:
    """The sensors with the biases among these values of the parameters."""
    found = list(sites)
    for each, value in zip(parameters, values.tolist(), strict=True):
        if each.kind == "bias":
            # The bearing of a `Bias` has the rows' direction, as its parameter has.
            own, change = found[each.sensor], {each.component: value / abs(each.per_si)}
            found[each.sensor] = replace(own, bias=replace(own.bias, **change))
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A recording and what is to be found of its sensors.

    Attributes:
        recording: as it was made, biases in it.
        sites: the sensors, with their biases where no parameter says otherwise.
        parameters: what is to be found.
        tracker: one for sensors as these values of the parameters say, which draws no random numbers; and
            (num_sensors,) what is to be added to its log likelihood for each scan.
    """

    recording: RecordedScans
    sites: tuple[Site, ...]
    parameters: tuple[Parameter, ...]
    tracker: Callable[[Floats], tuple[Tracker, Floats]]

    def values(self, free: Floats) -> Floats:
        """(num_parameters,) values of what is so on their scales."""
        return np.array([each.from_free(x) for each, x in zip(self.parameters, free.tolist(), strict=True)])

    def free(self, values: Sequence[float]) -> Floats:
        """(num_parameters,) values on their scales."""
        return np.array([each.to_free(float(x)) for each, x in zip(self.parameters, values, strict=True)])

    def without_biases(self, values: Floats) -> RecordedScans:
        """The recording as sensors without such biases would have made it."""
        return without_biases(self.recording, self.with_biases(values))

    def with_biases(self, values: Floats) -> list[Site]:
        """The sensors with the biases among these values of the parameters."""
        return with_biases(self.sites, self.parameters, values)

    def log_likelihoods(self, free: Floats) -> Floats:
        """(num_scans,) what each scan of each sensor adds to the log likelihood, whatever order they are in.

        Scans of one instant have their sum in the first of them. The sum is of what the tracker's filter reports: the
        log density of each scan given those before it.
        """
        values = self.values(free)
        recording, (tracker, more) = self.without_biases(values), self.tracker(values)
        rngs = (np.random.default_rng(0),) * len(self.sites)
        counts = [sum(scans[s] is not None for scans in self.recording.scans) for s in range(len(self.sites))]
        places = np.concatenate([[0], np.cumsum(counts)])
        found, state = np.zeros(places[-1]), tracker.initial()
        birth = tracker.targets.birth
        at_once = birth.from_measurements is not None and birth.num_sites == 0 and birth.period is None
        gaps = np.diff(recording.times, append=recording.times[-1]).tolist()
        instants = zip(recording.times.tolist(), gaps, recording.scans, recording.poses, strict=True)
        for time, gap, scans, poses in instants:
            state, info = tracker.step(state, list(scans), poses, time, rngs=rngs)
            scanning = [s for s, scan in enumerate(scans) if scan is not None]
            found[places[scanning[0]]] = sum(each.log_likelihood for each in info.filters) + more[scanning].sum()
            places[scanning] += 1
            if at_once and gap > _AT_ONCE:
                # When another sensor happens to scan next must not decide where those begin who are born here.
                state, _ = tracker.step(state, [None] * len(scans), poses, math.nextafter(time, math.inf), rngs=rngs)
        return found
