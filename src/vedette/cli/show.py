"""Command `show`: a scenario as tables, and as a picture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vedette.cli.errors import check_ending, option_errors
from vedette.cli.options import ScenarioName, Trust
from vedette.cli.output import console as new_console
from vedette.cli.output import echo, emit_json, is_verbose, note
from vedette.cli.running import CodeTrust
from vedette.internal.extras import require_packages

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

    from vedette.scenarios import Scenario
    from vedette.simulation import Truth

_MAX_ROWS, _FIRST_ROWS = 8, 3  # largest table shown in full; rows shown of a longer one without --verbose
PICTURE_FORMATS = ("png", "pdf", "svg")


def show(
    scenario: ScenarioName,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Draw a picture (.png, .pdf or .svg).")
    ] = None,
    resolved: Annotated[bool, typer.Option("--with-defaults", help="Print YAML with every default instead.")] = False,
    trust: Trust = False,
) -> None:
    """Show a scenario as tables and as a picture.

    The picture has the region, the true tracks, the sensors and the birth sites.
    """
    from vedette.scenarios import load_scenario

    check_ending(out, "--out", *PICTURE_FORMATS)
    if out is not None:
        require_packages("vedette show --out", "matplotlib")
    loaded = load_scenario(scenario)
    if not resolved or out is not None:  # the targets move by the scenario's motion model
        CodeTrust(trust)(loaded)
    if resolved:
        from vedette.scenarios.dumping import dump_scenario

        echo(dump_scenario(loaded.model), nl=False)
    else:
        _print_tables(loaded)
    if out is not None:
        _draw(loaded, out)
        (note if resolved else echo)(f"wrote {out}")
    emit_json({"file": loaded.path, "scenario": loaded.model.model_dump(mode="json"), "picture": out})


def _print_tables(scenario: Scenario) -> None:
    from vedette.scenarios.summary import summary_rows

    console = new_console()
    console.print(scenario.name, style="bold")
    console.print(scenario.model.description)
    for table in (_grid(summary_rows(scenario.model)), _sensors(scenario), _sensing(scenario), _targets(scenario)):
        console.print()
        console.print(table)


def _grid(rows: Iterable[tuple[str, str]]) -> Table:
    from rich.table import Table
    from rich.text import Text

    table = Table.grid(padding=(0, 2))
    table.add_column(no_wrap=True, style="dim")
    table.add_column(overflow="fold")
    for name, text in rows:
        table.add_row(name, Text(text))
    return table


def _numbers_table(title: str, *columns: str) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(
        title=title, title_justify="left", box=SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0), pad_edge=False
    )
    table.add_column(columns[0], overflow="fold")
    for column in columns[1:]:
        table.add_column(column, justify="right")
    return table


def _sensors(scenario: Scenario) -> Table:
    from rich.text import Text

    from vedette.scenarios.sections.courses import start_course
    from vedette.scenarios.summary import first_motion

    model = scenario.model
    start_column = [] if first_motion(model) else ["moves from"]
    direction = "course\n(deg)" if model.by_compass else "heading\n(deg)"
    table = _numbers_table("sensors", "name", "x\n(m)", "y\n(m)", direction, "platform", *start_column)
    rows: list[tuple[str | Text, ...]] = []
    for name, sensor in zip(model.sensor_names, model.sensors, strict=True):
        heading = sensor.heading_deg
        if model.by_compass:
            heading = start_course(heading, model.north(), sensor.position)
        place = (f"{sensor.position[0]:g}", f"{sensor.position[1]:g}")
        start = "first decision" if sensor.stationary_until_first_decision else "start"
        start = "-" if sensor.platform.kind == "stationary" else start
        rows.append((Text(name), *place, f"{heading:g}", sensor.platform.kind, *[start for _ in start_column]))
    return _with_rows(table, rows)


def _with_rows(table: Table, rows: Sequence[tuple[str | Text, ...]]) -> Table:
    """Return the table with its rows, of a long table the first rows, without `--verbose`."""
    show_all = is_verbose() or len(rows) <= _MAX_ROWS
    for row in rows if show_all else rows[:_FIRST_ROWS]:
        table.add_row(*row)
    if not show_all:
        table.caption = f"{len(rows) - _FIRST_ROWS} more: --verbose lists all"
        table.caption_justify = "left"
    return table


def _sensing(scenario: Scenario) -> Table:
    """Return a description of the sensors' measurements, once if it is the same for all."""
    from vedette.scenarios.summary import sensing_rows

    north = scenario.model.north() if scenario.model.by_compass else None
    described = [sensing_rows(sensor, north) for sensor in scenario.model.sensors]
    if all(rows == described[0] for rows in described):
        return _grid(described[0])
    names = scenario.model.sensor_names
    return _grid((f"{name}: {key}", text) for name, rows in zip(names, described, strict=True) for key, text in rows)


def _targets(scenario: Scenario) -> Table:
    import numpy as np

    truth = sample_truth(scenario)
    table = _numbers_table("targets", "id", "from\n(s)", "to\n(s)", "x\n(m)", "y\n(m)", "vx\n(m/s)", "vy\n(m/s)")
    scans = truth.scans
    table_rows: list[tuple[str | Text, ...]] = []
    for target in np.unique(truth.ids):
        rows = np.flatnonzero(truth.ids == target)
        first, last = truth.times[scans[rows[0]]], truth.times[scans[rows[-1]]]
        x, y, *velocity = truth.states[rows[0]]
        speeds = [f"{value:.1f}" for value in velocity[:2]] + ["-"] * (2 - len(velocity))
        table_rows.append((str(target + 1), f"{first:g}", f"{last:g}", f"{x:.0f}", f"{y:.0f}", *speeds))
    return _with_rows(table, table_rows)


def sample_truth(scenario: Scenario) -> Truth:
    """Return the true targets of one run. With process noise they differ from run to run."""
    import numpy as np

    from vedette.scenarios.build import build_targets

    return build_targets(scenario).truth(scenario.model.time.build(), rng=np.random.default_rng(0))


def _draw(scenario: Scenario, out: Path) -> None:
    from vedette.cli.picture import scenario_figure
    from vedette.evaluation.figures import save_figure

    name = out.suffix[1:].lower()
    with option_errors({"path": "--out"}):
        written = save_figure(scenario_figure(scenario, sample_truth(scenario)), out.with_suffix(""), formats=(name,))[
            0
        ]
    if written != out:
        written.replace(out)
