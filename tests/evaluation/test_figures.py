from __future__ import annotations

import errno
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import matplotlib
import matplotlib.style
import numpy as np
import pytest
import scipy.stats
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from evaluation.synthetic import DEGREES, make_plan, make_record
from vedette.control.plan import Plan
from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.evaluation import Comparison, compare
from vedette.evaluation.figures import (
    Scene,
    cost_figure,
    differences_figure,
    distributions_figure,
    ospa_figure,
    overview_figure,
    reward_figure,
    roses_figure,
    save_figure,
    svg_text,
    tracks_figure,
)
from vedette.evaluation.figures.style import COLOURS
from vedette.platforms import Actions


def labels(figure: Figure) -> list[tuple[str, str]]:
    return [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes]


def plan(kind: str, num_sensors: int = 2) -> Plan:
    return make_plan(kind, np.random.default_rng(5), num_sensors)


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return compare({name: [make_record(name, run) for run in range(4)] for name in ("jdm", "idm", "random")})


def test_tracks_show_every_target_label_and_sensor_on_equal_axes() -> None:
    record = make_record()
    (axes,) = tracks_figure(record).axes
    assert labels(axes.figure) == [("x (m)", "y (m)")]  # type: ignore[arg-type]
    assert axes.get_aspect() == 1.0
    assert np.ptp(axes.get_xlim()) == pytest.approx(np.ptp(axes.get_ylim()))
    longest = sorted(len(line.get_xdata()) for line in axes.lines)[-2:]  # type: ignore[arg-type]
    assert longest == [record.num_scans] * 2
    assert {text.get_text() for text in axes.texts} >= {"sensor 1", "sensor 2", "1", "2", "3"}


def test_tracks_of_two_runs_share_their_axes() -> None:
    left, right = tracks_figure(make_record("idm"), make_record("jdm")).axes
    assert (left.get_title(), right.get_title()) == ("IDM", "JDM")
    assert left.get_xlim() == right.get_xlim()


def test_tracks_of_a_large_region_are_in_kilometres() -> None:
    record = make_record("constant")
    truth = replace(record.truth, states=record.truth.states * 20.0)
    assert labels(tracks_figure(replace(record, truth=truth))) == [("x (km)", "y (km)")]


def test_tracks_without_any_target_or_estimate_can_be_drawn(tmp_path: Path) -> None:
    record = make_record("constant")
    none = replace(record.truth, offsets=np.zeros(41, np.int64), ids=np.empty(0, np.int64), states=np.empty((0, 4)))
    nothing = Estimate(np.empty((0, 2), np.int64), np.empty((0, 4)), np.empty((0, 4, 4)), np.empty(0))
    save_figure(
        tracks_figure(replace(record, truth=none, estimates=(nothing,) * 40)), tmp_path / "none", formats=("png",)
    )


def test_tracks_refuse_no_run_and_other_numbers_of_titles() -> None:
    with pytest.raises(InputError, match="at least one run"):
        tracks_figure()
    with pytest.raises(InputError, match="titles: expected 1; got 2"):
        tracks_figure(make_record(), titles=("a", "b"))


def test_independent_rewards_are_one_curve_a_sensor_in_degrees() -> None:
    decision = plan("idm")
    (axes,) = reward_figure(decision, scene=Scene(reward="CS divergence")).axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Heading (deg)", "Reward\n(CS divergence)")
    curve = axes.lines[0]
    np.testing.assert_allclose(curve.get_xdata(), DEGREES)  # type: ignore[arg-type]
    np.testing.assert_allclose(curve.get_ydata(), decision.tables[0].mean)  # type: ignore[arg-type]
    assert curve.get_markevery() == [decision.chosen[0]]
    assert len(axes.collections) == 2  # the bands


def test_curves_run_from_west_to_west_whatever_the_order_of_the_actions() -> None:
    decision = plan("idm")
    turned = np.roll(DEGREES[:12], 5)
    table = replace(decision.tables[0], mean=decision.tables[0].mean[:12], standard_error=np.zeros(12))
    decision = replace(
        decision, actions=(Actions(("heading_deg",), turned[:, np.newaxis]),) * 2, chosen=(3, 3), tables=(table,)
    )
    curve = reward_figure(decision).axes[0].lines[0]
    headings = np.asarray(curve.get_xdata())
    np.testing.assert_allclose(headings, DEGREES[:12])
    (marked,) = curve.get_markevery()  # type: ignore[misc]
    assert headings[marked] == pytest.approx(turned[3])


def test_joint_rewards_are_a_heat_map_with_the_choice_framed_and_the_best_over_the_others() -> None:
    decision = plan("jdm")
    upper, lower, bar = reward_figure(decision, scene=Scene(reward="CS divergence")).axes
    np.testing.assert_array_equal(upper.images[0].get_array(), decision.tables[0].mean.T)
    frames = [patch.get_xy() for patch in upper.patches if isinstance(patch, Rectangle)]
    assert frames == [(decision.chosen[0] - 0.5, decision.chosen[1] - 0.5)] * 2
    np.testing.assert_allclose(lower.lines[0].get_ydata(), decision.tables[0].mean.max(axis=1))  # type: ignore[arg-type]
    assert bar.get_ylabel() == "Joint reward\n(CS divergence)"


