"""Figures of a network with a sensor that cannot but stand, sensors with names, and zones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Wedge

from evaluation.still_network import NAMES, POLYGON, STILL_NETWORK
from evaluation.synthetic import ACTIONS, make_plan, make_record, means_of
from vedette.cli.picture import scenario_figure
from vedette.cli.show import sample_truth
from vedette.control.plan import Plan, RewardTable
from vedette.errors import InputError
from vedette.evaluation import compare
from vedette.evaluation.figures import (
    build_scene,
    mean_rewards_figure,
    overview_figure,
    reward_figure,
    roses_figure,
    save_figure,
    tracks_figure,
)
from vedette.evaluation.figures.scene import draw_zones
from vedette.evaluation.figures.style import COLOURS, colour, sensor_styles
from vedette.evaluation.runs import run_scenario
from vedette.platforms import Actions
from vedette.recorded import Origin
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.overrides import replace_fields
from vedette.scenarios.zones import HOLE, NO_GO, Zone
from vedette.simulation.records import RunRecord

SECTOR = {"kind": "limited_sector", "probability": 0.9, "max_range": 700.0, "half_width_deg": 60.0}
STILL = Actions((), np.empty((1, 0)))


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return replace_fields(load_scenario("paper-a"), STILL_NETWORK)


@pytest.fixture(scope="module")
def records(scenario: Scenario) -> dict[str, list[RunRecord]]:
    return {
        name: [run_scenario(scenario, name, seed=3, run=run, num_threads=1) for run in (0, 1)]
        for name in ("jdm", "idm")
    }


def texts(figure: Figure) -> set[str]:
    """Everything that is written in legends and axes."""
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
    written = [text.get_text() for legend in legends if legend is not None for text in legend.get_texts()]
    return {*written, *(axes.get_xlabel() for axes in figure.axes), *(axes.get_ylabel() for axes in figure.axes)}


def test_rewards_are_of_the_sensors_that_have_a_choice(
    scenario: Scenario, records: dict[str, list[RunRecord]], tmp_path: Path
) -> None:
    joint = mean_rewards_figure(means_of(records["jdm"]), build_scene(scenario, "jdm"))
    maps = [axes for axes in joint.axes if axes.get_title().endswith(" s")]
    assert [np.asarray(axes.collections[0].get_array()).size for axes in maps] == [13 * 13] * 2
    assert {"Heading of Boat Anna (deg)", "Heading of Boat Bertha (deg)"} <= texts(joint)
    alone = mean_rewards_figure(means_of(records["idm"]), build_scene(scenario, "idm"))
    assert {*NAMES[1:]} <= texts(alone)
    assert not {NAMES[0], "sensor 1"} & texts(alone)
    assert [axes.get_xlabel() for axes in alone.axes] == ["Heading (deg)"] * 2
    for number, figure in enumerate((joint, alone)):  # what is not allowed is left blank, without a warning
        save_figure(figure, tmp_path / str(number))


def test_rewards_have_their_name_in_the_title(scenario: Scenario, records: dict[str, list[RunRecord]]) -> None:
    upper, lower, bar = reward_figure(records["jdm"][0].decisions[0].plan, scene=build_scene(scenario, "jdm")).axes
    assert upper.get_xlabel() == "Heading of Boat Anna (deg)"
    assert lower.get_ylabel() == "Largest joint reward\n(minus expected loss)"
    assert bar.get_ylabel() == "Joint reward\n(minus expected loss)"
    assert build_scene(load_scenario("paper-a"), "jdm").reward == "CS divergence"
    plain = reward_figure(make_plan("idm", np.random.default_rng(1)))
    assert plain.axes[0].get_ylabel() == "Reward"


def test_a_strategy_with_a_custom_reward_shows_its_name(scenario: Scenario) -> None:
    named = {
        "planners": {"by-gospa": {"kind": "joint", "reward": {"kind": "expected_gospa"}}, "as-is": {"kind": "joint"}}
    }
    own = replace_fields(scenario, named)
    rewards = {name: build_scene(own, name).reward for name in ("by-gospa", "as-is", "jdm")}
    assert rewards == {
        "by-gospa": "minus squared GOSPA, m²",
        "as-is": "minus expected loss",
        "jdm": "minus expected loss",
    }


def test_roses_leave_out_sensors_that_cannot_move(scenario: Scenario, records: dict[str, list[RunRecord]]) -> None:
    figure = roses_figure(compare(records), build_scene(scenario, "jdm"))
    assert {axes.name for axes in figure.axes} == {"polar"}
    assert [text.get_text() for text in figure.legends[0].get_texts()] == list(NAMES[1:])


def test_decisions_without_a_choice_are_rejected() -> None:
    plan = replace(make_plan("idm", np.random.default_rng(1)), actions=(STILL, STILL), chosen=(0, 0))
    plan = replace(plan, tables=tuple(RewardTable((sensor,), np.zeros(1), np.zeros(1)) for sensor in (0, 1)))
    record = make_record("idm")
    still = replace(record, decisions=tuple(replace(each, plan=plan) for each in record.decisions))
    for draw in (
        lambda: reward_figure(plan),
        lambda: mean_rewards_figure(means_of([still])),
        lambda: roses_figure(compare({"idm": [still]})),
    ):
        with pytest.raises(InputError, match="expected a sensor with a choice"):
            draw()


def test_a_single_sensor_with_a_choice_has_a_curve() -> None:
    plan = make_plan("jdm", np.random.default_rng(1))
    table = RewardTable((0, 1), plan.tables[0].mean[:1], plan.tables[0].standard_error[:1])
    plan = replace(plan, actions=(STILL, ACTIONS), chosen=(0, plan.chosen[1]), tables=(table,))
    (axes,) = reward_figure(plan).axes
    np.testing.assert_allclose(np.asarray(axes.lines[0].get_ydata()), table.mean[0])


def test_zones_and_names_are_drawn(scenario: Scenario, records: dict[str, list[RunRecord]]) -> None:
    tracks = tracks_figure(records["jdm"][0], scene=build_scene(scenario, "jdm"))
    picture = scenario_figure(scenario, sample_truth(scenario))
    for figure in (tracks, picture):
        (axes,) = figure.axes
        drawn = [patch for patch in axes.patches if isinstance(patch, PathPatch)]
        assert len(drawn) == 3
        assert [patch.get_hatch() for patch in drawn] == [None, "////", None]
        np.testing.assert_allclose(np.asarray(drawn[1].get_path().vertices)[:4], np.array(POLYGON))
        (low, high), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        assert all(low < x < high and bottom < y < top for x, y in POLYGON)
        assert {text.get_text() for text in axes.texts} >= set(NAMES)
        assert {"region", "no-go zone", "sensors stay inside"} <= texts(figure)


def test_a_hole_is_cut_out_whichever_way_round_it_is_given() -> None:
    outer, hole = (((-a, -a), (a, -a), (a, a), (-a, a)) for a in (9.0, 3.0))
    for corners in (outer, outer[::-1]):
        for inner in (hole, hole[::-1]):
            figure = Figure(figsize=(2.0, 2.0), dpi=100)
            axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(-10.0, 10.0), ylim=(-10.0, 10.0))
            draw_zones(axes, (Zone(NO_GO, corners), Zone(HOLE, inner)), 1.0)
            canvas = FigureCanvasAgg(figure)
            canvas.draw()
            dark = np.asarray(canvas.buffer_rgba())[:, :, 0] < 200
            assert not dark[75:125, 75:125].any()
            assert dark[20:60, 20:180].mean() > 0.05


def test_fields_and_degrees_are_drawn() -> None:
    changes = {"origin": {"lon": -1.2, "lat": 50.7}, "sensors.*.detection": SECTOR}
    scene = replace_fields(load_scenario("paper-a"), changes)
    record = run_scenario(scene, "stationary", seed=0)
    figure = tracks_figure(record, scene=build_scene(scene, "stationary"))
    (axes,) = figure.axes
    wedges = [patch for patch in axes.patches if isinstance(patch, Wedge)]
    assert [wedge.r for wedge in wedges] == [700.0, 700.0]
    for wedge, pose in zip(wedges, record.poses[0], strict=True):
        np.testing.assert_allclose(wedge.center, pose[:2])
        np.testing.assert_allclose((wedge.theta1 + wedge.theta2) / 2.0, np.degrees(pose[2]))
    figure.draw_without_rendering()
    east, north = axes.child_axes
    origin = Origin(-1.2, 50.7)
    middle = np.mean([axes.get_xlim(), axes.get_ylim()], axis=1)
    low, high = (origin.to_degrees([[x, middle[1]]])[0, 0] for x in axes.get_xlim())
    np.testing.assert_allclose(east.get_xlim(), (low, high), atol=1e-6)
    low, high = (origin.to_degrees([[middle[0], y]])[0, 1] for y in axes.get_ylim())
    np.testing.assert_allclose(north.get_ylim(), (low, high), atol=1e-6)
    assert (east.get_xlabel(), north.get_ylabel()) == ("longitude (\N{DEGREE SIGN})", "latitude (\N{DEGREE SIGN})")


def test_a_colour_has_one_meaning_in_the_error_figure(scenario: Scenario, records: dict[str, list[RunRecord]]) -> None:
    comparison = compare(records)
    figure = overview_figure(records["idm"][0], comparison, strategy="idm", scene=build_scene(scenario, "idm"))
    left, right, *_ = figure.axes
    of_strategies = {str(line.get_label()): line.get_color() for line in right.lines}
    assert (of_strategies["JDM"], of_strategies["IDM"]) == (colour(0), colour(1))
    coloured = {line.get_color() for line in left.lines if line.get_color() in COLOURS}
    assert coloured == {colour(1)}
    assert left.get_title() == "IDM, run 0"
    with pytest.raises(InputError, match="strategy: expected one of jdm, idm; got 'random'"):
        overview_figure(records["idm"][0], comparison, strategy="random")


def test_sensors_have_other_colours_than_strategies() -> None:
    assert not {shade for shade, _, _ in sensor_styles(range(6)).values()} & {colour(place) for place in range(6)}
    of_sensors = {shade for shade, _, _ in sensor_styles([0, 1, 2]).values()}
    assert not of_sensors & {colour(0), colour(1), colour(2)}
    assert sensor_styles([1, 2])[1] == sensor_styles([0, 1, 2])[1]
    assert len({shade for shade, _, _ in sensor_styles([3, 9, 15, 21, 27, 33]).values()}) == 6


def many_sensors(planner: str, number: int = 40) -> RunRecord:
    """A run of many sensors, of which the later ones have the more at stake."""
    record = make_record("idm")
    tables = tuple(
        RewardTable((sensor,), sensor * np.cos(np.linspace(0.0, 3.0, len(ACTIONS))), np.zeros(len(ACTIONS)))
        for sensor in range(number)
    )
    plan = Plan(planner, (ACTIONS,) * number, tuple(sensor % 5 for sensor in range(number)), tables, {"samples": 1})
    poses = np.tile(record.poses[:, :1], (1, number, 1)) + 30.0 * np.arange(number)[:, None]
    decisions = tuple(replace(each, plan=plan, poses=poses[each.step - 1]) for each in record.decisions)
    return replace(record, poses=poses, decisions=decisions)


def within(figure: Figure) -> bool:
    """Whether every legend lies inside the figure."""
    FigureCanvasAgg(figure).draw()
    boxes = [
        legend.get_window_extent()
        for legend in [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
        if legend
    ]
    return all(
        box.x0 >= 0 and box.y0 >= 0 and box.x1 <= figure.bbox.width and box.y1 <= figure.bbox.height for box in boxes
    )


def test_sensors_with_the_largest_reward_range_are_drawn_and_legends_fit() -> None:
    record = many_sensors("idm")
    rewards = mean_rewards_figure(means_of([record]))
    assert [text.get_text() for text in rewards.legends[0].get_texts()] == [f"sensor {n}" for n in range(35, 41)]
    roses = roses_figure(compare({"idm": [record]}))
    assert [text.get_text() for text in roses.legends[0].get_texts()] == ["40 sensors, taken together"]
    # Of 40 sensors eight chose each of five headings.
    bars: list[Any] = list(roses.axes[0].patches)
    np.testing.assert_allclose([bar.get_height() ** 2 for bar in bars], 0.2)
    tracks = tracks_figure(record)
    assert not tracks.axes[0].texts
    for figure in (rewards, roses, tracks, reward_figure(record.decisions[0].plan)):
        assert within(figure)


@pytest.mark.parametrize("letters", ["sensor", "W" * 20, "WWW"])
def test_legends_of_six_names_fit(letters: str) -> None:
    record = many_sensors("idm", 6)
    scene = replace(build_scene(load_scenario("paper-a"), "idm"), names=tuple(f"{letters}{n}" for n in range(6)))
    comparison = compare({"idm": [record], "W" * 30: [record], "M" * 30: [record]})
    for figure in (
        mean_rewards_figure(means_of([record]), scene),
        roses_figure(comparison, scene),
        tracks_figure(record, scene=scene),
        reward_figure(record.decisions[0].plan, scene=scene),
        overview_figure(record, comparison, strategy="idm", scene=scene),
    ):
        assert within(figure)
