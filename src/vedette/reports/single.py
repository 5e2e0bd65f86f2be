"""Report of a single run: the page of a campaign's report, for one strategy in one setting."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vedette.evaluation.fit import Fit
from vedette.evaluation.scans import measurement_code
from vedette.reports.groups import group_of_run
from vedette.reports.html import prepare_folder, render, section_of, write_page
from vedette.reports.provenance import citation
from vedette.reports.replay import replay_data
from vedette.reports.tables import Table
from vedette.scenarios import Scenario
from vedette.simulation.records import RunRecord


def write_run_report(
    record: RunRecord,
    scenario: Scenario,
    path: str | Path,
    *,
    manifest: Mapping[str, Any] | None = None,
    trust: bool = False,
) -> None:
    """Write the report of one run as one self-contained HTML file. Equal runs give equal bytes.

    The replay of recorded scans shows those of the recording. Without known targets there are no errors.

    Args:
        record: the run.
        scenario: the scenario of the run.
        path: path of the file. Missing folders are made.
        manifest: manifest of the run's folder, with the versions of the program. None: no versions are shown.
        trust: run the code that the scenario names, to draw measurements (see `write_report`).

    Raises:
        InputError: the run has other sensors than the scenario, or the file cannot be written.
    """
    target = Path(path)
    prepare_folder(target)
    group = group_of_run(record, scenario)
    (strategy,) = group.strategies
    page = render(
        "run.html",
        [{**replay_data(strategy, record, group.title, trust=trust), "typical": False}],
        record=record,
        strategy=strategy.name,
        section=section_of(group, "g0"),
        untrusted=() if trust else measurement_code(scenario),
        described=scenario.model.description,
        fit=None if manifest is None else Fit.from_dict(manifest.get("fit")),
        versions=None if manifest is None else _versions(manifest),
        citation="" if manifest is None else citation(manifest["versions"]["vedette"]),
    )
    write_page(target, page)


def _versions(manifest: Mapping[str, Any]) -> Table:
    rows = tuple((str(name), str(number)) for name, number in manifest["versions"].items())
    return Table("With what the run was made.", ("Part", "Version"), rows, is_words=True)
