"""Objects of the user's own that a scenario names: imported, and called where they are functions."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from vedette.errors import InputError, VedetteError
from vedette.scenarios.schema.base import Custom

_T = TypeVar("_T")


def build_custom(section: Custom, wanted: type[_T], folder: Path, field: str) -> _T:
    """The object that `section.python` names, or that the function of that name returns.

    This runs the user's code; checking a scenario does not.

    Args:
        section: names it, with its parameters.
        wanted: class of the object.
        folder: what a `file.py` is relative to.
        field: name of the section, for messages.

    Raises:
        InputError: it cannot be imported or called, or is of another class.
    """
    name, _, attribute = section.python.rpartition(":")
    try:
        found: Any = _module(name, folder)
        for part in attribute.split("."):
            found = getattr(found, part)
        if not isinstance(found, wanted) and callable(found):
            found = found(**section.arguments)
        elif section.arguments:
            raise InputError(f"{field}.arguments: expected none, as {section.python} is no function")
    except VedetteError:
        raise
    except Exception as error:
        raise _not_given(section, wanted, field, f"{type(error).__name__}: {error}") from error
    if not isinstance(found, wanted):
        raise _not_given(section, wanted, field, f"a {type(found).__name__}")
    return found


def _not_given(section: Custom, wanted: type, field: str, got: str) -> InputError:
    return InputError(f"{field}.python: expected {section.python} to give a {wanted.__name__}; got {got}")


def _module(name: str, folder: Path) -> ModuleType:
    if not name.endswith(".py"):
        return importlib.import_module(name)
    file = (folder / name).resolve()
    # Two scenarios may each have a `models.py` beside them.
    unique = f"vedette_scenario_{file.stem}_{hashlib.sha256(str(file).encode()).hexdigest()[:12]}"
    if unique in sys.modules:
        return sys.modules[unique]
    spec = importlib.util.spec_from_file_location(unique, file)
    if spec is None or spec.loader is None:
        raise ImportError(f"{file} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[unique] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[unique]
        raise
    return module
