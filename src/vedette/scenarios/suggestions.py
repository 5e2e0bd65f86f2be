"""Alternatives that a warning recommends: only those with which the scenario is valid."""

from collections.abc import Iterator, Mapping
from typing import Any

from vedette.errors import ScenarioError
from vedette.scenarios.loading import Scenario
from vedette.scenarios.overrides import replace_fields
from vedette.scenarios.sections.fusion import Fusion


def suggest_fusions(scenario: Scenario, fusion: Fusion, *, by_views: bool) -> str:
    """Return a text with fusions that lose less, as they are written in the file, and where each applies; may be empty.

    by_views: True to include fusion of the sensors' local densities by views.
    """
    suggestions = list(_fusions(scenario, fusion, by_views))
    return f"; take {'; '.join(suggestions)}" if suggestions else ""


def is_valid_with(scenario: Scenario, fields: Mapping[str, Any]) -> bool:
    """Return True if the scenario is valid with these fields changed."""
    try:
        replace_fields(scenario, fields)
    except ScenarioError:
        return False
    return True


def _fusions(scenario: Scenario, fusion: Fusion, by_views: bool) -> Iterator[str]:
    own_filter = scenario.model.filter.kind == "custom"  # takes one sensor; density unknown
    if not own_filter:
        for kind, where in (("sequential", "where scans can be sent"), ("parallel", "where only densities can")):
            if kind != fusion.kind and is_valid_with(scenario, {"fusion": {"kind": kind}}):
                yield f"fusion: {{kind: {kind}}} {where}"
    if by_views:
        kind = "arithmetic_average" if fusion.kind == "arithmetic_average" else "clmb"
        for options in _option_sets(scenario, fusion):
            section = {"kind": kind, "field_of_view_weighting": True, **options}
            if is_valid_with(scenario, {"fusion": section}):
                words = ", ".join(f"{key}: {str(value).lower()}" for key, value in section.items())
                yield f"fusion: {{{words}}} where sensors do not share a prediction"
                return


def _option_sets(scenario: Scenario, fusion: Fusion) -> tuple[dict[str, Any], ...]:
    """Return the options with or without feedback and matching, those nearest to the scenario first."""
    birth = scenario.model.birth
    later = birth.from_measurements is not None or birth.steps == "every" or max(birth.steps, default=1) > 1
    plain: dict[str, Any] = {}
    matched, fed_back = {"matching": "assignment"}, {"feedback": True}
    own = (matched, plain) if later else (plain, matched)
    shared = (fed_back, {**fed_back, **matched})
    return (*shared, *own) if fusion.feedback else (*own, *shared)


def suggest_label_settings(scenario: Scenario, fusion: Fusion) -> str:
    """Return a text with settings that keep a target that sensors start at different steps under different labels."""
    settings = [
        f"{name}: {value}"
        for name, value, new_value in (
            ("fusion.matching", "assignment", "assignment"),
            ("fusion.feedback", "true", True),
        )
        if is_valid_with(scenario, {name: new_value})
    ]
    other = suggest_fusions(scenario, fusion, by_views=False)
    return (f"; take {', or '.join(settings)}" if settings else "") + (
        other.replace("; take", ", or") if settings else other
    )
