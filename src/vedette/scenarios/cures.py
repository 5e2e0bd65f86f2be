"""What a warning tells to take instead: only what the scenario as it stands is accepted with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from vedette.errors import ScenarioError
from vedette.scenarios.loading import Scenario
from vedette.scenarios.overrides import with_fields
from vedette.scenarios.sections.fusion import Fusion


def fusions_instead(scenario: Scenario, fusion: Fusion, *, by_views: bool) -> str:
    """Fusions that lose less, each as it is to be written and where it can be had; empty where there is none.

    by_views: whether one of the sensors' own densities by views is among them.
    """
    found = list(_fusions(scenario, fusion, by_views))
    return f"; take {'; '.join(found)}" if found else ""


def accepted(scenario: Scenario, fields: Mapping[str, Any]) -> bool:
    """Whether the scenario is valid with these fields changed."""
    try:
        with_fields(scenario, fields)
    except ScenarioError:
        return False
    return True


def _fusions(scenario: Scenario, fusion: Fusion, by_views: bool) -> Iterator[str]:
    own_filter = scenario.model.filter.kind == "custom"  # of one sensor, and of a kind that is not known
    if not own_filter:
        for kind, where in (("sequential", "where scans can be sent"), ("parallel", "where only densities can")):
            if kind != fusion.kind and accepted(scenario, {"fusion": {"kind": kind}}):
                yield f"fusion: {{kind: {kind}}} {where}"
    if by_views:
        kind = "arithmetic_average" if fusion.kind == "arithmetic_average" else "clmb"
        for further in _ways(scenario, fusion):
            section = {"kind": kind, "by_views": True, **further}
            if accepted(scenario, {"fusion": section}):
                words = ", ".join(f"{key}: {str(value).lower()}" for key, value in section.items())
                yield f"fusion: {{{words}}} where sensors do not share a prediction"
                return


def _ways(scenario: Scenario, fusion: Fusion) -> tuple[dict[str, Any], ...]:
    """With feedback or without and labels matched or not: what is nearest to the scenario first."""
    birth = scenario.model.birth
    later = birth.from_measurements is not None or birth.steps == "every" or max(birth.steps, default=1) > 1
    plain: dict[str, Any] = {}
    matched, fed_back = {"matching": "assignment"}, {"feedback": True}
    own = (matched, plain) if later else (plain, matched)
    shared = (fed_back, {**fed_back, **matched})
    return (*shared, *own) if fusion.feedback else (*own, *shared)


def with_own_labels(scenario: Scenario, fusion: Fusion) -> str:
    """What keeps a target that sensors take up at different steps, under labels of their own."""
    found = [
        f"{name}: {value}"
        for name, value, given in (
            ("fusion.matching", "assignment", "assignment"),
            ("fusion.feedback", "true", True),
        )
        if accepted(scenario, {name: given})
    ]
    other = fusions_instead(scenario, fusion, by_views=False)
    return (f"; take {', or '.join(found)}" if found else "") + (other.replace("; take", ", or") if found else other)