def test_heat_map_of_any_pair_of_three_sensors() -> None:
    decision = plan("jdm", 3)
    joint = decision.tables[0].mean
    for pair, expected in {(0, 1): joint.max(axis=2).T, (2, 0): joint.max(axis=1)}.items():
        upper = reward_figure(decision, pair=pair).axes[0]
        np.testing.assert_array_equal(upper.images[0].get_array(), expected)
        assert upper.get_xlabel() == f"Heading of sensor {pair[0] + 1} (deg)"


def test_entries_that_a_search_did_not_evaluate_are_blank() -> None:
    decision = plan("jdm", 3)
    gaps = np.ones(decision.tables[0].mean.shape, bool)
    gaps[decision.chosen[0], :, decision.chosen[2]] = False
    gaps[:, decision.chosen[1], decision.chosen[2]] = False
    mean, error = (
        np.where(gaps, np.nan, values) for values in (decision.tables[0].mean, decision.tables[0].standard_error)
    )
    decision = replace(decision, tables=(replace(decision.tables[0], mean=mean, standard_error=error),))
    upper, lower, _ = reward_figure(decision).axes
    np.testing.assert_array_equal(upper.images[0].get_array(), mean[:, :, decision.chosen[2]].T)
    line = np.asarray(lower.lines[0].get_ydata())
    np.testing.assert_array_equal(line, np.nanmax(mean, axis=(1, 2)))
    assert np.isfinite(lower.lines[2].get_ydata()).all()
    third = np.asarray(lower.lines[4].get_ydata())
    np.testing.assert_array_equal(np.isfinite(third), np.arange(len(third)) == decision.chosen[2])


@pytest.mark.parametrize("pair", [(0, 0), (0, 2), (-1, 0)])
def test_heat_map_rejects_an_invalid_pair(pair: tuple[int, int]) -> None:
    with pytest.raises(InputError, match="pair: expected two of the sensors"):
        reward_figure(plan("jdm"), pair=pair)


def test_random_control_has_no_rewards_to_draw() -> None:
    with pytest.raises(InputError, match="'random' weighs no actions"):
        reward_figure(plan("random"))


def test_ospa_has_a_curve_and_a_band_a_strategy_and_marks_decisions(comparison: Comparison) -> None:
    (axes,) = ospa_figure(comparison).axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Time (s)", "OSPA (m)")
    assert [str(line.get_label()) for line in axes.lines[:4]] == ["JDM", "IDM", "Random", "decision"]
    np.testing.assert_allclose(axes.lines[1].get_ydata(), comparison.curve("idm").mean)  # type: ignore[arg-type]
    assert len(axes.collections) == 3
    assert axes.get_ylim()[0] == 0.0


def test_differences_are_drawn_from_the_first_decision_on_with_their_intervals(
    comparison: Comparison,
) -> None:
    above, below = differences_figure(comparison).axes
    assert below.get_xlabel() == "Time (s)"
    assert (above.get_ylabel(), below.get_ylabel()) == ("OSPA (m)", "minus JDM (m)")
    assert below.get_xlim()[0] == comparison.decision_times[0]
    idm = np.asarray(below.lines[1].get_ydata())
    shown = comparison.times >= comparison.decision_times[0]
    apart = comparison.values("idm")[:, shown] - comparison.values("jdm")[:, shown]
    np.testing.assert_allclose(idm, apart.mean(axis=0))
    (band, *_) = below.collections
    low, high = (np.asarray(each) for each in scipy.stats.ttest_1samp(apart, 0.0).confidence_interval(0.95))
    corners = np.asarray(band.get_paths()[0].vertices)[:, 1]
    assert (corners.min(), corners.max()) == pytest.approx((low.min(), high.max()))
    spread = [comparison.curve(name) for name in comparison.strategies]
    assert above.get_ylim()[1] >= max((curve.mean + curve.standard_error)[shown].max() for curve in spread)
    with pytest.raises(InputError, match="comparison: expected two strategies and runs or more; got 3 and 1"):
        differences_figure(compare({name: [make_record(name)] for name in comparison.strategies}))


def test_the_style_is_available_for_custom_figures() -> None:
    with matplotlib.style.context("vedette.paper"):
        assert matplotlib.rcParams["font.size"] == 8.0
        colours = matplotlib.rcParams["axes.prop_cycle"].by_key()["color"]
    assert [f"#{each.lstrip('#')}" for each in colours] == list(COLOURS)


def test_overview_shows_a_run_next_to_the_errors(comparison: Comparison) -> None:
    left, right, above = overview_figure(make_record(), comparison).axes
    assert left.get_title() == "JDM, run 0"
    assert (left.get_ylabel(), right.get_ylabel(), above.get_ylabel()) == ("y (m)", "OSPA (m) minus JDM", "OSPA (m)")
    assert right.get_xlim()[0] == comparison.decision_times[0]


