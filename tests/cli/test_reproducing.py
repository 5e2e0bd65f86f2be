"""The command that repeats a published comparison, on a scene cut short."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from vedette.campaigns import open_results, published
from vedette.campaigns.published import PublishedComparison
from vedette.cli import app

NAME = "deciding-six-cameras"


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> PublishedComparison:
    """The first three scans of a yardstick, in a working folder of its own."""
    whole = published.published_comparisons()[NAME]
    targets = {"kind": "scripted", "tracks": [{"state": [0.0, 296.0, 0.0, -4.0]}, {"state": [0.0, 500.0, 0.0, 0.0]}]}
    fields = {"time.num_steps": 3, "control.decision_steps": [1, 2], "control.num_samples": 1, "targets": targets}
    cut = PublishedComparison(
        whole.spec.model_copy(update={"set": {**whole.spec.set, **fields}, "runs": 2}),
        whole.title,
        whole.source,
        whole.remark,
        whole.published,
    )
    monkeypatch.setattr(published, "published_comparisons", lambda: {NAME: cut})
    monkeypatch.chdir(tmp_path)
    return cut


def call(*words: str, columns: int = 80) -> Result:
    return CliRunner().invoke(app, ["reproduce", *words, "--workers", "1"], env={"COLUMNS": str(columns)})


def test_the_list_names_every_published_comparison() -> None:
    result = call("--list", columns=160)
    assert (result.exit_code, result.stderr) == (0, "")
    assert [line.split()[0] for line in result.stdout.splitlines()] == list(published.published_comparisons())


def test_a_published_comparison_is_run_and_printed_next_to_published_numbers(short: PublishedComparison) -> None:
    result = call(NAME, "--planners", "random,constant")
    assert result.exit_code == 0, result.output
    assert "published: FDCD 3.39 ± 0.15" in " ".join(result.stdout.split())
    assert "arXiv 2604.19160" in " ".join(result.stdout.split())
    assert f"{NAME}, seed 0: all 4 runs are finished" in result.stdout
    folder = Path(f"{NAME}-results")
    assert [open_results(folder).finished(cell) for cell in ("random", "constant")] == [(0, 1), (0, 1)]
    assert sorted(file.name for file in folder.iterdir() if file.suffix in (".md", ".html")) == [
        "published-comparison.md",
        "report.html",
    ]
    page = (folder / "published-comparison.md").read_text(encoding="utf-8")
    assert page.startswith(f"# {short.title}\n\n| Strategy | OSPA (m) |")


def test_the_same_command_goes_on_and_may_ask_for_more_runs(short: PublishedComparison) -> None:
    assert call(NAME, "--planners", "constant", "--runs", "1", "--out", "there").exit_code == 0
    assert open_results("there").finished("constant") == (0,)
    result = call(NAME, "--planners", "constant", "--runs", "2", "--out", "there")
    assert result.exit_code == 0, result.output
    assert "1 are there already" in result.stderr
    assert open_results("there").finished("constant") == (0, 1)
    other = call(NAME, "--planners", "random", "--out", "there")
    assert other.exit_code == 1
    assert "expected a folder of this campaign" in other.stderr


@pytest.mark.parametrize("columns", [40, 60, 80, 120])
def test_every_number_is_shown_at_any_width(short: PublishedComparison, columns: int) -> None:
    result = call(NAME, "--planners", "constant", "--runs", "1", columns=columns)
    assert result.exit_code == 0, result.output
    table = result.stdout[: result.stdout.index("Published: ")]
    assert max(map(len, table.splitlines())) <= columns
    for number in ("22.39 ± 2.07", "34.50", "\N{MINUS SIGN}1.93", "0.59"):
        assert number in table


def test_ctrl_c_prints_how_to_continue(short: PublishedComparison, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("vedette.campaigns.run_campaign", interrupted)
    result = call(NAME)
    assert result.exit_code == 130
    assert f"{NAME}-results keeps every run that is finished; the same command goes on from there" in result.stderr


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        ((NAME, "--planners", "constant,constant"), 2, "expected each strategy once; got constant,constant"),
        (
            (NAME, "--planners", "clever"),
            1,
            "lookahead, nearest, assigned_target, centroid, oracle, true_targets, random, constant, stationary, "
            "greedy; got 'clever'",
        ),
        (
            ("deciding-six-camera",),
            1,
            "deciding-six-camera: no such file; expected a published comparison (deciding-six-cameras), a YAML file "
            "or one of",
        ),
        ((NAME, "--runs", "0"), 2, "--runs"),
    ],
)
def test_mistakes(short: PublishedComparison, words: tuple[str, ...], status: int, message: str) -> None:
    result = call(*words)
    assert result.exit_code == status
    assert message in " ".join(result.stderr.split())
    assert not Path(f"{NAME}-results").exists()


@pytest.mark.parametrize("name", ["paper-a", "deciding-eight-mobile"])
def test_a_campaign_may_be_one_that_comes_with_the_library(name: str) -> None:
    result = CliRunner().invoke(app, ["campaign", name, "--dry-run"])
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith(f"{name}: ")


@pytest.mark.usefixtures("quick_figures")
def test_the_paper_is_compared_with_the_default_and_its_claims_are_checked(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    whole = published.published_comparisons()["paper-a"]
    cut = replace(whole, spec=whole.spec.model_copy(update={"runs": 2}))
    monkeypatch.setattr(published, "published_comparisons", lambda: {"paper-a": cut})
    monkeypatch.chdir(tmp_path)
    result = call()
    assert result.exit_code == 0, result.output
    rows = [line.split()[0] for line in result.stdout.splitlines() if line]
    assert rows.index("expected_loss") < rows.index("jdm") < rows.index("random")
    assert ": joint decisions beat independent ones (idm minus jdm: " in result.stdout
    assert "jdm chooses (-30°, 30°) at 10 s (chosen in " in result.stdout
    page = Path("paper-a-results/report.html").read_text("utf-8")
    assert "Which strategy tracks best on paper-a?" in page
    assert "The publication says" in page
    assert Path("paper-a-results/figures/overview.png").exists()
