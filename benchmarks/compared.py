"""The filters that are compared with each other, and the time that their trackers take."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from vedette.models import SensorModel, TargetModel
from vedette.scenarios import Scenario, replace_fields
from vedette.scenarios.sections.tracking import Filter
from vedette.tracking import State, Tracker

Fields = dict[str, Any]  # of a scenario, by path


def compared(errors: Iterable[float]) -> dict[str, Fields]:
    """The filters by name, each as fields of a scenario; first the one that runs where nothing is said."""
    usual, of_scenes = Filter(), {"gaussian_method", "detection_at", "assignment", "limits"}
    names = [name for name in Filter.model_fields if name not in of_scenes]
    found: dict[str, Fields] = {"default": {f"filter.{name}": getattr(usual, name) for name in names}}
    found["LMB"] = {"filter.kind": "lmb"}
    for number in (1000, 20_000):
        found[f"delta-GLMB {number:,}"] = {"filter.kind": "delta_glmb", "filter.limits.max_hypotheses": number}
    found["M-delta-GLMB"] = {"filter.kind": "m_delta_glmb"}
    for error in errors:
        found[f"factored {error:g}"] = {"filter.kind": "factored_glmb", "filter.max_split_error": error}
    return found


def with_filter(scenario: Scenario, fields: Fields) -> Scenario:
    """The scenario under another filter, fused by the covariance intersection of its kind of density."""
    if scenario.model.estimates_by.kind == "map":
        fields = {"estimator": None, **fields}  # each filter's own
    kinds = ("clmb", "cm_delta_glmb")
    if scenario.model.fusion.kind in kinds:
        fields = {**fields, "fusion.kind": kinds[fields["filter.kind"] != "lmb"]}
    return replace_fields(scenario, fields)


@dataclass(frozen=True)
class Timed:
    """A tracker that adds up the CPU seconds of its steps."""

    inner: Tracker
    seconds: list[float]

    @property
    def targets(self) -> TargetModel:
        return self.inner.targets

    @property
    def sensors(self) -> tuple[SensorModel, ...]:
        return self.inner.sensors

    def initial(self) -> State:
        return self.inner.initial()

    def step(self, *arguments: Any, **options: Any) -> Any:
        start = time.process_time()
        found = self.inner.step(*arguments, **options)
        self.seconds.append(time.process_time() - start)
        return found