def test_ospa_parts_are_panels(comparison: Comparison) -> None:
    figure = ospa_figure(comparison, parts=("total", "localisation", "cardinality"))
    assert [axes.get_ylabel() for axes in figure.axes] == ["OSPA (m)", "Localisation (m)", "Cardinality (m)"]
    with pytest.raises(InputError, match="parts: expected some of"):
        ospa_figure(comparison, parts=("cost",))


def test_saving_gives_vector_and_raster_files_and_the_same_bytes_again(tmp_path: Path) -> None:
    first = save_figure(reward_figure(plan("jdm")), tmp_path / "a" / "figure")
    again = save_figure(reward_figure(plan("jdm")), tmp_path / "b" / "figure")
    assert [path.suffix for path in first] == [".pdf", ".svg", ".png"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in again]
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == ["figure.pdf", "figure.png", "figure.svg"]
    assert b"<text" in first[1].read_bytes()


def test_saving_refuses_unknown_formats_and_places(tmp_path: Path) -> None:
    figure = reward_figure(plan("idm"))
    with pytest.raises(InputError, match="expected some of pdf, svg, png; got gif"):
        save_figure(figure, tmp_path / "figure", formats=("gif",))
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"file/figure\.pdf: expected a file that can be written"):
        save_figure(figure, tmp_path / "file" / "figure")


def test_a_full_disk_is_reported_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    for name in ("pdf", "png"):
        with pytest.raises(InputError, match=rf"figure\.{name}: expected a file that can be written; No space left"):
            save_figure(reward_figure(plan("idm")), tmp_path / "figure", formats=(name,))
    assert not list(tmp_path.iterdir())


def test_global_settings_are_left_alone() -> None:
    before = dict(matplotlib.rcParams)
    reward_figure(plan("idm"))
    assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize("kind", [ospa_figure, differences_figure, distributions_figure, roses_figure])
def test_any_name_can_be_drawn_without_a_warning(
    kind: Callable[[Comparison], Figure], comparison: Comparison, tmp_path: Path
) -> None:
    names = ("\u00fc \u6f22\u5b57 \U0001f642", "_$x_1$ $\\frac$ " + "long " * 40, "w" * 200)
    figure = kind(replace(comparison, strategies=names))
    save_figure(figure, tmp_path / "figure")
    text = svg_text(figure)
    assert "$x_1$" in text
    assert "w" * 30 not in text


def test_equal_curves_share_a_line_with_dashes_of_each_colour(comparison: Comparison) -> None:
    first, second, *others = comparison.ensembles
    ospa = second.ospa.copy()
    ospa[:, :20] = first.ospa[:, :20]
    shared_start = (first, replace(second, ospa=ospa), *others)
    (axes,) = ospa_figure(replace(comparison, ensembles=shared_start)).axes
    jdm, idm, random = (np.asarray(line.get_ydata()) for line in axes.lines[:3])
    np.testing.assert_array_equal(np.isnan(jdm), np.arange(len(jdm)) < 19)
    np.testing.assert_array_equal(np.isnan(idm), np.isnan(jdm))
    assert np.isfinite(random).all()
    shared = axes.lines[3:5]
    assert {line.get_color() for line in shared} == {line.get_color() for line in axes.lines[:2]}
    for line in shared:
        np.testing.assert_array_equal(np.isfinite(np.asarray(line.get_ydata())), np.arange(len(jdm)) < 20)


def test_few_values_have_no_tails() -> None:
    def reach(number: int) -> float:
        (axes,) = cost_figure({"jdm": {"planning": np.arange(1.0, number + 1.0)}}).axes
        (line,) = axes.collections[0].get_paths()
        return float(np.ptp(np.asarray(line.vertices)[:, 0]))

    assert reach(19) == 0.0
    assert reach(20) > 0.0


@pytest.mark.parametrize("times", [(3e-4, 6e-4), (3e-4,), (1e-6, 2e-3), (1e-4, 3e-3)])
def test_labels_of_times_do_not_overlap(times: tuple[float, ...]) -> None:
    figure = cost_figure({"jdm": {f"stage {i}": np.array([time]) for i, time in enumerate(times)}})
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    (axes,) = figure.axes
    low, high = axes.get_xlim()
    ticks = [*axes.get_xticklabels(), *axes.get_xticklabels(minor=True)]
    shown = [tick for tick in ticks if tick.get_text() and low <= tick.get_position()[0] <= high]
    boxes = sorted((tick.get_window_extent(canvas.get_renderer()) for tick in shown), key=lambda box: box.x0)
    assert len(boxes) >= 3
    assert all(left.x1 < right.x0 for left, right in pairwise(boxes))


def test_no_display_and_no_pyplot_is_needed() -> None:
    code = "import sys, vedette.evaluation.figures; assert 'matplotlib.pyplot' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
