"""Checks of the custom code that a scenario names: import it and build its parts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from vedette.errors import VedetteError
from vedette.filters import has_labels
from vedette.scenarios.build import build_experiment, build_planner, build_sensors, build_tracking
from vedette.scenarios.faults import Told
from vedette.scenarios.loading import Scenario, document_of, place_fault
from vedette.scenarios.sections.custom import NotGiven, customs
from vedette.simulation.journal import RunStopped, error_cause
from vedette.simulation.loop import simulate

_SCANS = 3  # scans that are tried: enough for a missing one, and one after births
# These are made of other parts and are built together with the whole scenario.
_MADE_OF_PARTS = ("filter", "fusion", "central", "planner")


def code_faults(scenario: Scenario) -> list[str]:
    """Return the faults of the custom code that a scenario names, with file, line and column, in file order.

    Imports and runs that code: builds its parts and, if all parts can be built, tracks for two or three scans.
    """
    found = list(dict.fromkeys(_faults(scenario)))
    document = document_of(scenario)
    if document is None:
        return [f"{scenario.name}: {told.message}" for told in found]
    return [fault.message(document.file) for fault in sorted(place_fault(document, told) for told in found)]


def _faults(scenario: Scenario) -> Iterator[Told]:
    found = list(customs(scenario.model))
    places = {id(section): path for path, section in found}
    alone = [section for _, section in found if section.field not in _MADE_OF_PARTS]
    attempts: list[Callable[[], Any]] = [partial(section.made, scenario.folder) for section in alone]
    attempts += [partial(build_planner, scenario, name) for name in scenario.model.planners]
    attempts += [partial(_plan, scenario), partial(_track, scenario)]
    for make in attempts:
        try:
            make()
        except NotGiven as fault:
            yield Told((*places[id(fault.section)], fault.key), fault.wanted, fault.got)
        except RunStopped as stop:
            cause = error_cause(stop.__cause__) if isinstance(stop.__cause__, Exception) else str(stop)
            yield Told((), "parts that fit together", f"in {stop.stage} at step {stop.step}: {cause}")
        except VedetteError as error:
            yield Told((), "parts that fit together", str(error))


def _plan(scenario: Scenario) -> None:
    """Build the planners that use the section `control`."""
    build_planner(scenario, "random")
    if has_labels(build_sensors(scenario)[0].filter):
        build_planner(scenario, "jdm")
        if scenario.model.control.lookahead is not None:
            build_planner(scenario, "lookahead")


def _track(scenario: Scenario) -> None:
    """Run the first scans without decisions; if sensors may be out of contact, first with all in contact."""
    network, tried = scenario.model.network, [scenario]
    if network is not None:
        every = {"radio_range": None, "hops": None, "loss": 0.0, "delay": 0}
        model = scenario.model.model_copy(update={"network": network.model_copy(update=every)})
        tried.insert(0, replace(scenario, model=model))
    for each in tried:
        if each.model.recording is not None:
            build_tracking(each).first(_SCANS).run(None)
        else:
            experiment = build_experiment(each)
            few = replace(experiment, times=experiment.times[:_SCANS], decision_steps=())
            simulate(few, None, seed=0, run=0, score=None)
