"""Named scenarios as data: the schema of their YAML files, and their faults by line and column.

`vedette.scenarios.build` builds filters, planners and simulations from them.
"""

from vedette.scenarios.generated import GeneratedScene, scene_text
from vedette.scenarios.generated_crowd import GeneratedCrowd, crowd_text
from vedette.scenarios.loading import Scenario, json_schema, list_builtin, load_scenario, parse_scenario
from vedette.scenarios.overrides import replace_fields

__all__ = [
    "GeneratedCrowd",
    "GeneratedScene",
    "Scenario",
    "crowd_text",
    "json_schema",
    "list_builtin",
    "load_scenario",
    "parse_scenario",
    "replace_fields",
    "scene_text",
]
