from __future__ import annotations

import json
import re
import tomllib
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from empty_figures import print_nothing
from reports.examples import campaign_of, results_of
from vedette.campaigns.results import CampaignResults
from vedette.errors import InputError
from vedette.reports import html, write_figures, write_report
from vedette.reports.provenance import spec_toml, versions_table
from vedette.scenarios import load_scenario
from vedette.scenarios.dumping import dump_scenario
from vedette.scenarios.generated import GeneratedScene, scene_text

HOSTILE = '<script>alert("&")</script>'


class Words(HTMLParser):
    """The text of a page outside scripts and styles, its elements, and the attributes that would load something."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.text: list[str] = []
        self.elements: list[str] = []
        self.loads: list[str] = []
        self.ids: list[str] = []
        self._inside = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(tag)
        self._inside = tag
        for name, value in attrs:
            if name in ("src", "href", "xlink:href", "srcset", "action") and value and not value.startswith("#"):
                self.loads.append(value)
            if name == "id":
                self.ids.append(value or "")

    def handle_data(self, data: str) -> None:
        if self._inside not in ("script", "style"):
            self.text.append(data)

    @property
    def words(self) -> str:
        return " ".join(" ".join(self.text).split())


@pytest.fixture(scope="module")
def page(report: Path) -> str:
    return report.read_text("utf-8")


def page_of(results: CampaignResults, folder: Path, **options: Any) -> str:
    write_report(results, folder / "report.html", **options)
    return (folder / "report.html").read_text("utf-8")


def test_the_page_has_findings_and_the_command_to_reproduce(page: str) -> None:
    words = Words(page).words
    assert "Which strategy tracks best on paper-a?" in words
    assert re.search(r"JDM joint decisions, CS divergence \d+\.\d\d ± \d+\.\d\d reference", words)
    assert re.search(r"Random random actions .* (larger|smaller) error|not significant", words)
    assert re.search(r"Posterior truncated (check|note) weight at most", words)
    assert "3 paired runs" in words
    for title in ("OSPA against time", "Run by run", "Where the sensors were sent", "Rewards, JDM", "Rewards, IDM"):
        assert title in words
    for measure in ("GOSPA (m)", "OSPA(2) (m)", "Cardinality error", "Label switches a run", "Position NEES / 2"):
        assert measure in words
    for part in ("planning, a decision", "vedette campaign spec.toml", 'planners = ["jdm", "idm", "random"]', "numba"):
        assert part in words
    assert "Unfinished" not in words


def test_the_page_needs_nothing_but_itself(page: str) -> None:
    parsed = Words(page)
    assert parsed.loads == ["data:,"]  # an icon of nothing, so that no browser asks for one
    assert not {"img", "iframe", "image", "object"} & set(parsed.elements)
    assert len(parsed.ids) == len(set(parsed.ids))
    assert len(page) < 1_500_000


def test_the_same_results_give_the_same_bytes(results: CampaignResults, page: str, tmp_path: Path) -> None:
    assert page_of(results, tmp_path) == page


def test_names_are_text_and_never_part_of_the_page(tmp_path: Path) -> None:
    text = dump_scenario(load_scenario("paper-a").model).replace("name: paper-a", f"name: '{HOSTILE}'", 1)
    (tmp_path / "hostile.yaml").write_text(text.replace("name: sensor 1", f"name: '{HOSTILE}'", 1), "utf-8")
    variants = [{"name": HOSTILE}, {"name": "</script><b>"}]
    scenarios = [str(tmp_path / "hostile.yaml")]
    campaign = campaign_of(name=HOSTILE, scenarios=scenarios, planners=["stationary"], variants=variants)
    page = page_of(results_of(tmp_path / "results", campaign), tmp_path)
    parsed = Words(page)
    assert parsed.elements.count("script") == 2
    assert "b" not in parsed.elements
    assert parsed.words.count(HOSTILE) > 5
    assert "<script>alert" not in page


def test_strategies_without_a_run_in_common_are_shown_but_not_compared(tmp_path: Path) -> None:
    campaign = campaign_of(planners=["random", "constant", "stationary"])
    skipped = {("constant", 0), ("random", 1), ("stationary", 0), ("stationary", 1)}
    words = Words(page_of(results_of(tmp_path / "results", campaign, skipped=skipped), tmp_path)).words
    assert "Unfinished: 2 of 6 runs are in." in words
    assert "There is nothing to compare yet" in words
    assert "no run number is finished for every one of them yet" in words
    assert "Random: 1 of 2 runs; Fixed: 1 of 2 runs; no run yet of Not moving" in words
    assert "GOSPA (m)" in words


def test_a_campaign_without_any_run_has_a_report(tmp_path: Path) -> None:
    campaign = campaign_of(planners=["random", "constant"], runs=1)
    skipped = {("random", 0), ("constant", 0)}
    words = Words(page_of(results_of(tmp_path / "results", campaign, skipped=skipped), tmp_path)).words
    assert "Unfinished: 0 of 2 runs are in." in words
    assert "There is no finished run to replay." in words


@pytest.mark.usefixtures("quick_figures")
def test_a_number_that_is_compared_is_named_and_swept(tmp_path: Path) -> None:
    axis = "sensors.*.clutter.rate"
    campaign = campaign_of(planners=["constant"], grid={axis: [5.0, 40.0]}, compare=axis)
    results = results_of(tmp_path / "results", campaign)
    words = Words(page_of(results, tmp_path, replays=[(campaign.cells[1].name, 0)])).words
    assert "Which clutter rate is best on paper-a?" in words
    assert re.search(r"[Cc]lutter rate 5 .*clutter rate 40", words)
    assert "Sweep of clutter rate" in words
    assert "Run clutter rate 40, run 0 " in words


@pytest.mark.usefixtures("quick_figures")
def test_scenarios_are_groups_and_not_compared_with_one_another(tmp_path: Path) -> None:
    campaign = campaign_of(planners=["stationary"], scenarios=["paper-a", "paper-e"], runs=1)
    words = Words(page_of(results_of(tmp_path / "results", campaign), tmp_path)).words
    assert words.count("OSPA against time") == 2
    assert "There is nothing to compare: one strategy each." in words


@pytest.mark.usefixtures("quick_figures")
def test_measures_of_labels_are_left_out_for_filters_that_have_none(tmp_path: Path) -> None:
    filters = ["delta_glmb", "phd"]
    campaign = campaign_of(planners=["stationary"], scenarios=["linear-10"], filters=filters, runs=1)
    page = page_of(results_of(tmp_path / "results", campaign), tmp_path)
    rows = re.findall(r'<th scope="row">([^<]+)</th><td>([^<]+)</td><td>([^<]+)</td></tr>', page)
    missing = {name for name, glmb, phd in rows if phd == "\N{EN DASH}" != glmb}
    assert missing == {"OSPA(2) (m)", "Label switches a run"}


def test_a_large_page_omits_figures_and_runs_with_a_note(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(html, "MAX_FIGURE_BYTES", 1000)
    monkeypatch.setattr(html, "MAX_REPLAY_BYTES", 100_000)
    campaign = campaign_of(planners=["constant"], variants=[{"name": "one"}, {"name": "two"}], compare="planner")
    words = Words(page_of(results_of(tmp_path / "results", campaign), tmp_path)).words
    assert words.count("not drawn for this group") == 1
    assert words.count("Run by run") == 2
    assert words.count("Consistency") == 1
    assert "1 more run is left out" in words


def test_figures_of_very_many_lines_are_drawn_in_dots_and_say_so(
    results: CampaignResults, page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "<img" not in page
    monkeypatch.setattr(html, "MAX_DRAWING_BYTES", 60_000)
    page = page_of(results, tmp_path)
    images = re.findall(r'<img src="data:image/png;base64,([^"]+)"', page)
    assert images
    assert len(images) == page.count("Drawn in dots to keep the page small")
    assert max(map(len, images)) < 500_000
    assert all(len(svg) <= 60_000 for svg in re.findall(r"<svg viewBox.*?</svg>", page, re.DOTALL))


def test_the_page_of_many_sensors_is_small_enough_to_send(tmp_path: Path) -> None:
    """Sensors make lines and curves in proportion to their number and that of decisions."""
    (tmp_path / "many.yaml").write_text(scene_text(GeneratedScene(num_sensors=24)))
    scene = {"time.num_steps": 24, "control.decision_steps": list(range(1, 24))}
    variants = [{"name": "short", "set": scene}]
    campaign = campaign_of(scenarios=[str(tmp_path / "many.yaml")], planners=["idm"], runs=1, variants=variants)
    page = page_of(results_of(tmp_path / "results", campaign), tmp_path)
    start = page.index('id="runs">') + len('id="runs">')
    replay = page[start : page.index("</script>", start)]
    (run,) = json.loads(replay)
    assert len(run["decisions"]) == 23
    assert len(run["axes"]) == 1
    assert all(len(json.dumps(curve)) < 400 for curve in run["decisions"][0]["curves"])
    assert len(replay) < 600_000
    assert len(page) < 3_000_000


@pytest.mark.parametrize(("chosen", "message"), [(("jdm", 9), "expected a finished run"), (("gdm", 0), "expected one")])
def test_runs_that_are_not_there_are_refused(
    results: CampaignResults, tmp_path: Path, chosen: tuple[str, int], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        write_report(results, tmp_path / "report.html", replays=[chosen])
    assert not (tmp_path / "report.html").exists()


def test_a_page_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    campaign = campaign_of(planners=["stationary"], runs=1)
    results = results_of(tmp_path / "results", campaign, skipped={("stationary", 0)})
    with pytest.raises(InputError, match="expected a place to write a report"):
        write_report(results, tmp_path / "file" / "report.html")


def test_the_specification_reads_back() -> None:
    spec = {
        "name": 'a "name"\n', "runs": 3, "seed": None, "flag": True, "list": [1, 2.5, "x"], "set": {},
        "grid": {"sensors.*.clutter.rate": [5.0, 1e-9], "a b": [[1, 2], [3, 4]]},
        "variants": [{"name": "one", "set": {"filter.kind": "lmb"}}, {"name": "two"}],
    }  # fmt: skip
    kept = {key: value for key, value in spec.items() if key not in ("seed", "set")}
    assert tomllib.loads(spec_toml(spec)) == kept


def test_long_names_stay_whole_in_the_table_of_errors_and_short_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    long = "x" * 60
    campaign = campaign_of(planners=["constant"], variants=[{"name": long}, {"name": "y"}])
    results = results_of(tmp_path / "results", campaign)
    page = page_of(results, tmp_path)
    short = f"{'x' * 16}\N{HORIZONTAL ELLIPSIS}{'x' * 15}"
    assert f'<th scope="row">{long}</th>' in page
    assert f'<th scope="col" title="{long}">{short}</th>' in page
    assert f"<title>{long}</title>" in page
    print_nothing(monkeypatch)  # the names of the files matter
    written = write_figures(results, tmp_path / "figures")
    assert max(len(path.name) for path in written) <= 80
    assert len({path.name for path in written}) == len(written)


def test_sessions_that_are_alike_share_a_column() -> None:
    def session(started: str, numpy: str) -> dict[str, Any]:
        return {"started": started, "versions": {"numpy": numpy}, "machine": {"processors": 2}}

    table = versions_table({"sessions": [session("a", "1"), session("b", "1"), session("c", "2")]})
    assert table.header == ("", "Sessions 1 to 2", "Session 3")
    assert table.rows == (("started", "a to b", "c"), ("numpy", "1", "2"), ("processors", "2", "2"))


def test_one_run_claims_no_interval_and_no_win(tmp_path: Path) -> None:
    campaign = campaign_of(planners=["random", "constant", "stationary"], runs=1)
    words = Words(page_of(results_of(tmp_path / "results", campaign), tmp_path)).words
    assert "1 paired run, mean over t = " in words
    assert "one run" in words
    for claim in ("Each interval", "standard error", "1 paired runs", "over 1 runs", "with mean and 95 % confidence"):
        assert claim not in words
