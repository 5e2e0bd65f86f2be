"""What the sections of a scenario share: the strict base class and the types of their fields.

Each field's description ends with its unit in brackets; [-] is a number without a unit.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

# Squares and products of numbers in this range are numbers, too.
_SMALLEST, _LARGEST = 1e-30, 1e15


def expected(what: str, *, at: tuple[str | int, ...] = (), got: str = "") -> PydanticCustomError:
    """The error of a validator that wants `what`, at the field itself or a place inside it, where `got` is."""
    return PydanticCustomError("expected", "expected {expected}", {"expected": what, "at": at, "got": got})


def _whole(value: Any) -> Any:
    # In YAML 1.2 `1e3` is a floating-point number; where a count is wanted it is 1000.
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _word(value: str) -> str:
    if not value.strip() or not value.isprintable():
        raise expected("a name of one or more printable characters")
    return value


def _not_tiny(value: float) -> float:
    if 0.0 < value < _SMALLEST:
        raise expected(f"a number of at least {_SMALLEST:g}")
    return value


def _too_large(value: Any, path: tuple[str | int, ...]) -> tuple[str | int, ...] | None:
    """Path of the first number in a field that is beyond all sense, or None."""
    if isinstance(value, float | int):
        return path if abs(value) > _LARGEST else None
    if isinstance(value, tuple):
        found = (_too_large(item, (*path, index)) for index, item in enumerate(value))
        return next((place for place in found if place), None)
    return None


Whole = Annotated[int, BeforeValidator(_whole)]
Name = Annotated[str, AfterValidator(_word)]
Positive = Annotated[float, Field(gt=0.0), AfterValidator(_not_tiny)]
Probability = Annotated[float, Field(ge=0.0, le=1.0)]
# Lists in the file are tuples here; `strict=False` admits a list and leaves the items strict.
Numbers = Annotated[tuple[float, ...], Field(strict=False)]
SomeNumbers = Annotated[tuple[float, ...], Field(strict=False, min_length=1)]
Point = Annotated[tuple[float, float], Field(strict=False)]
Step = Annotated[Whole, Field(ge=1)]
Steps = Annotated[tuple[Step, ...], Field(strict=False)]
Count = Annotated[Whole, Field(ge=1, le=1_000_000_000)]
Share = Annotated[float, Field(ge=0.0, lt=1.0)]
Chance = Annotated[float, Field(gt=0.0, lt=1.0)]
GaussianMethod = Literal["auto", "ekf", "ukf", "ckf"]


class Section(BaseModel):
    """A mapping of the scenario file: no unknown keys, no silent conversion of types, nothing infinite."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False, validate_default=True)

    @model_validator(mode="after")
    def _within_reason(self) -> Self:
        for name in type(self).model_fields:
            path = _too_large(getattr(self, name), (name,))
            if path:
                raise expected(f"a number from {-_LARGEST:g} to {_LARGEST:g}", at=path)
        return self
