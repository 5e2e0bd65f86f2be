"""Things of the user's own that a scenario names: imported, and called where they are functions."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, Field, JsonValue

from vedette.errors import InputError, VedetteError
from vedette.scenarios.sections.base import Section, expected

_T = TypeVar("_T")
_REFERENCE = re.compile(r"([A-Za-z_]\w*(\.[A-Za-z_]\w*)*|[^:]+\.py):[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")


def _reference(value: str) -> str:
    if not _REFERENCE.fullmatch(value):
        raise expected('"package.module:attribute" or "file.py:attribute"')
    return value


class Custom(Section):
    """Something of the user's own, written in Python. Imported when a scenario is built, not when checked."""

    function: Annotated[str, AfterValidator(_reference)] = Field(
        description="Where it is: `package.module:attribute`, or `file.py:attribute` relative to the scenario file [-]."
    )
    arguments: dict[str, JsonValue] = Field(
        default={}, description="Keyword arguments, where the attribute is a function that returns the object [-]."
    )

    def imported(self, wanted: type[_T], folder: Path, field: str) -> _T:
        """The object that `function` names, or that the function of that name returns.

        This runs the user's code; checking a scenario does not.

        Args:
            wanted: class of the object.
            folder: what a `file.py` is relative to.
            field: name of the section, for messages.

        Raises:
            InputError: it cannot be imported or called, or is of another class.
        """
        name, _, attribute = self.function.rpartition(":")
        try:
            found: Any = _module(name, folder)
            for part in attribute.split("."):
                found = getattr(found, part)
            if isinstance(found, type) or (not isinstance(found, wanted) and callable(found)):
                found = found(**self.arguments)
            elif self.arguments:
                raise InputError(f"{field}.arguments: expected none, as {self.function} is no function")
        except VedetteError:
            raise
        except Exception as error:
            raise self._not_given(wanted, field, f"{type(error).__name__}: {error}") from error
        if not isinstance(found, wanted):
            raise self._not_given(wanted, field, f"a {type(found).__name__}")
        return found

    def _not_given(self, wanted: type, field: str, got: str) -> InputError:
        return InputError(f"{field}.function: expected {self.function} to give a {wanted.__name__}; got {got}")


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
