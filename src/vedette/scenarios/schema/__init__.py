"""The schema of scenario files, as pydantic models: one class a mapping, one field a key."""

from vedette.scenarios.schema.base import Section
from vedette.scenarios.schema.scenario import ScenarioModel, merge_sensor_defaults

__all__ = ["ScenarioModel", "Section", "merge_sensor_defaults"]
