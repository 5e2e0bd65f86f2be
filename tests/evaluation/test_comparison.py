from __future__ import annotations

import csv
import io
from dataclasses import replace

import numpy as np
import pytest

from evaluation.synthetic import make_record
from scripts import load
from vedette.errors import InputError
from vedette.evaluation import Comparison, compare, decision_rows, holm, strategy_csv, strategy_markdown, strategy_rows
from vedette.evaluation.tables import header, significance, strategy_latex
from vedette.evaluation.tail_summary import TailSummary, summarise_tail, tail_sentence
from vedette.simulation.records import RunRecord

NUM_RUNS = 6
STRATEGIES = ("jdm", "idm", "random", "constant")


@pytest.fixture(scope="module")
def runs() -> dict[str, list[RunRecord]]:
    return {name: [make_record(name, run) for run in range(NUM_RUNS)] for name in STRATEGIES}


@pytest.fixture(scope="module")
def comparison(runs: dict[str, list[RunRecord]]) -> Comparison:
    return compare(runs)


def test_means_are_taken_after_the_first_decision(comparison: Comparison, runs: dict[str, list[RunRecord]]) -> None:
    np.testing.assert_array_equal(comparison.decision_times, [10.0, 20.0, 30.0])
    assert comparison.since == 10.0
    np.testing.assert_array_equal(comparison.times[comparison.counted], np.arange(11.0, 41.0))
    expected = [record.ospa[10:, 1].mean() for record in runs["idm"]]
    np.testing.assert_allclose(comparison.run_means("idm", "localisation"), expected)


def test_the_start_of_the_time_window_can_be_set(runs: dict[str, list[RunRecord]]) -> None:
    np.testing.assert_allclose(
        compare(runs, since=30.0).run_means("jdm"), [record.ospa[30:, 0].mean() for record in runs["jdm"]]
    )


def test_without_decisions_every_scan_counts(runs: dict[str, list[RunRecord]]) -> None:
    assert compare({"constant": runs["constant"]}).counted.all()


def test_differences_are_to_the_first_strategy_by_default(comparison: Comparison) -> None:
    against_first = comparison.difference("random").summary.mean
    assert float(against_first) == pytest.approx(
        float(comparison.summary("random").mean - comparison.summary("jdm").mean)
    )
    assert float(comparison.difference("random", "random").summary.mean) == 0.0
    assert comparison.difference("random").win_rate == 1.0


def of_these(comparison: Comparison, *places: int) -> Comparison:
    """The comparison with the runs of the strategies at these places."""
    return replace(comparison, ensembles=tuple(comparison.ensembles[place] for place in places))


def test_significance_is_corrected_for_the_number_of_strategies(comparison: Comparison) -> None:
    alone = [comparison.difference(name).p_value for name in STRATEGIES[1:]]
    np.testing.assert_array_equal(comparison.p_values(), [np.nan, *holm(np.array(alone))])
    assert significance(comparison) == "Significant at 5 % (Holm correction): random, constant; not significant: idm."
    alike = of_these(comparison, 0, 2, 3, 0)
    assert significance(alike) == "Significant at 5 % (Holm correction): idm, random; not significant: constant."
    assert (
        significance(of_these(comparison, 0, 2, 3, 3)) == "All 3 differences are significant at 5 % (Holm correction)."
    )
    assert significance(of_these(comparison, 0, 0, 0, 0)) == "No difference is significant at 5 % (Holm correction)."
    two = replace(of_these(comparison, 0, 2), strategies=("a", "b"))
    assert significance(two) == "The difference is significant at 5 %."
    assert significance(replace(of_these(comparison, 0), strategies=("a",))) == ""


def test_latex_has_the_table_with_its_letters_escaped(comparison: Comparison) -> None:
    names = ("a_b & 50%", "x^2", r"\input{y}", "$#~")
    lines = strategy_latex(replace(comparison, strategies=names)).splitlines()
    rows = [line for line in lines if line.endswith(r"\\")]
    assert rows[1].startswith(r"a\_b \& 50\% & ")
    assert rows[2].startswith(r"x\textasciicircum{}2 & ")
    assert rows[3].startswith(r"\textbackslash{}input\{y\} & ")
    assert rows[4].startswith(r"\$\#\textasciitilde{} & ")
    assert {row.replace(r"\&", "").count("&") for row in rows} == {6}
    assert r"$\pm$" in rows[1]
    assert (lines[0], lines[-1]) == (r"\begin{table}", r"\end{table}")


def test_decision_shares_add_up(comparison: Comparison) -> None:
    shares = comparison.decision_shares("jdm", 0)
    assert sum(shares.values()) == pytest.approx(1.0)
    assert list(shares.values()) == sorted(shares.values(), reverse=True)
    assert all(len(headings) == 2 for headings in shares)
    assert comparison.decision_shares("constant", 0) == {}


def test_runs_that_are_not_paired_are_refused(runs: dict[str, list[RunRecord]]) -> None:
    cases = {
        "expected 6 runs": runs["idm"][1:],
        "expected scenario, seed and run": runs["idm"][::-1],
        "scan times": [replace(record, times=record.times + 1.0) for record in runs["idm"]],
    }
    for message, records in cases.items():
        with pytest.raises(InputError, match=message):
            compare({"jdm": runs["jdm"], "idm": records})


@pytest.mark.parametrize("empty", [{}, {"jdm": []}])
def test_no_runs_are_refused(empty: dict[str, list[RunRecord]]) -> None:
    with pytest.raises(InputError, match="at least one run"):
        compare(empty)


def test_an_empty_time_window_is_rejected(runs: dict[str, list[RunRecord]]) -> None:
    with pytest.raises(InputError, match=r"scans after it and up to until, of 1\.0 to 40\.0 s; got 40\.0"):
        compare(runs, since=40.0)


