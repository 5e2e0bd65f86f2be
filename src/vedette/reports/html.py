"""The report as one HTML file."""

import base64
import hashlib
import itertools
import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from vedette.campaigns.published import CheckedClaim, checked_claims, published_comparison_of
from vedette.campaigns.results import CampaignResults
from vedette.errors import InputError
from vedette.evaluation.figures.labels import elided_names
from vedette.evaluation.scans import measurement_code
from vedette.internal.files import write_whole
from vedette.internal.text import named_in
from vedette.kernels.base.types import Floats
from vedette.reports.drawings import Drawing, error_drawings, group_drawings, paired_records, sweep_drawings
from vedette.reports.forest import Forest, forest_of
from vedette.reports.groups import Group, axis_label, comparison_groups
from vedette.reports.health import DiagnosticsTable, diagnostics_table
from vedette.reports.pairwise import PairwiseComparison, all_pairs
from vedette.reports.provenance import citation, last_version_and_date, spec_toml, versions_table
from vedette.reports.replay import replay_data
from vedette.reports.saving import run_errors
from vedette.reports.svg import inline_png, inline_svg
from vedette.reports.tables import Table, cost_table, decision_table, error_table, measure_table

# Limits that keep the page small enough for e-mail: beyond them, groups show only their errors, and typical runs are
# left out.
MAX_FIGURE_BYTES, MAX_REPLAY_BYTES = 6_000_000, 4_000_000
# A larger SVG figure is replaced by a PNG image.
MAX_DRAWING_BYTES = 1_000_000
_IN_DOTS = "Drawn in dots to keep the page small; vedette report --figures draws it in lines."
_FILES = resources.files("vedette.reports") / "page"


@dataclass(frozen=True, slots=True)
class _Section:
    """Part of the page about one group. `is_brief` if it shows only the figures of the error."""

    title: str
    finished: tuple[tuple[str, int], ...]  # strategies and their numbers of runs
    missing: tuple[str, ...]
    reason: str  # why there is no comparison, or empty
    difference: str  # heading of the paired differences
    is_brief: bool
    forest: Forest | None
    pairs: tuple[PairwiseComparison, ...]
    diagnostics: DiagnosticsTable | None
    tables: tuple[tuple[str, Table], ...]
    figures: tuple[tuple[Drawing, Markup], ...]

    @property
    def blocks(self) -> list[tuple[bool, list[tuple[Drawing, Markup]]]]:
        """The figures in order, grouped into runs of wide (True) and narrow ones."""
        return [(wide, list(each)) for wide, each in itertools.groupby(self.figures, lambda pair: pair[0].is_wide)]

    @property
    def size(self) -> int:
        """Bytes of its figures."""
        return sum(len(svg) for _, svg in self.figures)


def write_report(
    results: CampaignResults, path: str | Path, *, replays: Sequence[tuple[str, int]] | None = None, trust: bool = False
) -> None:
    """Write a campaign's report as one self-contained HTML file. Equal results give equal bytes.

    Without `trust` no code that the results name is imported or run. If drawing the measurements of a replay requires a
    custom sensor model, they are then left out, and the page states it.

    Args:
        results: results of a finished campaign.
        path: path of the file. Missing folders are made.
        replays: cell and number of the runs to replay. None: the typical run of the first strategy, under every
            strategy, as many as keep the page small.
        trust: run the code that the scenarios of the results name (`replay_code`).

    Raises:
        InputError: a run that does not exist, or a file that cannot be written.
    """
    _check_replays(results, replays or ())
    target = Path(path)
    prepare_folder(target)
    sections: list[_Section] = []
    runs: list[dict[str, Any]] = []
    errors: dict[str, Floats] = {}
    claims: list[CheckedClaim] = []
    reference = published_comparison_of(results.campaign)
    for number, group in enumerate(comparison_groups(results)):
        if reference is not None and group.comparison is not None:
            claims += checked_claims(reference, group.comparison)
        errors.update(run_errors(group))
        is_brief = sum(section.size for section in sections) > MAX_FIGURE_BYTES
        sections.append(section_of(group, f"g{number}", is_brief))
        runs += _replays(results, group, replays, trust)
    sweeps = _inline_figures(tuple(sweep_drawings(results.campaign, errors)), "sweep")
    shown_replays = _within(runs, MAX_REPLAY_BYTES) if replays is None else runs
    untrusted = () if trust else replay_code(results)
    campaign = results.campaign
    version_and_date = last_version_and_date(results.manifest)
    page = render(
        "report.html",
        shown_replays,
        left_out=len(runs) - len(shown_replays),
        untrusted=untrusted,
        campaign=campaign,
        folder=shlex.quote(campaign.default_folder),
        compared=axis_label(campaign.compare),
        claims=claims,
        remark="" if reference is None else reference.remark,
        sections=sections,
        sweeps=sweeps,
        finished=sum(len(results.finished(cell.name)) for cell in campaign.cells),
        failures=results.failures(),
        planned=campaign.total,
        spec=spec_toml(campaign.spec),
        versions=versions_table(results.manifest),
        digest=results.manifest["digest"],
        made=version_and_date,
        citation=citation(version_and_date[0], version_and_date[1][:4]),
    )
    write_page(target, page)


