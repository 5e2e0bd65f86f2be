"""What the sensors of a scenario are called."""

from __future__ import annotations

from vedette.scenarios.sections import ScenarioModel


def sensor_names(model: ScenarioModel) -> tuple[str, ...]:
    """Name of each sensor; `sensor 1`, `sensor 2`, ... where none is given."""
    return tuple(sensor.name or f"sensor {number}" for number, sensor in enumerate(model.sensors, 1))
