"""The command that runs a scenario once, and helpers of commands that simulate."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from vedette.cli.compiling import compiling
from vedette.cli.completing import strategies
from vedette.cli.documents import run_document
from vedette.cli.errors import INTERRUPTED, option_errors, usage_error
from vedette.cli.options import Overwrite, ScenarioName, Seed, Trust
from vedette.cli.output import echo, echo_error, emit_json, note
from vedette.cli.run_summary import print_run
from vedette.cli.scenario_files import print_warnings
from vedette.errors import InputError
from vedette.internal.extras import require_packages
from vedette.internal.text import pluralise

if TYPE_CHECKING:
    from vedette.evaluation.fit import Fit
    from vedette.scenarios import Scenario
    from vedette.simulation.journal import RunInterrupted, RunStopped
    from vedette.simulation.records import RunRecord


def compile_if_cold(scenario: Scenario, planners: Sequence[str] = ("jdm",)) -> None:
    """Compile the kernels of a simulation and its planners in two processes, if no kernel is compiled yet."""
    from vedette.kernels.base.cache_paths import is_cold

    if scenario.model.recording is None and is_cold():
        from vedette.evaluation.precompile import precompile

        with compiling():
            precompile(scenario, planners)


@contextmanager
def interruptible(advice: str) -> Iterator[None]:
    """Convert Ctrl-C into a line with advice and the shell's usual exit status."""
    try:
        yield
    except KeyboardInterrupt:
        echo_error(f"\ninterrupted: {advice}")
        raise typer.Exit(INTERRUPTED) from None


def check_out(out: Path | None, overwrite: bool) -> tuple[int, ...]:
    """Check the folder of `--out`, if it is given, and return the identity of the run in it."""
    from vedette.simulation.storage import check_target

    with option_errors({"directory": "--out"}):
        return () if out is None else check_target(out, overwrite)


def unchanged_out(out: Path | None, overwrite: bool, identity: tuple[int, ...]) -> Path | None:
    """Return the folder of `--out`, or a new one if another process has written there since it was checked."""
    from vedette.simulation.storage import unchanged_target

    folder = None if out is None else unchanged_target(out, overwrite, identity)
    if folder != out:
        note(f"--out: {out} has changed since this command started; it is kept, and the results go to {folder}")
    return folder


def save_unfinished(record: RunRecord, scenario: Scenario, fit: Fit | None, folder: Path, overwrite: bool) -> None:
    """Write a run into the folder of `--out`, and mark it until `finishing`."""
    from vedette.scenarios.dumping import dump_stored
    from vedette.simulation.storage import save_run

    text, found = dump_stored(scenario), None if fit is None else fit.to_dict()
    with option_errors({"directory": "--out"}):
        save_run(record, folder, scenario_text=text, fit=found, overwrite=overwrite, unfinished=True)


@contextmanager
def finishing(folder: Path, what: str) -> Iterator[None]:
    """Remove the mark of an unfinished folder after the last of its files. Ctrl-C leaves it."""
    from vedette.simulation.storage import UNFINISHED

    with interruptible(f"wrote {folder}, but not all of its {what}; the same command starts anew"):
        yield
        (folder / UNFINISHED).unlink(missing_ok=True)


class CodeTrust:
    """Check of a scenario's code: reports it once before it runs, and rejects code of others unless trusted.

    Code counts as that of others if other users may have written it. With `spec`, the campaign's file must be the
    user's own too, because its fields can name code.
    """

    def __init__(self, trust: bool, spec: Path | None = None) -> None:
        self._trust = trust
        self._spec = spec
        self._reported: set[str] = set()

    def __call__(self, scenario: Scenario) -> None:
        from vedette.scenarios.trust import custom_code, foreign_code_reason, foreign_write_reason

        code = custom_code(scenario.model)
        if not code:
            return
        reason = foreign_code_reason(scenario) or (foreign_write_reason(self._spec) if self._spec is not None else "")
        if reason and not self._trust:
            raise InputError(
                f"scenario {scenario.path or scenario.name}: expected code of your own; it runs {', '.join(code)}, and "
                f"{reason}: read it, and have it run by --allow-code"
            )
        if new := [name for name in code if name not in self._reported]:
            note(f"runs code of {'theirs, as trusted' if reason else 'yours'}: {', '.join(new)}")
            self._reported.update(new)


