"""Diagnostics of a group as a table: one check per row, one strategy per column."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vedette.evaluation.diagnostics import Diagnostic, birth_diagnostics, diagnostics
from vedette.evaluation.health import percent
from vedette.reports.groups import Group, Strategy
from vedette.reports.tables import nees_over_runs, nees_spread

_TRIFLE = 0.01  # share of the targets without an estimate below which the check is `ok`
_OFTEN = 0.2  # share of the scans with inconsistent covariances above which the check fails
_NONE = "\N{EN DASH}"


@dataclass(frozen=True, slots=True)
class DiagnosticsTable:
    """Checks of several strategies, without those that are `ok` for every strategy."""

    strategies: tuple[str, ...]  # names, one per column
    # one diagnostic per strategy. Those of a row have the same name and meaning
    rows: tuple[tuple[Diagnostic, ...], ...]


def diagnostics_table(group: Group) -> DiagnosticsTable | None:
    """Return the diagnostics of a group, or None if every check of every strategy is `ok`."""
    columns = [tuple(strategy_diagnostics(each)) for each in group.strategies]
    rows = tuple(row for row in zip(*columns, strict=True) if any(each.level != "ok" for each in row))
    return DiagnosticsTable(tuple(each.name for each in group.strategies), rows) if rows else None


def strategy_diagnostics(strategy: Strategy) -> Iterator[Diagnostic]:
    """Yield every check of a strategy: of lost targets, covariances, fusion, filters, and new targets (first run)."""
    yield _missed(strategy)
    yield _consistency(strategy)
    yield _worst_estimate(strategy)
    yield from diagnostics(strategy.ensemble.health, strategy.scene.names)
    yield from birth_diagnostics(strategy.record(int(strategy.ensemble.runs[0])), strategy.cell.scenario)


def failed_checks(diagnostics: Sequence[Diagnostic]) -> tuple[str, ...]:
    """Return name and result of the checks that may cost accuracy."""
    return tuple(f"{each.name}: {each.text}" for each in diagnostics if each.level == "check")


def _missed(strategy: Strategy) -> Diagnostic:
    name = "Targets without an estimate"
    meaning = "Share of the targets, over the scans, that have no estimate within the cutoff; and the worst run."
    ensemble, counted = strategy.ensemble, strategy.counted
    alive = ensemble.num_targets[:, counted].sum(axis=1, dtype=np.float64)
    if not ensemble.measures or not alive.any():  # the targets are unknown, or there are none
        return Diagnostic(name, meaning, _NONE, "ok")
    missed = ensemble.values("num_missed")[:, counted].sum(axis=1)
    share = float(missed.sum() / alive.sum())
    shares = missed / np.maximum(alive, 1.0)
    worst = int(np.argmax(shares))
    worst_run = f", run {ensemble.runs[worst]}: {percent(shares[worst])}" if share and ensemble.num_runs > 1 else ""
    return Diagnostic(name, meaning, f"{percent(share)}{worst_run}", "check" if share >= _TRIFLE else "ok")


def _consistency(strategy: Strategy) -> Diagnostic:
    name = "Position NEES / 2"
    meaning = (
        "Normalised squared error of the estimated positions over its dimension, averaged over the runs, median over "
        "the scans. 1 is consistent; above 1 the covariances are too small, below 1 too large."
    )
    if not strategy.ensemble.measures:
        return Diagnostic(name, meaning, _NONE, "ok")
    average = nees_over_runs(strategy, 2)
    known = strategy.counted & (average.count > 0)
    if not known.any():
        return Diagnostic(name, meaning, _NONE, "ok")
    middle = float(np.median(average.mean[known])) / average.dim
    outside = {
        "covariances too small": float((average.mean > average.upper)[known].mean()),
        "covariances too large": float((average.mean < average.lower)[known].mean()),
    }
    word, share = max(outside.items(), key=lambda each: each[1])
    if share <= _OFTEN:
        return Diagnostic(name, meaning, f"{middle:.2f}", "ok")
    return Diagnostic(name, meaning, f"{middle:.2f}, {word} at {percent(share)} of scans", "check")


def _worst_estimate(strategy: Strategy) -> Diagnostic:
    name = "Largest NEES / 2"
    meaning = "The estimate that is worst for its covariance, with its run and time; 1 is consistent."
    spread = nees_spread(strategy) if strategy.ensemble.measures else None
    if spread is None:
        return Diagnostic(name, meaning, _NONE, "ok")
    text = f"{spread.largest:.4g} in run {spread.run} at {spread.time:g} s"
    return Diagnostic(name, meaning, text, "ok" if spread.is_by_chance else "check")
