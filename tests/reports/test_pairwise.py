from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evaluation.synthetic import make_record
from vedette.evaluation import Comparison
from vedette.evaluation.ensembles import build_ensemble
from vedette.evaluation.health import percent
from vedette.reports.pairwise import PairwiseComparison, all_pairs, compare_with_first


def comparison_of(*errors: list[float]) -> Comparison:
    """Strategies a, b, ... on one scan, with the given OSPA in each run."""
    names = tuple("abcde"[: len(errors)])
    scan = make_record("constant", num_scans=1).summary()
    ensembles = [
        build_ensemble(
            (replace(scan, run=run, ospa=np.array([[total, total, 0.0]])), None) for run, total in enumerate(of)
        )
        for of in errors
    ]
    return Comparison(names, tuple(ensembles), 0.0, 2.0)


def only_pair(comparison: Comparison) -> PairwiseComparison:
    """The comparison of a with b, where there are no others."""
    (found,) = compare_with_first(comparison)
    return found


def test_a_clear_difference_is_claimed_with_its_interval_and_share() -> None:
    found = only_pair(comparison_of([1.0, 2.0, 3.0, 4.0], [2.0, 3.1, 3.9, 5.0]))
    assert found.verdict == "better"
    assert found.sentence == (
        "A has a smaller mean OSPA than b, by 1.00 m (95 % interval 0.87 to 1.13 m, 4 paired runs). "
        "It is smaller in 100 % of the runs."
    )
    assert (found.difference, found.win_rate) == ("+1.00 (+0.87 to +1.13)", "100 %")


def test_whole_states_have_no_unit() -> None:
    errors = [1.0, 2.0, 3.0, 4.0], [2.0, 3.1, 3.9, 5.0]
    there, back = (only_pair(replace(comparison_of(*of), unit="")) for of in (errors, errors[::-1]))
    assert "than b, by 1.00 (95 % interval 0.87 to 1.13, 4" in there.sentence
    assert "larger mean OSPA than b, by 1.00 (" in back.sentence
    unclear = only_pair(replace(comparison_of([1.0, 2.0, 3.0, 4.0], [2.0, 1.0, 3.0, 4.5]), unit=""))
    assert "B minus a: 0.12 (95 % interval" in unclear.sentence.replace("b minus", "B minus")
    assert "b minus a: 2.00 in mean OSPA" in only_pair(replace(comparison_of([1.0], [3.0]), unit="")).sentence


def test_the_other_way_round_is_worse() -> None:
    found = only_pair(comparison_of([2.0, 3.1, 3.9, 5.0], [1.0, 2.0, 3.0, 4.0]))
    assert found.verdict == "worse"
    assert found.sentence.startswith("A has a larger mean OSPA than b, by 1.00 m (95 % interval 0.87 to 1.13 m, ")
    assert found.sentence.endswith("It is smaller in only 0 % of the runs.")


def test_an_interval_that_holds_zero_tells_nothing_apart() -> None:
    found = only_pair(comparison_of([1.0, 2.0, 3.0, 4.0], [2.0, 1.0, 3.0, 4.5]))
    assert found.verdict == "unclear"
    assert found.sentence.startswith("A and b do not differ significantly in mean OSPA. ")
    assert "(95 % interval \N{MINUS SIGN}1.23 to 1.48 m, 4 paired runs)" in found.sentence
    assert "a is smaller in 50 % of the runs, equal in 25 %." in found.sentence


def test_equal_strategies_do_not_differ() -> None:
    assert only_pair(comparison_of([1.0, 2.0], [1.0, 2.0])).verdict == "unclear"


def test_one_run_has_no_significance() -> None:
    found = only_pair(comparison_of([1.0], [3.0]))
    assert found.verdict == "unknown"
    assert found.sentence.startswith("One run proves nothing. ")
    assert found.difference == "+2.00"


def test_the_first_is_compared_with_each_and_every_pair_is_listed() -> None:
    comparison = comparison_of([1.0, 2.0], [2.0, 3.0], [3.0, 5.0])
    assert [(each.first, each.second) for each in compare_with_first(comparison)] == [("a", "b"), ("a", "c")]
    assert [(each.first, each.second) for each in all_pairs(comparison)] == [("a", "b"), ("a", "c"), ("b", "c")]


def test_claims_that_stand_together_allow_for_their_number() -> None:
    errors = [[1.0, 2.0, 3.0, 4.0], [1.1, 3.0, 4.2, 4.8], [2.0, 3.1, 3.9, 5.0]]
    alone = only_pair(comparison_of(*errors[:2]))
    together = compare_with_first(comparison_of(*errors))
    assert (alone.verdict, [each.verdict for each in together]) == ("better", ["better", "better"])
    assert together[0].sentence.endswith("of the runs (p = 0.048 among 2 comparisons).")
    several = comparison_of(*errors, [1.2, 1.9, 3.2, 4.0], [1.0, 2.1, 2.9, 4.1])
    among_four = compare_with_first(several)[0]
    assert among_four.verdict == "unclear"
    assert "(95 % interval 0.01 to 1.54 m, 4 paired runs)" in among_four.sentence


@pytest.mark.parametrize(
    ("share", "text"), [(0.0, "0 %"), (0.004, "<1 %"), (0.5, "50 %"), (0.996, ">99 %"), (1.0, "100 %")]
)
def test_no_share_but_all_is_all(share: float, text: str) -> None:
    assert percent(share) == text
