"""The sections of a scenario file: one class for each mapping, one field for each key, and their builders."""

from vedette.scenarios.sections.base import Section
from vedette.scenarios.sections.fields import merge_sensor_defaults
from vedette.scenarios.sections.scenario import ScenarioModel

__all__ = ["ScenarioModel", "Section", "merge_sensor_defaults"]
