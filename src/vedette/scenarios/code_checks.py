"""Checks of the code of the user's own that a scenario names, by importing and making it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from vedette.errors import VedetteError
from vedette.scenarios.build import build_experiment, build_planner
from vedette.scenarios.faults import Told
from vedette.scenarios.file_checks import customs
from vedette.scenarios.loading import Scenario, document_of, place_fault
from vedette.scenarios.sections.custom import NotGiven

# These are made of other parts, and so as parts of the whole.
_MADE_OF_PARTS = ("filter", "fusion", "central", "planner")


def code_faults(scenario: Scenario) -> list[str]:
    """What the code that a scenario names lacks of what it is to give, with file, line and column, in file order.

    Imports and runs that code.
    """
    found = list(dict.fromkeys(_faults(scenario)))
    document = document_of(scenario)
    if document is None:
        return [f"{scenario.name}: {told.message}" for told in found]
    return [fault.message(document.file) for fault in sorted(place_fault(document, told) for told in found)]


def _faults(scenario: Scenario) -> Iterator[Told]:
    found = list(customs(scenario.model, ()))
    places = {id(section): path for path, section in found}
    alone = [section for _, section in found if section.field not in _MADE_OF_PARTS]
    attempts: list[Callable[[], Any]] = [partial(section.made, scenario.folder) for section in alone]
    attempts.append(partial(build_experiment, scenario))
    attempts += [partial(build_planner, scenario, name) for name in scenario.model.planners]
    for make in attempts:
        try:
            make()
        except NotGiven as fault:
            yield Told((*places[id(fault.section)], fault.key), fault.wanted, fault.got)
        except VedetteError as error:
            yield Told((), "parts that fit together", str(error))
