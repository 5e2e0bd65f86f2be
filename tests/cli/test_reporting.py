"""`vedette report`: a page, figures, chosen runs, and errors that say what is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from reports.examples import campaign_of, results_of
from vedette.cli import app


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cli") / "results"
    results_of(folder, campaign_of(planners=["constant", "stationary"]))
    return folder


def report(*words: object) -> Result:
    return CliRunner().invoke(app, ["report", *map(str, words)])


def test_the_page_and_the_figures_are_written_where_they_should_be(folder: Path, tmp_path: Path) -> None:
    page, figures = tmp_path / "page.html", tmp_path / "figures"
    result = report(folder, "--out", page, "--figures", figures)
    assert result.exit_code == 0, result.output
    names = sorted(path.name for path in figures.iterdir())
    assert f"wrote {page}" in result.stdout
    assert f"wrote {len(names)} files to {figures}" in result.stdout
    for stem in ("ospa", "distributions", "decisions", "cost", "consistency", "tracks-constant"):
        assert {f"{stem}.pdf", f"{stem}.png", f"{stem}.svg"} <= set(names)
    assert "Fixed, run" in page.read_text("utf-8")


def test_the_page_is_in_the_folder_by_default_and_shows_the_chosen_runs(folder: Path) -> None:
    result = report(folder, "--runs", "stationary:1, constant:0")
    assert result.exit_code == 0, result.output
    page = (folder / "report.html").read_text("utf-8")
    assert "Not moving, run 1" in page
    assert "(typical)" not in page


@pytest.mark.parametrize(
    ("runs", "status", "message"),
    [
        ("constant", 2, "expected CELL:RUN, such as jdm:0; got 'constant'"),
        ("constant:x", 2, "got 'constant:x'"),
        ("constant:0,", 2, "got ''"),
        ("constant:7", 1, "--runs: expected a finished run of cell constant (0 to 1); got 7"),
        ("gone:0", 1, "--runs: expected one of constant, stationary; got 'gone'"),
    ],
)
def test_invalid_runs_are_named(folder: Path, tmp_path: Path, runs: str, status: int, message: str) -> None:
    result = report(folder, "--runs", runs, "--out", tmp_path / "page.html")
    assert result.exit_code == status
    assert message in " ".join(result.output.replace("\u2502", " ").split())
    assert not (tmp_path / "page.html").exists()


def test_a_folder_without_results_is_an_error(tmp_path: Path) -> None:
    result = report(tmp_path)
    assert result.exit_code == 1
    assert "expected" in result.output


def test_unwritable_paths_are_reported_by_option(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    below, in_the_way = tmp_path / "file" / "below.html", tmp_path / "folder.html"
    in_the_way.mkdir()
    result = report(folder, "--out", below)
    assert (result.exit_code, result.output.splitlines()) == (
        1,
        [f"--out: expected a place to write a report; got {below}: {reason(below)}"],
    )
    result = report(folder, "--out", in_the_way)
    assert result.output.strip() == f"--out: expected a place to write a report; got {in_the_way}: a folder"
    result = report(folder, "--out", tmp_path / "page.html", "--figures", below)
    assert result.exit_code == 1
    assert f"--figures: expected a folder to write figures into; got {below}: " in result.output
    assert ".part" not in result.output


def reason(path: Path) -> str:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        return str(error.strerror)
    raise AssertionError(f"{path.parent} is no folder and could be made")


def test_the_folders_above_the_page_are_made(folder: Path, tmp_path: Path) -> None:
    page = tmp_path / "a" / "b" / "page.html"
    assert report(folder, "--out", page).exit_code == 0
    assert page.is_file()


def test_an_interrupted_report_prints_one_line(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("vedette.reports.write_report", interrupted)
    result = report(folder, "--out", tmp_path / "page.html")
    assert result.exit_code == 130
    assert result.output.strip().startswith("interrupted: ")
    assert len(result.output.strip().splitlines()) == 1
