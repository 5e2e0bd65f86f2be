from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reports.examples import campaign_of, results_of
from vedette.reports.drawings import group_drawings, sweep_drawings
from vedette.reports.groups import axis_label, axis_unit, comparison_groups
from vedette.reports.saving import run_errors
from vedette.reports.tables import error_table


@pytest.mark.parametrize(
    ("axis", "label", "unit"),
    [
        ("sensors.*.clutter.rate", "clutter rate", ""),
        ("sensors.0.noise.sigma_range", "noise sigma range", "m"),
        ("sensors.*.platform.speed", "platform speed", "m/s"),
        ("control.horizon_period", "control horizon period", "s"),
        ("planner", "planner", ""),
        ("nothing.of.this", "of this", ""),
    ],
)
def test_axes_have_words_and_units(axis: str, label: str, unit: str) -> None:
    (cell,) = campaign_of(planners=["stationary"]).cells
    assert (axis_label(axis), axis_unit(cell, axis)) == (label, unit)


def test_runs_that_not_every_strategy_has_are_left_out_of_a_comparison(tmp_path: Path) -> None:
    campaign = campaign_of(planners=["constant", "stationary"], runs=3)
    (group,) = comparison_groups(results_of(tmp_path / "results", campaign, skipped={("stationary", 1)}))
    assert group.comparison is not None
    assert (group.comparison.strategies, group.comparison.num_runs) == (("constant", "stationary"), 2)
    assert [each.ensemble.runs.tolist() for each in group.strategies] == [[0, 2], [0, 2]]
    assert [each.num_finished for each in group.strategies] == [3, 2]
    assert [len(each.counted) for each in group.strategies] == [40, 40]
    assert group.strategies[1].record(2).run == 2
    assert {name: len(errors) for name, errors in run_errors(group).items()} == {"constant": 2, "stationary": 2}


def test_errors_have_their_tails_next_to_them(tmp_path: Path) -> None:
    (group,) = comparison_groups(
        results_of(tmp_path / "results", campaign_of(planners=["stationary", "random"], runs=3))
    )
    table = error_table(group)
    assert table is not None
    assert group.comparison is not None
    assert table.header[-3:] == ("Median run (m)", "Worst run (m)", "Runs that end with a lost target")
    for row, name in zip(table.rows, group.comparison.strategies, strict=True):
        means = group.comparison.run_means(name)
        lost = group.comparison.values(name, "num_missed")[:, group.comparison.counted][:, -1] > 0
        assert row[-3:] == (f"{np.median(means):.2f}", f"{means.max():.2f}", f"{100.0 * lost.mean():.0f} %")


def test_groups_are_named_by_differing_settings(tmp_path: Path) -> None:
    grid = {"sensors.*.clutter.rate": [5.0, 40.0], "sensors.*.noise.sigma_range": [10.0, 20.0]}
    campaign = campaign_of(planners=["stationary"], grid=grid, runs=1)
    groups = list(comparison_groups(results_of(tmp_path / "results", campaign)))
    titles = ["paper-a, noise sigma range 10", "paper-a, noise sigma range 20"]
    assert [group.title for group in groups] == titles
    assert len({group.name for group in groups}) == len(groups) == 2
    errors = {name: values for group in groups for name, values in run_errors(group).items()}
    sweeps = list(sweep_drawings(campaign, errors))
    assert [drawing.name for drawing in sweeps] == [
        "sweep-clutter-rate-1",
        "sweep-clutter-rate-2",
        "sweep-noise-sigma-range",
    ]
    assert sweeps[2].figure.axes[0].get_xlabel() == "Noise sigma range (m)"
    assert {drawing.name for drawing in group_drawings(groups[0])} >= {"ospa", "distributions", "cost", "consistency"}


@pytest.mark.parametrize(
    ("axis", "values", "names"),
    [("time.num_steps", [4, 6], ["4", "6"]), ("time.step_period", [1.0, 0.5], ["1", "0.5"])],
)
def test_strategies_with_other_scan_times_are_not_compared_and_drawn_each_over_its_own(
    axis: str, values: list[float], names: list[str], tmp_path: Path
) -> None:
    few = {"time.num_steps": 4, "control.decision_steps": [2], "ospa.first_scan": 3, "ospa.last_scan": 4}
    few.pop(axis, None)
    spec = {"planners": ["stationary"], "compare": axis, "grid": {axis: values}, "set": few, "runs": 1}
    (group,) = comparison_groups(results_of(tmp_path / "results", campaign_of(**spec)))
    assert group.comparison is None
    assert "its runs have others" in group.reason
    drawn = [each for each in group_drawings(group) if each.name.startswith("consistency")]
    assert [each.title.split()[-1] for each in drawn] == names
    for strategy, drawing in zip(group.strategies, drawn, strict=True):
        lines = drawing.figure.axes[0].get_lines()
        assert np.asarray(lines[0].get_xdata()).tolist() == strategy.ensemble.times.tolist()
