"""The campaigns that come with the library, and what is published of their scenes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from campaigns.filled import NUM_RUNS, fill, make_campaign
from vedette.campaigns import load_spec, open_results, resolve
from vedette.campaigns.published import published_comparisons, published_markdown
from vedette.campaigns.scores import (
    StrategyScore,
    score_header,
    score_markdown,
    score_row,
    score_strategies,
)
from vedette.campaigns.spec import builtin_specs
from vedette.scenarios.sections.tracking import Filter

PUBLISHED = StrategyScore("published: X", 1.734, 0.31, None, None, -0.1, None, 111.1, 10)


def test_every_campaign_that_comes_with_the_library_is_a_yardstick_of_its_own_name() -> None:
    known = published_comparisons()
    assert sorted(known) == list(builtin_specs())
    for name, yardstick in known.items():
        assert yardstick.spec == load_spec(name)
        assert (yardstick.spec.name, yardstick.spec.runs) == (name, 30)
        assert bool(yardstick.source) == bool(yardstick.published)


@pytest.mark.parametrize("name", [name for name in builtin_specs() if name != "paper-a"])
def test_they_resolve_to_decisions_after_every_scan_but_the_last(name: str) -> None:
    campaign = resolve(load_spec(name))
    assert campaign.compare == "planner"
    for cell in campaign.cells:
        model = cell.scenario.model
        assert model.decision_steps == tuple(range(1, model.time.num_steps))
        assert model.ospa.first_scan == 1
        slow = name.endswith("-slow")
        assert model.motion.model_dump()["sigma_v"] == (3.0 if slow else 15.0)
        assert isinstance(model.filter, Filter)
        assert model.filter.limits.min_existence == (0.05 if slow else 0.25)
    assert len(campaign.groups()) == (4 if name.endswith("-slow") else 1)


def test_published_figures_are_those_of_the_source() -> None:
    found = {
        name: {score.label.removeprefix("published: "): (score.ospa, score.num_runs) for score in yardstick.published}
        for name, yardstick in published_comparisons().items()
    }
    assert found["deciding-eight-mobile"]["FDCD"] == (1.73, 10)
    assert found["deciding-eight-mobile"]["constant"] == (68.58, 10)
    assert found["deciding-six-cameras"]["FDCD"] == (3.39, 30)
    assert found["deciding-six-cameras"]["constant"] == (60.36, 30)
    for yardstick in published_comparisons().values():
        means = [score.ospa for score in yardstick.published]
        assert means == sorted(means)
        assert all(score.worst is not None and score.worst > score.ospa for score in yardstick.published)


def test_scores_are_those_of_the_runs(tmp_path: Path) -> None:
    results = open_results(fill(tmp_path, make_campaign()))
    for group in results.comparisons():
        scores = score_strategies(group)
        assert [score.label for score in scores] == ["jdm", "random"]
        runs = {cell.planner: [results.run(cell.name, run) for run in range(NUM_RUNS)] for cell in group.cells}
        counted = group.comparison.counted
        means = {name: np.array([run.record.ospa[counted, 0].mean() for run in of]) for name, of in runs.items()}
        for score in scores:
            mine = means[score.label]
            assert score.num_runs == NUM_RUNS
            assert score.ospa == pytest.approx(mine.mean())
            assert score.standard_error == pytest.approx(mine.std(ddof=1) / np.sqrt(NUM_RUNS))
            assert score.worst == pytest.approx(mine.max())
            spent = np.concatenate(
                [
                    run.record.timings["planning"][[decision.step - 1 for decision in run.record.decisions]]
                    for run in runs[score.label]
                ]
            )
            assert len(spent) == sum(len(run.record.decisions) for run in runs[score.label])
            assert score.decision_seconds == pytest.approx(np.median(spent))
        assert scores[0].difference is None
        assert scores[1].difference is not None
        assert float(scores[1].difference.mean) == pytest.approx((means["random"] - means["jdm"]).mean())


def test_what_is_not_known_is_left_empty() -> None:
    assert score_row(PUBLISHED) == ("published: X", "1.73 ± 0.31", "", "", "\N{MINUS SIGN}0.10", "", "111", "10")
    one = StrategyScore("constant", 2.0, None, 2.0, None, 0.0, 0.5, 1e-5, 1)
    assert score_row(one) == ("constant", "2.00", "2.00", "", "+0.00", "50.0 %", "<0.0001", "1")
    assert score_markdown((PUBLISHED,), "m", "jdm").splitlines() == [
        "| Strategy | OSPA (m) | Worst run (m) | More than jdm (m) | N error | Tracked | s a decision | Runs |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
        "| published: X | 1.73 ± 0.31 |  |  | \N{MINUS SIGN}0.10 |  | 111 | 10 |",
    ]
    assert score_header("", "jdm")[1] == "OSPA"


def test_the_page_of_a_yardstick_has_a_table_for_each_setting_and_its_sources(tmp_path: Path) -> None:
    results = open_results(fill(tmp_path, make_campaign()))
    yardstick = published_comparisons()["deciding-eight-mobile"]
    page = published_markdown(results, yardstick)
    assert page.startswith(f"# {yardstick.title}\n\n## sensors.*.clutter.rate 5.0\n\n| Strategy |")
    assert page.count("| published: FDCD |") == 2
    assert page.count("\nMedian and worst run (m), share of runs that end with a lost target: ") == 2
    assert page.endswith(f"Published: {yardstick.source}.\n\n{yardstick.remark}\n")
