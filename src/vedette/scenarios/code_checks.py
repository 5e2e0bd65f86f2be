"""Checks of the custom code that a scenario names: import it and build its parts."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from vedette.errors import VedetteError
from vedette.filters import has_labels
from vedette.scenarios.build import build_experiment, build_planner, build_sensors, build_tracking
from vedette.scenarios.diagnostics import Diagnostic
from vedette.scenarios.loading import Scenario, locate_fault, read_document
from vedette.scenarios.sections.custom import MissingMember, custom_objects
from vedette.simulation.journal import RunStopped, error_cause
from vedette.simulation.loop import simulate

_SCANS = 3  # scans that are tried: enough for a missing one, and one after births
# These are made of other parts and are built together with the whole scenario.
_COMPOSITE_PARTS = ("filter", "fusion", "central", "planner")


def code_faults(scenario: Scenario) -> list[str]:
    """Return the faults of the custom code that a scenario names, with file, line and column, in file order.

    Imports and runs that code: builds its parts and, if all parts can be built, tracks for two or three scans.
    """
    diagnostics = list(dict.fromkeys(_diagnostics(scenario)))
    document = read_document(scenario)
    if document is None:
        return [f"{scenario.name}: {diagnostic.message}" for diagnostic in diagnostics]
    return [
        fault.message(document.file)
        for fault in sorted(locate_fault(document, diagnostic) for diagnostic in diagnostics)
    ]


def _diagnostics(scenario: Scenario) -> Iterator[Diagnostic]:
    with_paths = list(custom_objects(scenario.model))
    places = {id(section): path for path, section in with_paths}
    separate = [section for _, section in with_paths if section.field not in _COMPOSITE_PARTS]
    attempts: list[Callable[[], Any]] = [partial(section.instantiate, scenario.folder) for section in separate]
    attempts += [partial(build_planner, scenario, name) for name in scenario.model.planners]
    attempts += [partial(_plan, scenario), partial(_track, scenario)]
    for build in attempts:
        try:
            build()
        except MissingMember as fault:
            yield Diagnostic((*places[id(fault.section)], fault.key), fault.wanted, fault.got)
        except RunStopped as stop:
            cause = error_cause(stop.__cause__) if isinstance(stop.__cause__, Exception) else str(stop)
            yield Diagnostic((), "parts that fit together", f"in {stop.stage} at step {stop.step}: {cause}")
        except VedetteError as error:
            yield Diagnostic((), "parts that fit together", str(error))


def _plan(scenario: Scenario) -> None:
    """Build the planners that use the section `control`."""
    build_planner(scenario, "random")
    if has_labels(build_sensors(scenario)[0].filter):
        build_planner(scenario, "jdm")
        if scenario.model.control.lookahead is not None:
            build_planner(scenario, "lookahead")


def _track(scenario: Scenario) -> None:
    """Run the first scans without decisions; if sensors may be out of contact, first with all in contact."""
    network, attempts = scenario.model.network, [scenario]
    if network is not None:
        fully_connected = {"radio_range": None, "max_hops": None, "link_loss_probability": 0.0, "delay": 0}
        model = scenario.model.model_copy(update={"network": network.model_copy(update=fully_connected)})
        attempts.insert(0, replace(scenario, model=model))
    for each in attempts:
        if each.model.recording is not None:
            build_tracking(each).first(_SCANS).run(None)
        else:
            experiment = build_experiment(each)
            shortened = replace(experiment, times=experiment.times[:_SCANS], decision_steps=())
            simulate(shortened, None, seed=0, run=0, score=None)
