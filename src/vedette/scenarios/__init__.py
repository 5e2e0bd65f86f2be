"""Named scenarios as data: the schema of their YAML files, their faults by line and column, what is built of them."""

from vedette.scenarios.loading import Scenario, json_schema, list_builtin, load_scenario, parse_scenario

__all__ = ["Scenario", "json_schema", "list_builtin", "load_scenario", "parse_scenario"]
