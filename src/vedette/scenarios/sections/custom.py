"""Custom objects that a scenario names: import, construction, and checks against their protocol."""

import hashlib
import importlib
import importlib.util
import inspect
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, Field, JsonValue

from vedette.errors import InputError, VedetteError
from vedette.scenarios.diagnostics import Path as Places
from vedette.scenarios.sections.base import Section, expected, sections_in

_REFERENCE = re.compile(r"([A-Za-z_]\w*(\.[A-Za-z_]\w*)*|[^:]+\.py):[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")


def _reference(value: str) -> str:
    if not _REFERENCE.fullmatch(value):
        raise expected('"package.module:attribute" or "file.py:attribute"')
    return value


class MissingMember(InputError):
    """Custom code that does not return the expected object.

    Attributes:
        section: that names it.
        key: of the section at which the fault is.
        wanted, got: expected and given value.
    """

    def __init__(self, section: "Custom", key: str, wanted: str, got: str) -> None:
        super().__init__(f"{section.field}.{key}: expected {wanted}; got {got}")
        self.section, self.key, self.wanted, self.got = section, key, wanted, got


class Custom(Section):
    """Something of the user's own, written in Python: an object, or a class or function that makes it.

    What `function` names is taken as it is where it meets the protocol; a class or another function is called with
    `arguments` and, of the parts that there are for its kind, those that it has parameters for.
    """

    function: Annotated[str, AfterValidator(_reference)] = Field(
        description="Where it is: `package.module:attribute`, or `file.py:attribute` relative to the scenario file [-]."
    )
    gives: ClassVar[str]  # module:name of the class or protocol of the object; importing it imports the compiler
    spared: ClassVar[tuple[str, ...]] = ()  # optional members of the protocol
    arguments: dict[str, JsonValue] = Field(
        default={}, description="Keyword arguments, where the attribute is a class or function that is called [-]."
    )

    @property
    def field(self) -> str:
        """Name of its field in a word, for messages."""
        return type(self).__name__.removeprefix("Custom").lower()

    @property
    def code(self) -> str:
        """Description of the code that it runs."""
        return self.function

    def files(self, folder: Path) -> tuple[str, ...]:
        """Return the Python file that it names, if any."""
        name = self.function.rpartition(":")[0]
        return (name,) if name.endswith(".py") else ()

    @classmethod
    def protocol(cls) -> type:
        """Return the class or protocol of the object."""
        module, _, name = cls.gives.partition(":")
        found: type = getattr(importlib.import_module(module), name)
        return found

    def load_object(self, folder: Path) -> Any:
        """Return the object that `function` names; importing it runs custom code.

        Raises `MissingMember` if that fails.
        """
        name, _, attribute = self.function.rpartition(":")
        try:
            custom: Any = _module(name, folder)
            for part in attribute.split("."):
                custom = getattr(custom, part)
        except VedetteError:
            raise
        except Exception as error:
            raise self._not_given(f"{type(error).__name__}: {error}") from error
        return custom

    def instantiate(self, folder: Path, **parts: Any) -> Any:
        """Return the object, made from `parts` if necessary. Raises `MissingMember` for an object of another kind."""
        custom, wanted = self.load_object(folder), self.protocol()
        as_it_is = not isinstance(custom, type) and (_is_function(wanted) or not self.protocol_mismatch(custom))
        try:
            if as_it_is and _is_function(wanted) and self.arguments:
                custom = partial(custom, **self.arguments)
            elif as_it_is and self.arguments:
                got = ", ".join(self.arguments)
                raise MissingMember(self, "arguments", f"none, as {self.function} is no class and no function", got)
            elif not as_it_is and callable(custom):
                custom = custom(**matching_parts(custom, parts), **self.arguments)
        except VedetteError:
            raise
        except Exception as error:
            raise self._not_given(f"{type(error).__name__}: {error}") from error
        if fault := self.protocol_mismatch(custom):
            raise self._not_given(fault)
        return custom

    def protocol_mismatch(self, custom: object) -> str:
        """Return in words how an object fails its protocol; empty if it meets it."""
        return missing_members(custom, self.protocol(), self.spared)

    def _not_given(self, got: str) -> MissingMember:
        return MissingMember(self, "function", f"{self.function} to give a {self.protocol().__name__}", got)


