"""Fusions refuse what they cannot be made of or fuse, each by the name of the field."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from vedette.densities import LMB
from vedette.errors import InputError
from vedette.fusion import ArithmeticAverage, Clmb, CmDeltaGlmb, FusionLimits, Matched, ParallelUpdate, match_labels

EQUAL = (0.5, 0.5)
RULES: tuple[Callable[..., Any], ...] = (Clmb, CmDeltaGlmb, ArithmeticAverage, ParallelUpdate)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize(
    "weights", [0.5, "ab", ("a", 1.0), (None, 1.0), {0: 0.5, 1: 0.5}, (math.nan, 1.0), (1.5, -0.5), ()]
)
def test_weights(rule: Callable[..., Any], weights: Any) -> None:
    with pytest.raises(InputError, match="weights"):
        rule(weights)


@pytest.mark.parametrize("rule", RULES[:3])
def test_weights_that_are_none(rule: Callable[..., Any]) -> None:
    with pytest.raises(InputError, match=r"fusion weights: expected non-negative numbers that sum to 1, .*; got None"):
        rule(None)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize(
    "limits",
    [None, (), FusionLimits(max_components=0), FusionLimits(max_hypotheses=1.5), FusionLimits(max_combinations=None)],  # type: ignore[arg-type]
)
def test_limits(rule: Callable[..., Any], limits: Any) -> None:
    with pytest.raises(InputError, match=r"limits(\.max_\w+)?: expected"):
        rule(EQUAL, limits=limits)


@pytest.mark.parametrize("floor", [None, "a", 0.0, 1.0, -0.5, math.nan, np.zeros(2)])
def test_floors(floor: Any) -> None:
    for rule in (Clmb, ParallelUpdate):
        with pytest.raises(InputError, match="missing_existence: expected"):
            rule(EQUAL, missing_existence=floor)
    with pytest.raises(InputError, match="missing_log_weight: expected"):
        CmDeltaGlmb(EQUAL, missing_log_weight=0.0 if isinstance(floor, float) else floor)


def test_words_and_flags() -> None:
    for rule in (Clmb, CmDeltaGlmb):
        with pytest.raises(InputError, match="mixture_power: expected one of auto, "):
            rule(EQUAL, mixture_power=["auto"])  # type: ignore[arg-type]
    for weighing in (Clmb, ArithmeticAverage):
        with pytest.raises(InputError, match="by_views: expected true or false; got yes"):
            weighing(EQUAL, by_views="yes")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="rule: expected a Fusion; got None"):
        Matched(None)  # type: ignore[arg-type]
    for gate in (None, "a", 0.0, math.nan):
        with pytest.raises(InputError, match="gate_probability: expected"):
            Matched(Clmb(EQUAL), gate)  # type: ignore[arg-type]


@pytest.mark.parametrize("beliefs", [None, 3, "ab", {0: 1}, [None, None], [LMB.empty(4)], [LMB.empty(4), LMB.empty(5)]])
def test_beliefs(beliefs: Any) -> None:
    for rule in (Clmb(EQUAL), CmDeltaGlmb(EQUAL), ArithmeticAverage(EQUAL), Matched(Clmb(EQUAL))):
        with pytest.raises(InputError, match=r"beliefs(\[0\])?: expected"):
            rule.fuse(beliefs)
    if beliefs is None or isinstance(beliefs, int | str | dict):
        with pytest.raises(InputError, match="beliefs: expected"):
            match_labels(beliefs)  # type: ignore[arg-type]


def test_views_that_are_none() -> None:
    with pytest.raises(InputError, match="views: expected a Views; got bool"):
        Clmb(EQUAL, by_views=True).fuse([LMB.empty(4)] * 2, True)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"views\.prediction: expected the LMB or FactoredGLMB"):
        ParallelUpdate().fuse([LMB.empty(4)] * 2, True)  # type: ignore[arg-type]
