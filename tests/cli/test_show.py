"""`vedette show`: tables that fit the terminal, a picture with everything in it."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from typer.testing import CliRunner, Result

from scenarios.minimal import changed
from vedette.cli import app
from vedette.cli.picture import scenario_figure
from vedette.cli.show import sample_truth
from vedette.scenarios import list_builtin, load_scenario, parse_scenario
from vedette.scenarios.wording import scans_in_words


def show(*words: str, columns: int = 80) -> Result:
    return CliRunner().invoke(app, ["show", *words], env={"COLUMNS": str(columns)})


@pytest.mark.parametrize("name", list_builtin())
@pytest.mark.parametrize("columns", [60, 100])
def test_the_tables_fit_the_terminal(name: str, columns: int) -> None:
    result = show(name, columns=columns)
    assert (result.exit_code, result.stderr) == (0, "")
    assert max(len(line) for line in result.stdout.splitlines()) <= columns
    assert "\u2026" not in result.stdout
    assert result.stdout.startswith(name)


def test_the_tables_have_the_numbers() -> None:
    text = show("paper-a").stdout
    for line in (
        "scans 40, every 1 s from 1 to 40 s",
        "sensor 1 -745 830 0 heading",
        "decisions after scans 10, 20, 30",
        "sensors move from the first decision on",
        "clutter region, rate 25",
        "2 1 40 -180 -205 -5.5 -19.0",
    ):
        assert line in [" ".join(row.split()) for row in text.splitlines()]


def test_eight_mobile_is_described_in_words() -> None:
    lines = [" ".join(row.split()) for row in show("eight-mobile", columns=120).stdout.splitlines()]
    for line in (
        "decisions after every scan but the last (99)",
        "objective expected loss (cutoff 100 m, order 1; no sampling)",
        "search coordinate ascent, 2 restarts",
        "platform steps of 15 m at 15 m/s in 8 directions, or stay",
        "noise constant, std x 2 m, y 2 m",
    ):
        assert line in lines


@pytest.mark.parametrize(
    ("steps", "words"),
    [
        ((1, 2, 3), "every scan but the last (3)"),
        ((1, 2, 3, 4), "every scan (4)"),
        ((2,), "scan 2"),
        ((1, 4), "scans 1, 4"),
        (tuple(range(2, 200, 3)), "every 3rd scan from 2 to 197 (66)"),
        ((1, 2, 4, 9, 11), "5 scans from 1 to 11"),
    ],
)
def test_the_scans_of_decisions_are_summarised(steps: tuple[int, ...], words: str) -> None:
    assert scans_in_words(steps, 4) == words


def test_sensors_that_differ_are_each_described(tmp_path: Path) -> None:
    file = tmp_path / "two.yaml"
    other = "measurement: {kind: range_only}, noise: {kind: range_dependent}"
    file.write_text(changed(("heading_deg: 4.0", other)), encoding="utf-8")
    text = show(str(file)).stdout
    assert "north: measures" in text
    assert "south: measures" in text


def test_resolved_prints_yaml_that_reads_back() -> None:
    result = show("paper-e", "--with-defaults")
    assert parse_scenario(result.stdout) == load_scenario("paper-e").model


@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_a_picture_is_written_where_it_is_wanted(ending: str, tmp_path: Path) -> None:
    out = tmp_path / "deep" / f"picture.{ending}"
    result = show("linear-10", "--out", str(out))
    assert result.exit_code == 0
    assert result.stdout.endswith(f"wrote {out}\n")
    assert [file.name for file in out.parent.iterdir()] == [out.name]
    if ending == "png":
        assert matplotlib.image.imread(out).std() > 0.05


def test_a_picture_of_another_format_is_wrong_use(tmp_path: Path) -> None:
    result = show("paper-a", "--out", str(tmp_path / "picture.gif"))
    assert (result.exit_code, result.stdout) == (2, "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", list_builtin())
def test_the_picture_has_every_track_sensor_and_site(name: str) -> None:
    scenario = load_scenario(name)
    truth = sample_truth(scenario)
    (axes,) = scenario_figure(scenario, truth).axes
    markers = [line.get_marker() for line in axes.lines]
    num_targets = len(np.unique(truth.ids))
    assert (markers.count("o"), markers.count("^")) == (num_targets, num_targets)
    assert markers.count("s") == len(scenario.model.sensors)
    assert markers.count("+") == len(scenario.model.birth.sites)
    unit = "km" if name in ("polar-10", "solent", "solent-patrol", "shore-radar", "three-radars") else "m"
    assert (axes.get_xlabel(), axes.get_ylabel()) == (f"x ({unit})", f"y ({unit})")


def test_an_unknown_scenario_is_reported_without_a_traceback() -> None:
    result = show("paper-b")
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr.startswith(
        "paper-b: no such file; expected a YAML file or one of beyond-the-gap, crowd, eight-mobile, linear-10"
    )


def test_a_faulty_scenario_is_reported_without_a_traceback(tmp_path: Path) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(changed(("sigma_v: 1.0", "sigma_v: quick")), encoding="utf-8")
    result = show(str(file))
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr == f'{file}:4:44: motion.sigma_v: expected a number, got "quick"\n'


def test_zones_biases_and_late_scans_are_described_briefly() -> None:
    lines = " ".join(show("solent-patrol").stdout.split())
    assert "constraint keep out, polygon of 21 corners" in lines
    assert "constraint stay inside, x -3000 to 3000 m, y -3000 to 3000 m" in lines
    assert "boat 2: late probability 0.8, max delay 30 s, start 600 s, end 1200 s" in lines
    assert "origin lon -1.1171 deg, lat 50.7865 deg" in lines
    assert "process noise 0.15 m/s^1.5, noise model continuous white" in lines
