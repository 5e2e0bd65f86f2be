"""Scenarios written as YAML."""

from __future__ import annotations

import io
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from vedette.scenarios.schema import ScenarioModel

_LONGEST_LINE = 100


def dump_scenario(model: ScenarioModel) -> str:
    """YAML text of a scenario with every default written out; it reads back as the same scenario."""
    yaml = YAML(typ="rt", pure=True)
    yaml.width = 120
    yaml.indent(mapping=2, sequence=4, offset=2)
    out = io.StringIO()
    yaml.dump(_laid_out(model.model_dump(mode="json")), out)
    return out.getvalue()


def _laid_out(value: Any) -> Any:
    """The data with small collections on one line."""
    if isinstance(value, dict):
        mapping = CommentedMap((key, _laid_out(item)) for key, item in value.items())
        if value and len(repr(value)) <= _LONGEST_LINE and not any(isinstance(v, dict | list) for v in value.values()):
            mapping.fa.set_flow_style()
        return mapping
    if isinstance(value, list):
        items = CommentedSeq(_laid_out(item) for item in value)
        if not any(isinstance(item, dict) for item in value):
            items.fa.set_flow_style()
        return items
    return value
