"""How sure decisions were, in words."""

from __future__ import annotations

import math
from dataclasses import replace

from evaluation.synthetic import make_record
from simulation.test_explained import explanation_of
from vedette.control import Bound, RunnerUp
from vedette.evaluation.certainty import certainty_lines


def test_the_closest_decision_and_the_bounds_are_told() -> None:
    record = make_record()
    assert certainty_lines(record) == []
    margins = ((0.5, 0.1), (0.25, 0.125), (0.75, None))
    bounds = (Bound(4.0, 4.0, "exhaustive"), Bound(5.0, 4.0, "by target"), Bound(math.inf, 4.0, "by target", 2))
    decisions = []
    for each, (margin, error), bound in zip(record.decisions, margins, bounds, strict=True):
        second = RunnerUp((0, 0), "sensor 1 with heading_deg 0", margin, error)
        why = explanation_of(each.plan, runner_up=second, bound=bound)
        decisions.append(replace(each, plan=replace(each.plan, explanation=why)))
    time = record.decisions[1].time
    assert certainty_lines(replace(record, decisions=tuple(decisions))) == [
        f"closest decision: at {time:g} s the second best is 0.25 less, 2 standard errors",
        "bounds: 1 of 3 joint decisions the best there is, 1 at most 20 % below it, 1 without bound",
    ]
    why = explanation_of(record.decisions[0].plan, runner_up=RunnerUp((0, 0), "", 0.0, 0.0), bound=None)
    first = replace(record.decisions[0], plan=replace(record.decisions[0].plan, explanation=why))
    (line,) = certainty_lines(replace(record, decisions=(first,)))
    assert line.endswith("the second best is as good")
