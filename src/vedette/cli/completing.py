"""Shell completion of names of scenarios, campaigns and strategies, and of files that can replace them.

A scenario is read only to complete its own strategies. Completion never raises an error.
"""

from collections.abc import Iterable
from pathlib import Path

import typer

_PACKAGE = Path(__file__).parents[1]


def scenarios(incomplete: str) -> list[str]:
    """Return matching built-in scenarios and scenario files."""
    return _matching(incomplete, _builtin_names("scenarios", "yaml")) + _files(incomplete, (".yaml", ".yml"))


def built_in_scenarios(incomplete: str) -> list[str]:
    """Return matching built-in scenarios."""
    return _matching(incomplete, _builtin_names("scenarios", "yaml"))


def campaigns(incomplete: str) -> list[str]:
    """Return matching built-in campaigns and campaign files."""
    return _matching(incomplete, _builtin_names("campaigns", "toml")) + _files(incomplete, (".toml",))


def reproducible(incomplete: str) -> list[str]:
    """Return matching arguments of `vedette reproduce`."""
    return _matching(incomplete, _builtin_names("campaigns", "toml")) + scenarios(incomplete)


def strategies(context: typer.Context, incomplete: str) -> list[str]:
    """Return matching strategies, including those of the scenario or comparison that the command line names."""
    return _matching(incomplete, _strategies(_first_argument(context)))


def lists_of_strategies(context: typer.Context, incomplete: str) -> list[str]:
    """Return completions of the last strategy in a list separated by commas."""
    before, comma, last = incomplete.rpartition(",")
    chosen = before.split(",")
    names = (name for name in _strategies(_first_argument(context)) if name not in chosen)
    return [f"{before}{comma}{name}" for name in _matching(last, names)]


def _first_argument(context: typer.Context) -> str | None:
    """Return the first argument on the command line, perhaps incomplete and not parsed yet, or None without one."""
    return next((each for each in context.args if not each.startswith("-")), None)


def _strategies(scenario: str | None) -> tuple[str, ...]:
    from vedette.errors import VedetteError
    from vedette.scenarios import load_scenario
    from vedette.scenarios.sections.planners import STRATEGIES

    try:
        return (*STRATEGIES, *(load_scenario(scenario).model.planners if scenario else ()))
    except VedetteError:
        return tuple(STRATEGIES)


def _builtin_names(package: str, ending: str) -> list[str]:
    return sorted(file.stem for file in (_PACKAGE / package / "builtin").glob(f"*.{ending}"))


def _matching(start: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if name.startswith(start)]


def _files(start: str, endings: tuple[str, ...]) -> list[str]:
    """Return the folders, and files with these endings, whose paths begin with `start`."""
    folder, name = start[: start.rfind("/") + 1], start[start.rfind("/") + 1 :]
    try:
        paths = sorted(Path(folder or ".").iterdir())
    except (OSError, ValueError):
        return []
    matching = [path for path in paths if path.name.startswith(name) and (name or not path.name.startswith("."))]
    return [
        f"{folder}{path.name}{'/' * path.is_dir()}"
        for path in matching
        if path.is_dir() or path.suffix.lower() in endings
    ]
