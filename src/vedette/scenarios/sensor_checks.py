"""Checks of each sensor: whether what it measures, its noise and its clutter fit together."""

from __future__ import annotations

import math
from collections.abc import Iterator

from vedette.scenarios.faults import Finding, Path, describe
from vedette.scenarios.sections.sensing import (
    ConstantNoise,
    CustomMeasurement,
    MeasurementSpaceClutter,
    Position,
    RangeDependentNoise,
    RegionClutter,
)
from vedette.scenarios.sections.sensors import Sensor


def _dim(sensor: Sensor) -> int | None:
    # A sensor of a faulty file has None where the schema promises a value.
    return None if sensor.measurement is None else sensor.measurement.dim


def sensor_findings(sensors: tuple[Sensor | None, ...]) -> Iterator[Finding]:
    """What is wrong with the sensors, each by itself and their names together."""
    names: set[str] = set()
    for i, sensor in enumerate(sensors):
        if sensor is None:
            continue
        if sensor.name in names:
            yield ("sensors", i, "name"), "each name once", f"{describe(sensor.name)} again"
        if sensor.name is not None:
            names.add(sensor.name)
        yield from _noise(("sensors", i, "noise"), sensor)
        yield from _clutter(("sensors", i, "clutter"), sensor)


def _noise(path: Path, sensor: Sensor) -> Iterator[Finding]:
    noise, dim = sensor.noise, _dim(sensor)
    if isinstance(noise, RangeDependentNoise) and isinstance(sensor.measurement, Position | CustomMeasurement):
        yield path, f"constant or custom noise for a {sensor.measurement.kind} measurement", "range_dependent noise"
    elif isinstance(noise, ConstantNoise) and dim is not None and len(noise.std) != dim:
        yield (*path, "std"), _components(dim, sensor), describe(noise.std)


def _components(dim: int, sensor: Sensor) -> str:
    numbers = "1 number" if dim == 1 else f"{dim} numbers"
    return f"{numbers}, as a {sensor.measurement.kind} measurement has"


def _clutter(path: Path, sensor: Sensor) -> Iterator[Finding]:
    clutter, dim = sensor.clutter, _dim(sensor)
    if isinstance(clutter, RegionClutter) and isinstance(sensor.measurement, CustomMeasurement):
        yield path, "measurement_space or custom clutter for a custom measurement", "region clutter"
    if not isinstance(clutter, MeasurementSpaceClutter):
        return
    for name, values in (("low", clutter.low), ("high", clutter.high)):
        if dim is not None and len(values) != dim:
            yield (*path, name), _components(dim, sensor), describe(values)
    if dim is None and len(clutter.low) != len(clutter.high):
        yield (*path, "high"), f"as many numbers as low, {len(clutter.low)}", describe(clutter.high)
    for j, (low, high) in enumerate(zip(clutter.low, clutter.high, strict=False)):
        if high <= low:
            yield (*path, "high", j), f"a number above low, {low:g}", describe(high)
        elif (
            sensor.measurement is not None
            and j in sensor.measurement.angular
            and high - low > 2.0 * math.pi * (1.0 + 1e-9)
        ):
            yield (*path, "high", j), f"an angle of at most 2 pi above low, {low:g}", describe(high)