def write_demo(results: CampaignResults, path: str | Path, *, trust: bool = False) -> Path:
    """Write a page that shows the first run of the strategies of a campaign side by side, and return its path.

    The page is self-contained, and equal results give equal bytes.

    Args:
        results: results of a campaign on one scenario, with a finished run of each strategy.
        path: path of the file. Missing folders are made.
        trust: run the code that the scenario names, to draw measurements (see `write_report`).

    Raises:
        InputError: a run that does not exist, or a file that cannot be written.
    """
    target = Path(path)
    prepare_folder(target)
    first = [(cell.name, 0) for cell in results.campaign.cells]
    _check_replays(results, first)
    (group,) = comparison_groups(results)
    page = render(
        "demo.html",
        _replays(results, group, first, trust),
        campaign=results.campaign,
        untrusted=() if trust else replay_code(results),
        together=True,
    )
    write_page(target, page)
    return target


def replay_code(results: CampaignResults) -> tuple[str, ...]:
    """Return the names of custom sensor models that a trusted report would run to draw its replays."""
    return tuple(dict.fromkeys(name for cell in results.campaign.cells for name in measurement_code(cell.scenario)))


def _check_replays(results: CampaignResults, replays: Sequence[tuple[str, int]]) -> None:
    for name, run in replays:
        finished = results.finished(results.campaign.cell(name).name)
        if run not in finished:
            raise InputError(f"replays: expected a finished run of cell {name} ({_spans(finished)}); got {run}")


def _spans(runs: Sequence[int]) -> str:
    """Return consecutive numbers as spans: `0 to 4, 7`."""
    spans: list[list[int]] = []
    for run in runs:
        if spans and spans[-1][-1] == run - 1:
            spans[-1][1:] = [run]
        else:
            spans.append([run])
    return ", ".join(" to ".join(map(str, span)) for span in spans) or "there is none yet"


def prepare_folder(path: Path) -> None:
    """Create the folders of the page before the work that an invalid path would waste."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _misplaced(path, error) from error
    if path.is_dir():
        raise InputError(f"path: expected a place to write a report; got {path}: a folder")


def _misplaced(path: Path, error: OSError) -> InputError:
    return InputError(f"path: expected a place to write a report; got {path}: {error.strerror}")


def section_of(group: Group, prefix: str, is_brief: bool = False) -> _Section:
    """Return the part of a page about a group. `prefix` must be unique on the page."""
    named = {
        "Errors": error_table(group),
        "Other measures": measure_table(group),
        "Decisions": decision_table(group),
        "Cost": cost_table(group),
    }
    comparison = group.comparison
    return _Section(
        title=group.title,
        finished=tuple((each.name, each.num_finished) for each in group.strategies),
        missing=group.missing,
        reason=group.reason,
        difference=named_in("Difference", "m" if comparison is None else comparison.unit),
        is_brief=is_brief,
        forest=forest_of(group),
        pairs=() if comparison is None or len(comparison.strategies) < 3 else all_pairs(comparison),
        diagnostics=diagnostics_table(group),
        tables=tuple((title, table) for title, table in named.items() if table is not None),
        figures=_inline_figures(
            tuple(error_drawings(group) if is_brief else group_drawings(group)),
            prefix,
            elided_names([each.label for each in group.strategies]),
        ),
    )


def _inline_figures(
    drawings: Sequence[Drawing], prefix: str, names: Mapping[str, str] | None = None
) -> tuple[tuple[Drawing, Markup], ...]:
    inlined = []
    for number, each in enumerate(drawings):
        description = f"{each.title}. {each.caption}"
        svg = inline_svg(each.figure, f"{prefix}-{number}", description, names)
        if len(svg) <= MAX_DRAWING_BYTES:
            inlined.append((each, svg))
        else:
            inlined.append((replace(each, caption=f"{each.caption} {_IN_DOTS}"), inline_png(each.figure, description)))
    return tuple(inlined)


def _replays(
    results: CampaignResults, group: Group, replays: Sequence[tuple[str, int]] | None, trust: bool
) -> list[dict[str, Any]]:
    """Return the run typical of the first strategy under every strategy, or the chosen runs of the group."""
    if replays is None:
        return [
            {
                **replay_data(strategy, record, group.title, trust=trust),
                "typical": group.comparison is not None and strategy is group.strategies[0],
            }
            for strategy, record in paired_records(group)
        ]
    strategies = {each.cell.name: each for each in group.strategies}
    return [
        {**replay_data(strategies[name], results.record(name, run), group.title, trust=trust), "typical": False}
        for name, run in replays
        if name in strategies
    ]


def _within(runs: Sequence[dict[str, Any]], max_bytes: int) -> list[dict[str, Any]]:
    """Return the runs that fit within a number of bytes, in order."""
    fitting, size = [], 0
    for run in runs:
        size += len(_json(run))
        if size <= max_bytes:
            fitting.append(run)
    return fitting


def _json(data: Any) -> str:
    """Return JSON that is safe inside an HTML element."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def render(
    template: str, replays: Sequence[dict[str, Any]], *, scripts: Sequence[str] = ("scripts",), **context: Any
) -> str:
    """Return a page of `template` with runs to replay, folders of scripts, and the other variables of the template."""
    script = _script(scripts)
    environment = Environment(
        loader=PackageLoader("vedette.reports", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(
        replays=replays,
        replay_json=Markup(_json(replays)),  # safe inside an element: see `_json`
        style=Markup((_FILES / "report.css").read_text("utf-8")),
        script=Markup(script),
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        **{"left_out": 0, "sections": (), "live": False, "together": False, **context},
    )


def _script(folders: Sequence[str]) -> str:
    files = [file for each in folders for file in sorted((_FILES / each).iterdir(), key=lambda file: file.name)]
    return "(() => {\n" + "\n".join(file.read_text("utf-8") for file in files if file.name.endswith(".js")) + "})();\n"


def write_page(path: Path, page: str) -> None:
    """Write a page atomically."""
    try:
        write_whole(path, lambda file: file.write(page.encode()))
    except OSError as error:
        raise _misplaced(path, error) from error
