"""The sections of a scenario file: one class a mapping, one field a key, and what is built of it."""

from vedette.scenarios.sections.base import Section
from vedette.scenarios.sections.scenario import ScenarioModel, merge_sensor_defaults

__all__ = ["ScenarioModel", "Section", "merge_sensor_defaults"]