def custom_objects(section: Section) -> Iterator[tuple[Places, Custom]]:
    """Return every custom object in a section, with its path."""
    return ((path, found) for path, found in sections_in(section) if isinstance(found, Custom))


def _is_function(wanted: type) -> bool:
    return "__call__" in vars(wanted)


def matching_parts(factory: Any, parts: dict[str, Any]) -> dict[str, Any]:
    """Return the parts for which a class or function has parameters."""
    try:
        parameters = inspect.signature(factory).parameters
    except (ValueError, TypeError):  # some functions written in C have no signature
        return {}
    if inspect.Parameter.VAR_KEYWORD in [parameter.kind for parameter in parameters.values()]:
        return parts
    return {name: part for name, part in parts.items() if name in parameters}


def missing_members(custom: Any, wanted: type, spared: Sequence[str] = ()) -> str:
    """Return in words how an object fails a class or protocol, except in the members `spared`; empty if it does not."""
    if not getattr(wanted, "_is_protocol", False):
        return "" if isinstance(custom, wanted) else f"a {type(custom).__name__}"
    from vedette.models.arguments import protocol_members

    kind = f"a {type(custom).__name__}"
    for name in protocol_members(wanted):
        if name in spared:
            continue
        member = inspect.getattr_static(wanted, name, None)  # an attribute without a default has none
        if not hasattr(custom, name):
            return f"{kind} without {_signature_text(name, member)}"
        own = custom if name == "__call__" else getattr(custom, name)
        if inspect.isfunction(member) and not _accepts_call(own, member):
            return f"{kind} that cannot be called as {_signature_text(name, member)}"
    return ""


def _parameters(member: Any) -> list[inspect.Parameter]:
    return list(inspect.signature(member).parameters.values())[1:]


def _signature_text(name: str, member: Any) -> str:
    if not inspect.isfunction(member):
        return name
    plain = [each.replace(annotation=inspect.Parameter.empty) for each in _parameters(member)]
    return f"{name.replace('__call__', '')}{inspect.Signature(plain)}"


def _accepts_call(own: Any, member: Any) -> bool:
    """Return True if a method accepts the protocol's call: keyword-only arguments by name, the others in order."""
    if not callable(own):
        return False
    parameters = _parameters(member)
    by_name = {each.name: None for each in parameters if each.kind is each.KEYWORD_ONLY}
    in_order = [None] * (len(parameters) - len(by_name))
    try:
        inspect.signature(own).bind(*in_order, **by_name)
    except TypeError:
        return False
    except ValueError:  # written in C, or bound to arguments that it does not accept
        return not isinstance(own, partial)
    return True


def _module(name: str, folder: Path) -> ModuleType:
    if not name.endswith(".py"):
        return importlib.import_module(name)
    file = (folder / name).resolve()
    # Two scenarios in different folders may each have a `models.py`.
    unique = f"vedette_scenario_{file.stem}_{hashlib.sha256(str(file).encode()).hexdigest()[:12]}"
    if unique in sys.modules:
        return sys.modules[unique]
    spec = importlib.util.spec_from_file_location(unique, file)
    if spec is None or spec.loader is None:
        raise ImportError(f"{file} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[unique] = module
    try:
        with _neighbours(file.parent):
            spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[unique]
        raise
    return module


@contextmanager
def _neighbours(folder: Path) -> Iterator[None]:
    """Let a file import other files in its folder, hidden from files of the same names elsewhere."""
    before = set(sys.modules)
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        sys.path.remove(str(folder))
        for name in set(sys.modules) - before:
            file = getattr(sys.modules[name], "__file__", None)
            if file and "." not in name and folder in Path(file).resolve().parents[:2]:
                sys.modules[f"vedette_beside_{hashlib.sha256(file.encode()).hexdigest()[:12]}"] = sys.modules.pop(name)
