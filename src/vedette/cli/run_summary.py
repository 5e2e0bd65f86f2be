"""Summary of one run in the terminal: decisions, error, run time and diagnostics."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from vedette.cli.output import console as new_console
from vedette.cli.output import is_verbose
from vedette.internal.text import pluralise, with_unit

if TYPE_CHECKING:
    from rich.console import Console

    from vedette.evaluation.fit import Fit
    from vedette.kernels.base.types import Bools
    from vedette.scenarios import Scenario
    from vedette.simulation.records import RunRecord

_NEAR_CUTOFF = 0.8  # share of the cutoff of OSPA above which the estimates are hardly of the targets
_SHOWN_SECONDS = 0.005  # shortest time of a stage that is shown
_FEW_DECISIONS = 5  # printed without --verbose
_FEW_TARGETS = 10  # of a recording, printed without --verbose
_LONGEST_ACTIONS = 36  # letters; longer actions are printed only with --verbose


def print_run(record: RunRecord, scenario: Scenario | None, fit: Fit | None = None, num_warnings: int = 0) -> None:
    """Print the summary of a run, and with `--verbose` all decisions and diagnostics.

    Without the scenario, OSPA has no unit and sensors have numbers. fit: of the model to recorded scans. num_warnings:
    shown before.
    """
    console = new_console()
    console.print(_title(record, scenario), style="bold", soft_wrap=True)
    if record.decisions:
        _print_decisions(console, record)
    _print_facts(console, record, scenario)
    if scenario is not None and (is_verbose() or record.recording is not None):
        _print_targets(console, record, scenario)
    _print_diagnostics(console, record, scenario)
    if fit is not None:
        first, *others = fit.lines(num_warnings)
        for head, line in (("fit        ", first), *(("           ", line) for line in others)):
            console.print(f"{head} {'! ' if fit.findings else ''}{line}", soft_wrap=True)


def _title(record: RunRecord, scenario: Scenario | None) -> str:
    """Return the title: scenario, planner, seed, run and number of scans (for a recording only scenario and scans)."""
    scans = pluralise(record.num_scans, "scan")
    words = scenario.model.describe_strategy(record.planner) if scenario else ""
    if record.recording is not None or (scenario is not None and scenario.model.recording is not None):
        return f"{record.scenario}: {scans}"
    planner = f"planner {record.planner}{f' ({words})' if words else ''}"
    return f"{record.scenario}: {planner}, seed {record.seed}, run {record.run}, {scans}"


def _print_decisions(console: Console, record: RunRecord) -> None:
    from rich.table import Table

    from vedette.evaluation.actions import describe_choice, lead_words, optimality_words
    from vedette.evaluation.comparison import decided_actions

    rows = list(zip(record.decisions, decided_actions(record), strict=True))
    num_omitted = 0 if is_verbose() else max(0, len(rows) - _FEW_DECISIONS)
    table = Table(box=None, pad_edge=False)
    for heading in ("time", "actions", "expected reward", "lead over runner-up", "optimal"):
        table.add_column(heading)
    for decision, choice in [*rows[: _FEW_DECISIONS - 1], rows[-1]] if num_omitted else rows:
        actions = describe_choice(choice)
        rewards = dict.fromkeys(f"{mean:.3f} ± {error:.3f}" for mean, error in decision.plan.expected_rewards)
        table.add_row(
            f"{decision.time:g} s",
            actions if is_verbose() or len(actions) <= _LONGEST_ACTIONS else f"of {len(choice)} sensors",
            ", ".join(rewards),
            lead_words(decision.plan),
            optimality_words(decision.plan),
        )
    console.print(table)
    if num_omitted:
        console.print(f"{pluralise(num_omitted, 'more decision')} before the last: --verbose prints all", style="dim")
    for note in dict.fromkeys(note for decision in record.decisions for note in decision.plan.notes):
        console.print(f"note: {note}", soft_wrap=True)


def _print_facts(console: Console, record: RunRecord, scenario: Scenario | None) -> None:
    """Print the mean error over the scans that count, if the targets are known, and the run time."""
    from vedette.evaluation.comparison import counted_scans

    unit = scenario.model.ospa.unit if scenario else ""
    counts = counted_scans(record, scenario)
    times = record.times[counts]
    total, localisation, cardinality = record.ospa[counts].mean(axis=0)
    if not math.isnan(total):
        parts = f"localisation {localisation:.2f}, cardinality {cardinality:.2f}"
        window = f"mean over t = {times[0]:g} to {times[-1]:g} s"
        far = "" if scenario is None else _far_words(record, scenario, counts, total)
        console.print(f"mean OSPA   {with_unit(f'{total:.2f}', unit)} ({far}{parts}; {window})", soft_wrap=True)
    seconds_by_stage = {stage: float(seconds.sum()) for stage, seconds in record.timings.items()}
    stages = ", ".join(
        f"{stage} {seconds:.2f}" for stage, seconds in seconds_by_stage.items() if seconds >= _SHOWN_SECONDS
    )
    console.print(
        f"run time    {sum(seconds_by_stage.values()):.2f} s{f' ({stages})' if stages else ''}", soft_wrap=True
    )


def _print_targets(console: Console, record: RunRecord, scenario: Scenario) -> None:
    """Print how well each target was tracked."""
    from rich.table import Table

    from vedette.evaluation.health import percent
    from vedette.evaluation.runs import named_target_scores

    scores = named_target_scores(record, scenario)
    if not scores:
        return
    table = Table(box=None, pad_edge=False)
    for heading in ("target", "scans", "with an estimate", "error", "error over its bar", "changes of label"):
        table.add_column(heading, justify="left" if heading == "target" else "right")
    for name, own in scores if is_verbose() else scores[:_FEW_TARGETS]:
        error, ratio = ("-" if math.isnan(x) else f"{x:.2f}" for x in (own.rmse_m, own.error_ratio))
        table.add_row(name, str(own.num_scans), percent(own.covered), f"{error} m", ratio, str(own.label_switches))
    console.print(table)
    if (num := len(scores) - _FEW_TARGETS) > 0 and not is_verbose():
        console.print(f"{pluralise(num, 'more target')}: --verbose prints all", style="dim")


def _far_words(record: RunRecord, scenario: Scenario, counts: Bools, total: float) -> str:
    """Return the cutoff and the share of targets without an estimate within it, if OSPA is near its cutoff."""
    cutoff = scenario.model.ospa.cutoff
    if total < _NEAR_CUTOFF * cutoff:
        return ""
    from vedette.evaluation.health import percent
    from vedette.evaluation.runs import measure_run

    words = f"cutoff {with_unit(f'{cutoff:g}', scenario.model.ospa.unit)}"
    alive = int((record.truth.offsets[1:] - record.truth.offsets[:-1])[counts].sum())
    if not alive:
        return f"{words}; "
    missed = int(measure_run(record, scenario).num_missed[counts].sum())
    return f"{words}: {percent(missed / alive)} of targets have no estimate within it; "


def _print_diagnostics(console: Console, record: RunRecord, scenario: Scenario | None) -> None:
    """Print the diagnostics that may reduce accuracy, and with `--verbose` also notes."""
    from vedette.evaluation.diagnostics import diagnostics_line, record_diagnostics

    diagnostics = record_diagnostics(record, scenario)
    shown = [each for each in diagnostics if each.level == "check" or (is_verbose() and each.level == "note")]
    if not shown:
        console.print(f"diagnostics {diagnostics_line(())}")
        return
    console.print("diagnostics, which may cost accuracy (docs: lost-tracks):")
    for each in shown:
        mark = "!" if each.level == "check" else " "
        console.print(f"  {mark} {each.name}: {each.text}", soft_wrap=True)
