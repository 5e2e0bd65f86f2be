from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from evaluation.synthetic import make_record, means_of
from vedette.errors import InputError
from vedette.evaluation import Comparison, average_nees, compare, summarise
from vedette.evaluation.figures import (
    SweepCurve,
    consistency_figure,
    cost_figure,
    distributions_figure,
    mean_rewards_figure,
    roses_figure,
    svg_text,
    sweep_figure,
    tracks_figure,
)
from vedette.evaluation.figures.style import legend_columns, shown_decisions
from vedette.kernels.base.types import Floats


def panels(figure: Figure) -> list[Any]:
    """Its axes, of which the tests look at more than their types say."""
    return list(figure.axes)


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return compare({name: [make_record(name, run) for run in range(6)] for name in ("jdm", "idm", "random")})


def test_every_run_is_a_dot_and_every_difference_has_its_interval(comparison: Comparison) -> None:
    upper, lower = panels(distributions_figure(comparison))
    assert [label.get_text() for label in upper.get_yticklabels()] == ["Random", "IDM", "JDM"]
    assert [label.get_text() for label in lower.get_yticklabels()] == [
        "Random \N{MINUS SIGN} JDM",
        "IDM \N{MINUS SIGN} JDM",
    ]
    np.testing.assert_array_equal(upper.lines[0].get_xdata(), comparison.run_means("jdm"))
    dots = next(line for line in lower.lines if len(line.get_xdata()) == 6)
    np.testing.assert_allclose(dots.get_xdata(), comparison.run_means("idm") - comparison.run_means("jdm"))
    summary = comparison.difference("idm").summary
    ends = [line.get_xdata() for line in lower.lines if len(line.get_xdata()) == 2]
    assert any(np.allclose(end, [summary.low, summary.high]) for end in ends)
    assert lower.get_xlabel() == "Paired difference (m), right of 0: JDM better"


def test_one_strategy_and_one_run_have_no_interval() -> None:
    (axes,) = panels(distributions_figure(compare({"jdm": [make_record("jdm", 0)]})))
    assert len(axes.lines[0].get_xdata()) == 1


def test_roses_have_areas_in_proportion_to_shares(comparison: Comparison) -> None:
    roses = panels(roses_figure(comparison))
    assert len(roses) == 9
    assert [axes.get_title() for axes in roses[:3]] == [f"{time:g} s" for time in comparison.decision_times]
    first = [dict(run[0][0])["heading_deg"] for run in comparison.ensembles[0].choices]
    bars = roses[0].containers[0]
    areas = sorted(bar.get_height() ** 2 for bar in bars)
    np.testing.assert_allclose(areas, sorted(np.unique(np.array(first) % 360, return_counts=True)[1] / 6))


def test_roses_need_decisions(comparison: Comparison) -> None:
    still = replace(comparison, ensembles=tuple(replace(each, choices=((),) * 6) for each in comparison.ensembles))
    with pytest.raises(InputError, match="expected decisions; got none"):
        roses_figure(still)


def test_mean_rewards_are_curves_or_maps_a_decision() -> None:
    curves = mean_rewards_figure(means_of([make_record("idm", run) for run in range(3)]))
    assert [axes.get_title() for axes in curves.axes] == ["10 s", "20 s", "30 s"]
    assert [len(axes.lines) for axes in curves.axes] == [2, 2, 2]
    records = [make_record("jdm", run) for run in range(3)]
    maps = mean_rewards_figure(means_of(records))
    mesh, marks = panels(maps)[0].collections
    expected = np.mean([record.decisions[0].plan.tables[0].mean for record in records], axis=0)
    np.testing.assert_allclose(np.asarray(mesh.get_array()).ravel(), expected.T.ravel())
    assert marks.get_sizes().sum() == pytest.approx(60.0)
    assert "<image" not in svg_text(maps)


def test_mean_rewards_need_decisions() -> None:
    with pytest.raises(InputError, match="got none"):
        mean_rewards_figure([])


def test_a_sweep_has_a_curve_a_strategy_with_confidence_intervals() -> None:
    rng = np.random.default_rng(3)
    values = np.array([25.0, 5.0, 100.0])
    curves = [SweepCurve(name, values, tuple(summarise(rng.normal(v, 3.0, 9)) for v in values)) for name in ("a", "b")]
    (axes,) = panels(sweep_figure(curves, "Clutter rate"))
    assert (axes.get_xscale(), axes.get_xlabel()) == ("log", "Clutter rate")
    assert [label.get_text() for label in axes.get_xticklabels()] == ["5", "25", "100"]
    container = axes.containers[0]
    np.testing.assert_allclose(container[0].get_ydata(), [float(curves[0].errors[i].mean) for i in (1, 0, 2)])
    low = container[2][0].get_segments()[0][0][1]
    assert low == pytest.approx(float(curves[0].errors[1].low))
    with pytest.raises(InputError, match="at least one"):
        sweep_figure([], "")


def test_cost_is_a_median_with_a_range() -> None:
    seconds: dict[str, dict[str, Floats]] = {
        "jdm": {"filter": np.arange(1.0, 101.0), "planning": np.ones(3)},
        "constant": {"filter": np.full(4, 0.5)},
    }
    (axes,) = panels(cost_figure(seconds))
    np.testing.assert_allclose(axes.lines[0].get_xdata(), [50.5e3, 1e3])
    np.testing.assert_allclose(axes.collections[0].get_segments()[0][:, 0], [5.95e3, 95.05e3])
    with pytest.raises(InputError, match="at least one stage"):
        cost_figure({"jdm": {}})


def test_consistency_is_drawn_against_its_interval() -> None:
    average = average_nees(np.full((5, 4), 2.0), np.full((5, 4), 3), dim=2)
    (axes,) = panels(consistency_figure(np.arange(4.0), {"jdm": average}))
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), 1.0)
    heights = axes.collections[0].get_paths()[0].vertices[:, 1]
    assert heights.min() == pytest.approx(average.lower[0] / 2.0)
    assert heights.max() == pytest.approx(average.upper[0] / 2.0)
    with pytest.raises(InputError, match="at least one strategy"):
        consistency_figure(np.arange(4.0), {})


def test_of_many_decisions_the_first_the_last_and_some_between_are_shown() -> None:
    assert shown_decisions(3) == (0, 1, 2)
    assert shown_decisions(26) == (0, 5, 10, 15, 20, 25)


def test_long_names_get_a_line_of_the_legend_each() -> None:
    assert legend_columns(["JDM", "IDM", "Random"]) == 3
    assert legend_columns(["a name of a strategy that is rather long"] * 3) == 1


@pytest.mark.parametrize("shift", [0.0, 150.0, 400.0])
def test_the_title_over_equal_axes_lies_within_the_figure(shift: float) -> None:
    record = make_record()
    figure = tracks_figure(replace(record, poses=record.poses - [shift, 0.0, 0.0]))
    FigureCanvasAgg(figure).draw()
    assert figure.axes[0].title.get_window_extent().y1 < figure.bbox.height


def test_estimates_whose_labels_never_recur_have_one_colour() -> None:
    record = make_record()
    anew = tuple(
        replace(estimate, labels=np.c_[np.full(estimate.num_targets, scan), np.arange(estimate.num_targets)])
        for scan, estimate in enumerate(record.estimates)
    )
    figure = tracks_figure(replace(record, estimates=anew))
    total = sum(estimate.num_targets for estimate in anew)
    assert any(len(line.get_xdata()) == total for line in panels(figure)[0].lines)
    assert "estimates" in {text.get_text() for text in figure.legends[0].get_texts()}
