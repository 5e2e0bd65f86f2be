"""True sensors of the simulation, which may differ from the sensor models of the filters."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from vedette.errors import InputError
from vedette.internal.quantities import ONLY_MEASURED
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models import Bias, DetectionModel, SensorModel
from vedette.models.arguments import reject
from vedette.models.bias import NO_BIAS
from vedette.models.fields import NonNegative, check_fields


@dataclass(frozen=True, slots=True, eq=False)
class TrueSensor:
    """True sensor of the simulation.

    Attributes:
        model: measurements, noise, detection and clutter.
        first_detection: detection at its first scan only. None: as at the others.
        detection_of: state at which the detection probability is evaluated: the target's true "state", or with the
            position that the "measurement" gives (`MeasurementModel.places`), noise included. The rest of the state
            stays.
        noise_s: correlation time of the errors of a target, s. 0: they are independent from scan to scan.
        stays_s: mean times for which it sees a target, by its detection, and does not, s. None: it always may.
        bias: bias of its scans, measured minus true. With a positive clock bias, measurements are of slightly earlier
            positions, by the targets' velocities.

    Raises:
        InputError: a part of another type, detection of the measurement if that gives no position, or a bias in a
            component that is not measured.
    """

    model: SensorModel
    first_detection: DetectionModel | None = None
    detection_of: Literal["state", "measurement"] = "state"
    bias: Bias = NO_BIAS
    noise_s: NonNegative = 0.0
    stays_s: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        check_fields(self, "TrueSensor.")
        if self.detection_of == "measurement" and self.model.measurement.places is None:
            expected = "state, as only a position or a bearing with a range say where a target was measured"
            raise reject("TrueSensor.detection_of", expected, self.detection_of)
        for name in ONLY_MEASURED:
            if getattr(self.bias, name) and name not in self.model.measurement.components:
                raise reject(f"TrueSensor.bias.{name}", f"0, as no {name} is measured", getattr(self.bias, name))

    def at_first_scan(self) -> "TrueSensor":
        """Return the sensor at its first scan."""
        if self.first_detection is None:
            return self
        return replace(self, model=replace(self.model, detection=self.first_detection), first_detection=None)


class ErrorMemory:
    """Error and visibility of each target at the last scan of one sensor, where they last.

    Standard normal errors are a first-order autoregressive (Gauss-Markov) sequence of the sensor's correlation time.
    Whether a target is visible is a Markov chain in continuous time, first in its long term.
    """

    def __init__(self) -> None:
        self._last: dict[int, tuple[float, Floats, bool]] = {}

    def lasting(self, sensor: TrueSensor, time: float, ids: Ints, normals: Floats, luck: Floats) -> Bools:
        """Return whether each target is visible at a time, s, (num_targets,), and make its error last.

        normals: (num_targets, meas_dim) new independent errors, which are changed. luck: (num_targets,) uniform
        numbers, which decide on the visibility.
        """
        visible = np.ones(len(ids), np.bool_)
        if not sensor.noise_s and sensor.stays_s is None:
            return visible
        seen, hidden = sensor.stays_s or (1.0, 0.0)
        share = seen / (seen + hidden)
        for i, target in enumerate(ids.tolist()):
            chance = share
            if target in self._last:
                before, errors, was_visible = self._last[target]
                kept = math.exp((before - time) / sensor.noise_s) if sensor.noise_s else 0.0
                normals[i] = kept * errors + math.sqrt(1.0 - kept * kept) * normals[i]
                if hidden:
                    chance += (was_visible - share) * math.exp((before - time) * (1.0 / seen + 1.0 / hidden))
            visible[i] = luck[i] < chance
            self._last[target] = time, normals[i].copy(), bool(visible[i])
        return visible


def true_sensors_of(given: Sequence[TrueSensor], known: Sequence[SensorModel]) -> tuple[TrueSensor, ...]:
    """Return the given true sensors, or without any the sensor models of the filters.

    Raises:
        InputError: another number of sensors, another type, or other measurement components than in the filter.
    """
    if not given:
        return tuple(TrueSensor(model) for model in known)
    if len(given) != len(known):
        raise InputError(f"true_sensors: expected {len(known)}, one for each sensor of the tracker; got {len(given)}")
    for s, (true, model) in enumerate(zip(given, known, strict=True)):
        if not isinstance(true, TrueSensor):
            raise reject(f"true_sensors[{s}]", "a TrueSensor", true)
        for name in ("angular", "periods"):
            of_filter, of_truth = (getattr(each.measurement, name).tolist() for each in (model, true.model))
            if of_truth != of_filter:
                words = {"angular": "angular flags"}.get(name, name)
                expected = f"measurements of {len(of_filter)} components with the {words} {of_filter}, as the filter's"
                raise reject(f"true_sensors[{s}]", expected, of_truth)
    return tuple(given)


def sensors_at_step(sensors: Sequence[TrueSensor], scans_at: Bools | None, step: int) -> tuple[TrueSensor | None, ...]:
    """Return the true sensors at a step, or None for one that does not scan then.

    Args:
        sensors: all sensors.
        scans_at: (num_sensors, num_scans) whether each scans. None: at every step.
        step: step of the run, from 1.
    """
    if scans_at is None:
        return tuple(sensors) if step > 1 else tuple([sensor.at_first_scan() for sensor in sensors])
    true_sensors: list[TrueSensor | None] = []
    for sensor, scans in zip(sensors, scans_at, strict=True):
        is_first = not scans[: step - 1].any()
        true_sensors.append(None if not scans[step - 1] else sensor.at_first_scan() if is_first else sensor)
    return tuple(true_sensors)
