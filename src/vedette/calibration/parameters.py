"""Sensor parameters to be estimated from a recording, and the likelihood of the recording given their values."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from vedette.filters.inputs import births_within
from vedette.kernels.base.types import Floats
from vedette.recorded import RecordedScans, RecordedSensor, remove_biases
from vedette.tracking import Tracker

Kind = Literal["bias", "noise", "detection", "clutter", "motion"]
TARGETS = -1  # in place of the number of a sensor, for the motion of targets
_AT_ONCE = 1e-6  # s; scans closer in time are simultaneous
Scale = Literal["plain", "log", "logit"]


@dataclass(frozen=True, slots=True)
class Parameter:
    """Parameter of a sensor, or of the motion of targets.

    Attributes:
        sensor: number of the sensor, from 0, or `TARGETS`.
        kind: bias, noise, detection, clutter or motion.
        component: for a bias a field of `vedette.models.Bias`, for noise a component of the measurement or
            "extent", for motion the name of a mode.
        name: as in the sensors file: "range", "noise.sigma_range", "modes.cruise.stay_s".
        unit: "m", "deg", "s", "per scan", "".
        start: assumed value before estimation.
        per_si: value that corresponds to one SI unit, negative if the sign is reversed.
        scale: quantity in which intervals are symmetric: the value, its logarithm or its log-odds.
        unknown: standard deviation, on that scale, from which the parameter counts as unknown.
        usual: standard deviation, on that scale, before any recording. inf: any value is plausible.
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
    usual: float = math.inf

    @property
    def label(self) -> str:
        """Name in words, such as "range bias"."""
        if self.kind == "motion":
            return self.name.removeprefix("modes.")
        component = self.component.replace("_", " ")
        if self.kind == "bias":
            return "clock offset" if self.component == "clock" else f"{component} bias"
        return {"noise": f"{component} noise std", "detection": "detection prob.", "clutter": "clutter rate"}[self.kind]

    def to_free(self, value: float) -> float:
        """Return a value on the scale."""
        if self.scale == "plain":
            return value
        return math.log(value) if self.scale == "log" else math.log(value) - math.log1p(-value)

    def from_free(self, free: float) -> float:
        """Return the value of a number on the scale."""
        if self.scale == "plain":
            return free
        bounded = min(max(free, -30.0), 30.0)
        return math.exp(bounded) if self.scale == "log" else 1.0 / (1.0 + math.exp(-bounded))


def with_biases(
    sites: Sequence[RecordedSensor], parameters: Sequence[Parameter], values: Floats
) -> list[RecordedSensor]:
    """Return the sensors with the biases among these values of the parameters."""
    found = list(sites)
    for each, value in zip(parameters, values.tolist(), strict=True):
        if each.kind == "bias":
            # The bearing of a `Bias` has the direction of the recorded rows, like its parameter.
            own, change = found[each.sensor], {each.component: value / abs(each.per_si)}
            found[each.sensor] = replace(own, bias=replace(own.bias, **change))
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Calibration problem: a recording and the sensor parameters to estimate.

    Attributes:
        recording: as recorded, including biases.
        sites: the sensors, with their biases except those that are parameters.
        parameters: the parameters to estimate.
        tracker: function of the parameter values and `births`, which returns a deterministic tracker for such sensors,
            and (num_sensors,) what to add to its log likelihood per scan.
        births: expected births from measurements per scan, where their rate is learnt.
    """

    recording: RecordedScans
    sites: tuple[RecordedSensor, ...]
    parameters: tuple[Parameter, ...]
    tracker: Callable[[Floats, float], tuple[Tracker, Floats]]
    births: float

    def values(self, free: Floats) -> Floats:
        """(num_parameters,) values of numbers on the parameters' scales."""
        return np.array([each.from_free(x) for each, x in zip(self.parameters, free.tolist(), strict=True)])

    def free(self, values: Sequence[float]) -> Floats:
        """(num_parameters,) values on the parameters' scales."""
        return np.array([each.to_free(float(x)) for each, x in zip(self.parameters, values, strict=True)])

    def without_biases(self, values: Floats) -> RecordedScans:
        """Return the recording as sensors without these biases would have made it."""
        return remove_biases(self.recording, self.with_biases(values))

    def with_biases(self, values: Floats) -> list[RecordedSensor]:
        """Return the sensors with the biases among these values of the parameters."""
        return with_biases(self.sites, self.parameters, values)

    def term_times(self) -> Floats:
        """(num_scans,) recorded times of the contributions of `log_likelihoods`, s."""
        instants = list(zip(self.recording.times.tolist(), self.recording.scans, strict=True))
        return np.array([time for s in range(len(self.sites)) for time, scans in instants if scans[s] is not None])

    def log_likelihoods(self, free: Floats) -> Floats:
        """(num_scans,) contribution of each scan to the log likelihood, ordered by sensor and then by scan.

        The first of simultaneous scans has their sum. The total is the sum of the log densities of each scan given
        those before, as reported by the tracker's filter.
        """
        values = self.values(free)
        recording, (tracker, more) = self.without_biases(values), self.tracker(values, self.births)
        rngs = (np.random.default_rng(0),) * len(self.sites)
        counts = [sum(scans[s] is not None for scans in self.recording.scans) for s in range(len(self.sites))]
        places = np.concatenate([[0], np.cumsum(counts)])
        found, state = np.zeros(places[-1]), tracker.initial()
        gaps = np.diff(recording.times, append=recording.times[-1]).tolist()
        instants = zip(recording.times.tolist(), gaps, recording.scans, recording.poses, strict=True)
        for time, gap, scans, poses in instants:
            state, info = tracker.step(state, list(scans), poses, time, rngs=rngs)
            scanning = [s for s, scan in enumerate(scans) if scan is not None]
            found[places[scanning[0]]] = sum(each.log_likelihood for each in info.filters) + more[scanning].sum()
            places[scanning] += 1
            if gap > _AT_ONCE and state.memory is not None:
                # The birth positions must not depend on the time of the next scan of another sensor.
                state = replace(state, fused=births_within(state.fused, None, 0.0, state.memory), memory=None)
        return found