def check_planner(scenario: Scenario, name: str, option: str) -> None:
    """Raise a usage error unless the option names a strategy of the scenario."""
    from vedette.scenarios.sections.planners import STRATEGIES

    names = (*STRATEGIES, *scenario.model.planners)
    if name not in names:
        raise usage_error(f"expected one of {', '.join(names)}; got {name!r}", option)


PlannerName = Annotated[
    str,
    typer.Option(
        "--planner",
        help="jdm (joint), idm (independent), lookahead (joint, several decisions), nearest, assigned_target, "
        "centroid (rules of thumb), oracle and true_targets (know the targets), random, constant (first course), "
        "stationary, or the scenario's own.",
        autocompletion=strategies,
    ),
]
RunNumber = Annotated[int, typer.Option("--run", min=0, help="Number of the run.")]
Out = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Folder for the results and figures; none: only print.")
]
Threads = Annotated[int, typer.Option("--threads", min=0, help="Threads a decision; 0: one a processor.")]


def run(
    scenario: ScenarioName,
    planner: PlannerName = "jdm",
    seed: Seed = 0,
    run_number: RunNumber = 0,
    out: Out = None,
    overwrite: Overwrite = False,
    threads: Threads = 0,
    trust: Trust = False,
) -> None:
    """Run a scenario once: tracks, decisions with their rewards, errors, figures."""
    from vedette.evaluation.fit import fit_of_run
    from vedette.scenarios import load_scenario

    loaded = load_scenario(scenario)
    check_planner(loaded, planner, "--planner")
    CodeTrust(trust)(loaded)
    warnings = print_warnings(loaded)
    if out is not None:
        require_packages("vedette run --out", "matplotlib", "pyarrow")
    identity = check_out(out, overwrite)
    with interruptible("nothing was written"):
        record, stop = _simulate(loaded, planner, seed, run_number, threads)
        fit = None if loaded.model.recording is None else fit_of_run(record, loaded)
        print_run(record, loaded, fit, len(warnings))
        if stop is not None and _has_complete_run(out):
            emit_json({**run_document(record, loaded, fit), "folder": None})
            end_stopped(stop, f"{out} keeps the whole run that was there")
        saved_to = unchanged_out(out, overwrite, identity)
        if saved_to is not None:
            save_unfinished(record, loaded, fit, saved_to, overwrite)
    emit_json({**run_document(record, loaded, fit), "folder": saved_to})
    if saved_to is not None:
        with finishing(saved_to, "figures"):
            _draw_run(record, loaded, saved_to / "figures")
    if stop is not None:
        scans = pluralise(record.num_scans, "scan")
        end_stopped(stop, "nothing was written" if saved_to is None else f"wrote {saved_to}, with the {scans} before")
    if saved_to is not None:
        echo(f"wrote {saved_to}")


def _simulate(
    scenario: Scenario, planner: str, seed: int, run_number: int, threads: int
) -> tuple[RunRecord, RunStopped | RunInterrupted | None]:
    """Return the record of a run, and why it stopped early if it did. Exit if it stopped before the first scan."""
    from vedette.evaluation.runs import run_scenario
    from vedette.simulation.journal import RunInterrupted, RunStopped

    compile_if_cold(scenario)
    try:
        with compiling():
            return run_scenario(scenario, planner, seed=seed, run=run_number, num_threads=threads), None
    except (RunStopped, RunInterrupted) as error:
        if error.record is None:
            end_stopped(error, "nothing was written")
        return error.record, error


def _has_complete_run(folder: Path | None) -> bool:
    from vedette.simulation.storage import MANIFEST, read_manifest

    return folder is not None and (folder / MANIFEST).exists() and read_manifest(folder)["run"].get("stopped") is None


def end_stopped(stop: RunStopped | RunInterrupted, consequence: str) -> NoReturn:
    """Print where a run stopped and what is left of it, and exit with a status for the reason."""
    echo_error(str(stop))
    echo_error(consequence)
    raise typer.Exit(INTERRUPTED if isinstance(stop, KeyboardInterrupt) else 1) from None


def _draw_run(record: RunRecord, scenario: Scenario, folder: Path) -> None:
    from vedette.evaluation.figures import build_scene, reward_figure, save_figure, tracks_figure

    scene = build_scene(scenario, record.planner)
    save_figure(tracks_figure(record, scene=scene), folder / "tracks")
    for decision in record.decisions:
        if decision.plan.tables and any(len(actions) > 1 for actions in decision.plan.actions):
            save_figure(reward_figure(decision.plan, scene=scene), folder / f"rewards-{decision.time:g}s")
