"""Shared parts of the sections: the strict base class, the types of fields, and the stand-in for unreadable values.

Each field's description ends with its unit in brackets; [-] is a number without a unit.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from inspect import isfunction
from itertools import chain
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    ValidationError,
    ValidationInfo,
    create_model,
    model_validator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from vedette.scenarios.diagnostics import Finding, Path, describe


class UnreadableValueError(Exception):
    """A check used a value that could not be read."""


class UnreadableValue:
    """A value that could not be read; any use of it raises `UnreadableValueError`.

    Attributes:
        errors: pydantic's errors of the value.
    """

    __slots__ = ("errors",)

    def __init__(self, errors: list[ErrorDetails]) -> None:
        self.errors = errors

    def _refuse(self, *_: Any) -> Any:
        raise UnreadableValueError

    __getattr__ = __getitem__ = __call__ = __iter__ = __len__ = __contains__ = __bool__ = __float__ = __index__ = (
        _refuse
    )
    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = __hash__ = __abs__ = __neg__ = _refuse
    __str__ = __repr__ = _refuse
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __pow__ = _refuse


# Squares and products of numbers in this range neither overflow nor underflow.
_SMALLEST, _LARGEST = 1e-30, 1e15


def expected(what: str, *, at: tuple[str | int, ...] = (), got: str = "") -> PydanticCustomError:
    """Return the error of a validator that expects `what`, at the field itself or at a place inside it with `got`."""
    return PydanticCustomError("expected", "expected {expected}", {"expected": what, "at": at, "got": got})


def _as_integer(value: Any) -> Any:
    # In YAML 1.2 `1e3` is a floating-point number; as a count it is 1000.
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _printable_name(value: str) -> str:
    if not value.strip() or not value.isprintable():
        raise expected("a name of one or more printable characters")
    return value


def _digest(value: str) -> str:
    if not re.fullmatch(r"[0-9a-f]{64}", value):
        raise expected("64 hexadecimal digits, 0 to 9 and a to f")
    return value


def _not_tiny(value: float) -> float:
    if 0.0 < value < _SMALLEST:
        raise expected(f"a number of at least {_SMALLEST:g}")
    return value


Whole = Annotated[int, BeforeValidator(_as_integer)]
Name = Annotated[str, AfterValidator(_printable_name)]
Sha256 = Annotated[str, AfterValidator(_digest)]
SHA256_FIELD = "SHA-256 that the file must have, as it is kept beside a run of it; none: any [-]."
# Types with the names of `vedette.models.fields`, and limits that are sensible in a file.
Count = Annotated[Whole, Field(ge=1, le=1_000_000_000)]
Natural = Annotated[Whole, Field(ge=0)]
Repeats = Annotated[Whole, Field(ge=0, le=1_000_000)]
Real = float
Positive = Annotated[float, Field(gt=0.0), AfterValidator(_not_tiny)]
NonNegative = Annotated[float, Field(ge=0.0)]
Probability = Annotated[float, Field(ge=0.0, le=1.0)]
Chance = Annotated[float, Field(gt=0.0, lt=1.0)]
Share = Annotated[float, Field(ge=0.0, lt=1.0)]
Portion = Annotated[float, Field(gt=0.0, le=1.0)]
L1Error = Annotated[float, Field(ge=0.0, le=2.0)]
EnoughSamples = Annotated[Count, Field(ge=24)]
Limit = Positive
HalfWidth = Annotated[float, Field(gt=0.0, le=180.0)]
Reals = Annotated[tuple[float, ...], Field(strict=False, min_length=1)]
Positives = Annotated[tuple[Positive, ...], Field(strict=False, min_length=1)]
PositivePair = Annotated[tuple[Positive, Positive], Field(strict=False)]
NonNegativePair = Annotated[tuple[NonNegative, NonNegative], Field(strict=False)]
# Lists in the file are tuples here; `strict=False` admits a list and leaves the items strict.
Numbers = Annotated[tuple[float, ...], Field(strict=False)]
Point = Annotated[tuple[float, float], Field(strict=False)]
Step = Annotated[Whole, Field(ge=1)]
Steps = Annotated[tuple[Step, ...], Field(strict=False)]
GaussianMethod = Literal["auto", "ekf", "ukf", "ckf"]
DetectionAt = Literal["centre", "mean"]


PARTIAL = {"in_part": True}  # validation context in which an unreadable value becomes an `UnreadableValue`

Check = Callable[[Any], Iterator[Finding]]


def check(findings: Check) -> Check:
    """Mark a method that yields faults of a section: paths inside it, and the expected and given values."""
    findings.is_check = True  # type: ignore[attr-defined] # a function takes attributes
    return findings


def readable_findings(findings: Callable[..., Iterator[Finding]], *arguments: Any) -> Iterator[Finding]:
    """Yield the findings for these arguments up to the first that needs a value that could not be read."""
    try:
        yield from findings(*arguments)
    except UnreadableValueError:
        return


def sections_in(value: Any) -> "list[tuple[Path, Section]]":
    """Return a section and all sections in it, each with its path, from the outside in, in the order of the fields."""
    sections: list[tuple[Path, Section]] = []
    pending: list[tuple[Path, Any]] = [((), value)]
    while pending:
        path, item = pending.pop()
        if isinstance(item, Section):
            sections.append((path, item))
            inner: Mapping[Any, Any] = {name: getattr(item, name) for name in type(item).model_fields}
        elif isinstance(item, tuple | dict):
            inner = dict(enumerate(item)) if isinstance(item, tuple) else item
        else:
            continue
        pending += [((*path, name), inner[name]) for name in reversed(inner)]
    return sections


def is_complete(value: Any) -> bool:
    """Return True if all of a section could be read."""
    if isinstance(value, Section):
        return all(is_complete(getattr(value, name)) for name in type(value).model_fields)
    return all(map(is_complete, value)) if isinstance(value, tuple) else not isinstance(value, UnreadableValue)


class Section(BaseModel):
    """A mapping of a configuration file: no unknown keys, no silent conversion of types, nothing infinite.

    A valid section is one whose fields are valid and whose `findings` are none. Read with the context `PARTIAL`, a
    faulty mapping is a section too, with `UnreadableValue` in place of what is faulty, so that all other checks can go
    on.
    """

    # Validators are built at first use: parts are never read separately, and building each of them took twice as long.
    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, validate_default=True, defer_build=True
    )

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        parents = [parent._checks for parent in reversed(cls.__bases__) if issubclass(parent, Section)]
        own = [method for method in vars(cls).values() if isfunction(method) and hasattr(method, "is_check")]
        cls._checks = tuple(dict.fromkeys([*chain(*parents), *own]))

    def findings(self) -> Iterator[Finding]:
        """Yield the faults of the section that no single field has."""
        for method in self._checks:
            yield from readable_findings(method, self)

    @check
    def _numbers_within_reason(self) -> Iterator[Finding]:
        for name in type(self).model_fields:
            pending: list[tuple[Path, Any]] = [((name,), getattr(self, name))]
            while pending:
                path, value = pending.pop()
                if isinstance(value, tuple):
                    pending += [((*path, index), value[index]) for index in reversed(range(len(value)))]
                elif isinstance(value, float | int) and abs(value) > _LARGEST:
                    yield path, f"a number from {-_LARGEST:g} to {_LARGEST:g}", describe(value)
                    break  # one fault for each field is enough

    _checks: ClassVar[tuple[Check, ...]] = (_numbers_within_reason,)

    @model_validator(mode="after")
    def _checked(self, info: ValidationInfo) -> Self:
        if info.context is not PARTIAL:
            for path, wanted, got in self.findings():
                raise expected(wanted, at=path, got=got)
        return self

    @classmethod
    def in_metres(cls, data: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the mapping with its places in metres, if it allows other units."""
        return data

    @classmethod
    def prepared(cls, data: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the mapping as its fields read it."""
        return data

    @model_validator(mode="wrap")
    @classmethod
    def _read(cls, data: Any, handler: ModelWrapValidatorHandler[Self], info: ValidationInfo) -> Any:
        if isinstance(data, Mapping):
            data = cls.prepared(data)
            if info.context is PARTIAL:
                return cls.model_construct(**{name: _read_field(cls, name, data) for name in cls.model_fields})
        elif info.context is PARTIAL and not isinstance(data, cls):
            try:
                return handler(data)
            except ValidationError as error:
                return UnreadableValue(error.errors(include_url=False))
        return handler(data)


def _read_field(section: type[Section], name: str, data: Mapping[str, Any]) -> Any:
    if name not in data and section.model_fields[name].is_required():
        return UnreadableValue([ErrorDetails(type="missing", loc=(), msg="", input=None)])
    given = {name: data[name]} if name in data else {}
    try:
        return getattr(_single_field_model(section, name).model_validate(given, context=PARTIAL), name)
    except ValidationError as error:
        return UnreadableValue([{**detail, "loc": detail["loc"][1:]} for detail in error.errors(include_url=False)])


@cache
def _single_field_model(section: type[Section], name: str) -> type[BaseModel]:
    """Return a model of one field of a section."""
    field = section.model_fields[name]
    return create_model("Alone", __config__=section.model_config, **{name: (field.annotation, field)})  # type: ignore[call-overload, no-any-return]
