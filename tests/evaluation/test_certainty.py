"""The certainty of a decision in words."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from evaluation.synthetic import make_record
from simulation.test_explanation_tables import explanation_of
from vedette.control import Bound, RunnerUp
from vedette.evaluation.actions import lead_words, optimality_words


@pytest.mark.parametrize(
    ("margin", "error", "words"),
    [(0.25, 0.125, "0.25 (2 std. errors)"), (0.75, None, "0.75"), (0.5, 0.0, "0.5"), (0.0, 0.1, "0 (0 std. errors)")],
)
def test_the_lead_over_the_runner_up(margin: float, error: float | None, words: str) -> None:
    plan = make_record().decisions[0].plan
    assert lead_words(plan) == optimality_words(plan) == ""
    second = RunnerUp((0, 0), "sensor 1 with heading_deg 0", margin, error)
    assert lead_words(replace(plan, explanation=explanation_of(plan, runner_up=second, bound=None))) == words


@pytest.mark.parametrize(
    ("bound", "words"),
    [
        (Bound(4.0, 4.0, "exhaustive"), "yes"),
        (Bound(5.0, 4.0, "by target"), "within 20 %"),
        (Bound(5.1, 4.0, "relaxed"), "not known"),
        (Bound(math.inf, 4.0, "by target", 2), "not known"),
        (None, ""),
    ],
)
def test_how_far_a_decision_may_be_from_the_best(bound: Bound | None, words: str) -> None:
    plan = make_record().decisions[0].plan
    assert optimality_words(replace(plan, explanation=explanation_of(plan, runner_up=None, bound=bound))) == words
