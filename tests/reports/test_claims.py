from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evaluation.synthetic import make_record
from vedette.evaluation import Comparison
from vedette.evaluation.ensembles import ensemble_of
from vedette.evaluation.health import percent
from vedette.reports.claims import all_pairs, claim, claims


def comparison_of(*errors: list[float]) -> Comparison:
    """Strategies a, b, ... on one scan, with the given OSPA in each run."""
    names = tuple("abcde"[: len(errors)])
    scan = make_record("fixed", num_scans=1).outline()
    ensembles = [
        ensemble_of(
            (replace(scan, run=run, ospa=np.array([[total, total, 0.0]])), None) for run, total in enumerate(of)
        )
        for of in errors
    ]
    return Comparison(names, tuple(ensembles), 0.0, 2.0)


def test_a_clear_difference_is_claimed_with_its_interval_and_share() -> None:
    found = claim(comparison_of([1.0, 2.0, 3.0, 4.0], [2.0, 3.1, 3.9, 5.0]), "a", "b")
    assert found.verdict == "better"
    assert found.sentence == (
        "A has 1.00 m less mean OSPA than b (95 % confidence interval of the paired difference 0.87 to 1.13 m, "
        "4 paired runs), and is better in 100 % of the runs."
    )
    assert (found.difference, found.share_won) == ("+1.00 (+0.87 to +1.13)", "100 %")


def test_whole_states_have_no_unit() -> None:
    errors = [1.0, 2.0, 3.0, 4.0], [2.0, 3.1, 3.9, 5.0]
    there, back = (claim(replace(comparison_of(*of), unit=""), "a", "b") for of in (errors, errors[::-1]))
    assert (
        "1.00 less mean OSPA than b (95 % confidence interval of the paired difference 0.87 to 1.13, 4"
        in there.sentence
    )
    assert "1.00 more mean OSPA than b" in back.sentence
    untold = claim(replace(comparison_of([1.0, 2.0, 3.0, 4.0], [2.0, 1.0, 3.0, 4.5]), unit=""), "a", "b")
    assert "is 0.12, but its 95 % confidence interval" in untold.sentence
    assert claim(replace(comparison_of([1.0], [3.0]), unit=""), "a", "b").sentence.endswith("is 2.00 in it.")


def test_the_other_way_round_is_worse() -> None:
    found = claim(comparison_of([2.0, 3.1, 3.9, 5.0], [1.0, 2.0, 3.0, 4.0]), "a", "b")
    assert found.verdict == "worse"
    assert found.sentence.startswith(
        "A has 1.00 m more mean OSPA than b (95 % confidence interval of the paired differe"
    )
    assert "0.87 to 1.13 m" in found.sentence
    assert found.sentence.endswith("is better in 0 % of the runs only.")


def test_an_interval_that_holds_zero_tells_nothing_apart() -> None:
    found = claim(comparison_of([1.0, 2.0, 3.0, 4.0], [2.0, 1.0, 3.0, 4.5]), "a", "b")
    assert found.verdict == "untold"
    assert "A and b are not told apart" in found.sentence
    assert "\N{MINUS SIGN}1.23 to 1.48 m, holds 0 (4 paired runs)" in found.sentence
    assert "a is better in 50 % of the runs, equal in 25 %." in found.sentence


def test_equal_strategies_are_not_told_apart() -> None:
    assert claim(comparison_of([1.0, 2.0], [1.0, 2.0]), "a", "b").verdict == "untold"


def test_one_run_claims_nothing() -> None:
    found = claim(comparison_of([1.0], [3.0]), "a", "b")
    assert found.verdict == "unknown"
    assert "one run tells nothing apart" in found.sentence
    assert found.difference == "+2.00"


def test_the_first_is_compared_with_each_and_every_pair_is_listed() -> None:
    comparison = comparison_of([1.0, 2.0], [2.0, 3.0], [3.0, 5.0])
    assert [(each.first, each.second) for each in claims(comparison)] == [("a", "b"), ("a", "c")]
    assert [(each.first, each.second) for each in all_pairs(comparison)] == [("a", "b"), ("a", "c"), ("b", "c")]


def test_claims_that_stand_together_allow_for_their_number() -> None:
    errors = [[1.0, 2.0, 3.0, 4.0], [1.1, 3.0, 4.2, 4.8], [2.0, 3.1, 3.9, 5.0]]
    alone = claim(comparison_of(*errors), "a", "b")
    together = claims(comparison_of(*errors))
    assert (alone.verdict, [each.verdict for each in together]) == ("better", ["better", "better"])
    assert together[0].sentence.endswith("of the runs (p = 0.048 among 2 comparisons).")
    several = comparison_of(*errors, [1.2, 1.9, 3.2, 4.0], [1.0, 2.1, 2.9, 4.1])
    among_four = claims(several)[0]
    assert among_four.verdict == "untold"
    assert "among so many comparisons its 95 % confidence interval, 0.01 to 1.54 m, is no proof" in among_four.sentence


@pytest.mark.parametrize(
    ("share", "text"), [(0.0, "0 %"), (0.004, "<1 %"), (0.5, "50 %"), (0.996, ">99 %"), (1.0, "100 %")]
)
def test_no_share_but_all_is_all(share: float, text: str) -> None:
    assert percent(share) == text