def test_unknown_strategy_is_named(comparison: Comparison) -> None:
    with pytest.raises(InputError, match="expected one of jdm, idm, random, constant; got 'greedy'"):
        comparison.summary("greedy")


def test_table_has_a_row_a_strategy(comparison: Comparison) -> None:
    rows = strategy_rows(comparison)
    assert [row[0] for row in rows] == list(STRATEGIES)
    assert all(len(row) == len(header(comparison)) for row in rows)
    assert rows[0][4:] == ("", "", "")
    assert rows[2][4].startswith("+")
    assert rows[2][6] == "100%"


def test_whole_states_have_no_unit_in_the_table(runs: dict[str, list[RunRecord]]) -> None:
    assert header(compare(runs))[1:5] == ("OSPA (m)", "Localisation (m)", "Cardinality (m)", "Difference (m)")
    plain = compare(runs, unit="")
    assert header(plain)[1:5] == ("OSPA", "Localisation", "Cardinality", "Difference")
    assert "(m)" not in strategy_markdown(plain)


def test_table_of_a_single_run_claims_no_error(runs: dict[str, list[RunRecord]]) -> None:
    rows = strategy_rows(compare({name: runs[name][:1] for name in STRATEGIES}))
    assert "±" not in "".join(rows[1])
    assert tail_sentence(compare({name: runs[name][:1] for name in STRATEGIES})) == ""
    assert rows[1][5] == "unknown"


def test_markdown_is_a_table_with_a_caption(comparison: Comparison) -> None:
    lines = strategy_markdown(comparison).splitlines()
    table = [line for line in lines if line.startswith("|")]
    assert len(table) == 2 + len(STRATEGIES)
    assert len({line.count("|") for line in table}) == 1
    assert "6 paired runs, mean OSPA over t = 11 to 40 s" in lines[-2]
    assert lines[-1] == tail_sentence(comparison)


def test_tails_are_shown_next_to_means(comparison: Comparison) -> None:
    means = comparison.run_means("jdm")
    assert tail_sentence(comparison).startswith(
        f"Median and worst run (m): jdm {np.median(means):.2f}, {means.max():.2f}; idm"
    )
    lost = np.zeros((6, len(comparison.times)))
    lost[2, -1] = lost[3, 0] = lost[4, -1] = 2.0
    ensembles = tuple(replace(own, measures={"num_missed": lost}) for own in comparison.ensembles)
    told = tail_sentence(replace(comparison, ensembles=ensembles))
    assert told.startswith("Median and worst run (m), share of runs that end with a lost target: jdm ")
    assert told.count(", 33 %") == len(STRATEGIES)
    numbers = next(csv.DictReader(io.StringIO(strategy_csv(replace(comparison, ensembles=ensembles)))))
    assert (float(numbers["median_m"]), float(numbers["worst_m"])) == (np.median(means), means.max())
    assert float(numbers["share_lost"]) == 2 / 6


def test_tail_summary_ignores_unknown_runs() -> None:
    assert summarise_tail([3.0, np.nan, 1.0, 8.0], [1.0, 0.0, 0.0, 1.0]) == TailSummary(3.0, 8.0, 0.5)
    assert summarise_tail([3.0, 1.0]).cells() == ("2.00", "3.00", "")
    assert summarise_tail([np.nan]).cells() == ("", "", "")


def test_benchmarks_show_tails_next_to_means() -> None:
    deciding, defaults, lookahead = (load(f"benchmarks/{name}.py") for name in ("deciding", "defaults", "lookahead"))
    ospa, ends_lost = [2.0, 3.0, 9.0, 4.0], [0.0, 0.0, 1.0, 0.0]
    scores = {run: deciding.Score(own, 0.0, 1.0, np.nan, ends_lost[run]) for run, own in enumerate(ospa)}
    ahead = np.column_stack([ospa, ospa, np.ones(4), ends_lost])
    tables = [
        defaults.table("scene", [defaults.Row("scene", "default", *[ospa, ends_lost, *[ospa] * 4])]),
        deciding.table({deciding.FIRST: scores}),
        lookahead.table("scene", {"depth 1": ahead}, "depth 1"),
    ]
    for lines in map(list, tables):
        [header] = [
            line for line in lines if "Median run (m) | Worst run (m) | Runs that end with a lost target" in line
        ]
        [row] = [line for line in lines if "| 3.50 | 9.00 | 25 % |" in line]
        assert header.count("|") == row.count("|")


def test_csv_holds_the_unrounded_numbers(comparison: Comparison) -> None:
    rows = list(csv.DictReader(io.StringIO(strategy_csv(comparison))))
    assert float(rows[1]["ospa_mean_m"]) == float(comparison.summary("idm").mean)
    assert float(rows[3]["win_rate"]) == comparison.difference("constant").win_rate


def test_csv_has_no_name_that_a_spreadsheet_takes_for_a_formula(runs: dict[str, list[RunRecord]]) -> None:
    compared = compare({"=1+1": runs["jdm"], "idm": runs["idm"]})
    rows = list(csv.DictReader(io.StringIO(strategy_csv({"@group": compared}))))
    assert [(row["group"], row["strategy"]) for row in rows] == [("'@group", "'=1+1"), ("'@group", "idm")]
    assert float(rows[1]["difference_m"]) == float(compared.difference("idm").summary.mean)


def test_decision_rows_skip_strategies_without_decisions(comparison: Comparison) -> None:
    rows = decision_rows(comparison, "idm", at_most=1)
    assert [time for time, _ in rows] == ["10 s", "20 s", "30 s"]
    assert all(text.endswith("%") and "°" in text for _, text in rows)
    assert decision_rows(comparison, "constant") == []
