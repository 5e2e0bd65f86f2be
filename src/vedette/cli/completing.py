"""What a shell completes: names of scenarios, campaigns and strategies, and the files that may stand in their place.

Nothing here reads a scenario unless its own strategies are asked for, and nothing is ever an error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import typer

_PACKAGE = Path(__file__).parents[1]
Completion = Callable[[str], list[str]]


def scenarios(incomplete: str) -> list[str]:
    """Built-in scenarios and files of one's own."""
    return _beginning(incomplete, _names("scenarios", "yaml")) + _files(incomplete, (".yaml", ".yml"))


def built_in_scenarios(incomplete: str) -> list[str]:
    """Built-in scenarios alone."""
    return _beginning(incomplete, _names("scenarios", "yaml"))


def campaigns(incomplete: str) -> list[str]:
    """Campaigns that come with the program and files of one's own."""
    return _beginning(incomplete, _names("campaigns", "toml")) + _files(incomplete, (".toml",))


def reproducible(incomplete: str) -> list[str]:
    """What `vedette reproduce` takes."""
    return _beginning(incomplete, _names("campaigns", "toml")) + scenarios(incomplete)


def strategies(context: typer.Context, incomplete: str) -> list[str]:
    """Strategies, with those of the scenario or yardstick that the command already names."""
    return _beginning(incomplete, _strategies(_first(context)))


def lists_of_strategies(context: typer.Context, incomplete: str) -> list[str]:
    """The last of strategies with commas between them."""
    before, comma, last = incomplete.rpartition(",")
    given = before.split(",")
    names = (name for name in _strategies(_first(context)) if name not in given)
    return [f"{before}{comma}{name}" for name in _beginning(last, names)]


def one_of(*names: str) -> Completion:
    """These names."""
    return lambda incomplete: _beginning(incomplete, names)


def _first(context: typer.Context) -> str | None:
    """The argument that is there already; of a line that is not whole yet it may not be parsed."""
    return next((each for each in context.args if not each.startswith("-")), None)


def _strategies(scenario: str | None) -> tuple[str, ...]:
    from vedette.errors import VedetteError
    from vedette.scenarios import load_scenario
    from vedette.scenarios.sections.planners import STRATEGIES

    try:
        return (*STRATEGIES, *(load_scenario(scenario).model.planners if scenario else ()))
    except VedetteError:
        return tuple(STRATEGIES)


def _names(room: str, ending: str) -> list[str]:
    return sorted(file.stem for file in (_PACKAGE / room / "builtin").glob(f"*.{ending}"))


def _beginning(start: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if name.startswith(start)]


def _files(start: str, endings: tuple[str, ...]) -> list[str]:
    """Files of these endings, and folders, whose paths begin so."""
    folder, name = start[: start.rfind("/") + 1], start[start.rfind("/") + 1 :]
    try:
        found = sorted(Path(folder or ".").iterdir())
    except (OSError, ValueError):
        return []
    shown = [path for path in found if path.name.startswith(name) and (name or not path.name.startswith("."))]
    return [
        f"{folder}{path.name}{'/' * path.is_dir()}" for path in shown if path.is_dir() or path.suffix.lower() in endings
    ]
