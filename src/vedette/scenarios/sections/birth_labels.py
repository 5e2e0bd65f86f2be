"""Labels of births in a scenario that no scan has confirmed yet; see `vedette.internal.cut_births`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from vedette.internal.cut_births import MAX_CUT_SHARE, cut_share
from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.fusion import SINGLE_BELIEF_FUSIONS

if TYPE_CHECKING:
    from vedette.kernels.base.types import Floats
    from vedette.scenarios.sections.fields import ScenarioFields

CAPPED = ("delta_glmb", "m_delta_glmb")


def max_label_sets(model: ScenarioFields) -> int | None:
    """Return the cap on label sets of a filter that enumerates them, if births have a period; None without a cap."""
    birth, section = model.birth, model.filter
    if section.kind == "custom" or section.kind not in CAPPED:
        return None
    if birth.period is None or not birth.sites or model.recording is not None:
        return None
    return int(section.limits.max_hypotheses)


def birth_probabilities(model: ScenarioFields) -> Floats:
    """Return the probability of a birth at each site within a step, shape (num_sites,)."""
    steps = model.time.step_period / (model.birth.period or model.time.step_period)
    return -np.expm1(steps * np.log1p([-site.existence for site in model.birth.sites]))


def birth_steps(model: ScenarioFields) -> int:
    """Return the largest number of steps with births from one scan of a belief to its next."""
    num, steps = model.time.num_steps, model.birth.steps
    births = np.ones(num) if steps == "every" else np.isin(np.arange(1, num + 1), steps)
    scans = np.array([sensor.scans.build(model.time) for sensor in model.sensors])
    beliefs = [np.logical_or.reduce(scans)] if has_one_belief(model) else scans
    longest = 0
    for each in beliefs:
        ends = np.concatenate([[0], np.flatnonzero(each) + 1, [num]])
        longest = max(longest, int(np.diff(np.concatenate([[0.0], np.cumsum(births)])[ends]).max()))
    return longest


def has_one_belief(model: ScenarioFields) -> bool:
    """Return True if all scans update one belief."""
    return model.fusion.kind in SINGLE_BELIEF_FUSIONS


def labels_until_detection(model: ScenarioFields, chances: Floats) -> Floats:
    """Return the mean number of unconfirmed labels of each site if a scan detects its targets with these chances."""
    most = model.time.num_steps if model.birth.steps == "every" else len(model.birth.steps)
    steps = birth_steps(model) / np.maximum(chances, 1e-9)
    return np.minimum(steps, most)


def births_cut(model: ScenarioFields) -> Iterator[Finding]:
    """Yield a fault if a filter cuts its own births between scans, regardless of detections."""
    most = max_label_sets(model)
    if most is None:
        return
    steps, sites = birth_steps(model), len(model.birth.sites)
    share = cut_share(steps * sites, float(birth_probabilities(model).mean()), most)
    if share > MAX_CUT_SHARE:
        wanted = (
            f"factored_glmb or lmb (or births at fewer birth.steps, or a longer time.step_period), as {steps} steps "
            f"with births from one scan to the next make {steps * sites} labels, and {most} hypotheses cut "
            f"{100.0 * share:.0f} % of the expected births"
        )
        yield ("filter", "kind"), wanted, describe(model.filter.kind)
