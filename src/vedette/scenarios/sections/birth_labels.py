"""Labels of births that no scan has confirmed yet, and the share of births that a cap on hypotheses cuts.

A delta-GLMB makes a label for each birth site at each step. Until a scan confirms or rejects them, every set of these
labels is a hypothesis. `birth.period` keeps the expected number of births the same for steps of any length, but shorter
steps make more labels, and the cap on hypotheses cuts their larger sets.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.fusion import SINGLE_BELIEF_FUSIONS

if TYPE_CHECKING:
    from vedette.kernels.base.types import Floats
    from vedette.scenarios.sections.scenario import ScenarioModel

# Share of the expected births above which a scenario is refused, or causes a warning.
MAX_CUT_SHARE = 0.05
CAPPED = ("delta_glmb", "m_delta_glmb")


def cut_share(num_labels: float, probability: float, max_sets: int) -> float:
    """Return the share of the expected births that is cut if the `max_sets` heaviest sets of labels are retained.

    For n labels of probability q each, the sets of k labels have the probability q^k (1 - q)^(n - k). Small sets are
    the heaviest, and the retained ones are normalised.

    Args:
        num_labels: number of unconfirmed labels, at least 0.
        probability: of each, in (0, 0.5); for larger ones the result is 0.
        max_sets: number of hypotheses retained.
    """
    n, expected = math.floor(num_labels), math.floor(num_labels) * probability
    if n == 0 or probability >= 0.5:
        return 0.0
    remaining, total, births = float(max_sets), 0.0, 0.0
    for k in range(min(n, math.ceil(expected + 10.0 * math.sqrt(expected) + 20.0)) + 1):
        log_sets = math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)
        num_sets = min(math.exp(min(log_sets, 700.0)), remaining)
        weight = num_sets * math.exp(
            k * math.log(probability / (1.0 - probability))
        )  # relative to the set without births
        remaining, total, births = remaining - num_sets, total + weight, births + k * weight
        if remaining <= 0.5:
            break
    return max(0.0, 1.0 - births / total / expected)


def max_label_sets(model: ScenarioModel) -> int | None:
    """Return the cap on label sets of a filter that enumerates them, if births have a period; None without a cap."""
    birth, section = model.birth, model.filter
    if section.kind == "custom" or section.kind not in CAPPED:
        return None
    if birth.period is None or not birth.sites or model.recording is not None:
        return None
    return int(section.limits.max_hypotheses)


def birth_probability(model: ScenarioModel) -> float:
    """Return the mean probability of a birth at a site within a step."""
    steps = model.time.step_period / (model.birth.period or model.time.step_period)
    return float(np.mean([-math.expm1(steps * math.log1p(-site.existence)) for site in model.birth.sites]))


def birth_steps(model: ScenarioModel) -> int:
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


def has_one_belief(model: ScenarioModel) -> bool:
    """Return True if all scans update one belief."""
    return model.fusion.kind in SINGLE_BELIEF_FUSIONS


def labels_until_detection(model: ScenarioModel, chances: Floats) -> float:
    """Return the mean number of unconfirmed labels if a target of each site is detected with these probabilities."""
    most = model.time.num_steps if model.birth.steps == "every" else len(model.birth.steps)
    steps = birth_steps(model) / np.maximum(chances, 1e-9)
    return float(np.minimum(steps, most).sum())


def births_cut(model: ScenarioModel) -> Iterator[Finding]:
    """Yield a fault if a filter cuts its own births between scans, regardless of detections."""
    most = max_label_sets(model)
    if most is None:
        return
    steps, sites = birth_steps(model), len(model.birth.sites)
    share = cut_share(steps * sites, birth_probability(model), most)
    if share > MAX_CUT_SHARE:
        wanted = (
            f"factored_glmb or lmb (or births at fewer birth.steps, or a longer time.step_period), as {steps} steps "
            f"with births from one scan to the next make {steps * sites} labels, and {most} hypotheses cut "
            f"{100.0 * share:.0f} % of the expected births"
        )
        yield ("filter", "kind"), wanted, describe(model.filter.kind)
