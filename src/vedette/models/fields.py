"""Types of the fields of a part, with their domains, for its constructor and for the scenario file.

`num_restarts: Natural = 2` in a dataclass is a field that its constructor checks (`Checked`), and that the section of
the same part in a scenario reads and describes (`vedette.scenarios.sections.derived`).
"""

import math
from collections.abc import Callable, Iterator
from functools import cache, partial
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeAlias, TypeVar, Union, get_args, get_origin, get_type_hints

from numpy.typing import ArrayLike

from vedette.models.arguments import (
    chance,
    count,
    dimension,
    flag,
    instance,
    is_infinite,
    non_negative,
    one_of,
    positive,
    probability,
    real,
    reject,
)

T = TypeVar("T")
# Smallest number of samples of a search and of the first round of a race (`vedette.control.racing`).
_LEAST_SAMPLES = 24


def _share(field: str, value: Any) -> float:
    if not 0.0 <= real(field, value) < 1.0:
        raise reject(field, "a number in [0, 1)", value)
    return float(value)


def _portion(field: str, value: Any) -> float:
    if not 0.0 < real(field, value) <= 1.0:
        raise reject(field, "a number above 0, up to 1", value)
    return float(value)


def half_width(field: str, value: Any) -> float:
    """Return the value as half the angle of a sector. It must be in (0, pi] rad."""
    if positive(field, value) > math.pi:
        raise reject(field, "an angle in radians, in (0, pi] (is it in degrees?)", value)
    return float(value)


def _l1_error(field: str, value: Any) -> float:
    if not 0.0 <= real(field, value) <= 2.0:
        raise reject(field, "a number from 0 to 2", value)
    return float(value)


def _enough_samples(field: str, value: Any) -> int:
    if dimension(field, value) < _LEAST_SAMPLES:
        raise reject(field, f"a whole number of at least {_LEAST_SAMPLES}", value)
    return int(value)


def _limit(field: str, value: Any) -> float:
    return math.inf if is_infinite(value) else positive(field, value)


Count = Annotated[int, dimension]  # at least 1
Natural = Annotated[int, count]  # at least 0
Repeats = Annotated[int, count]  # the same; in a file up to a million
Real = Annotated[float, real]
Positive = Annotated[float, positive]
NonNegative = Annotated[float, non_negative]
Probability = Annotated[float, probability]  # [0, 1]
Chance = Annotated[float, chance]  # (0, 1)
Share = Annotated[float, _share]  # [0, 1)
Portion = Annotated[float, _portion]  # (0, 1]
L1Error = Annotated[float, _l1_error]  # [0, 2], for densities that integrate to 1
EnoughSamples = Annotated[int, _enough_samples]  # enough to compare candidates
Limit = Annotated[float, _limit]  # above 0, or infinite; left out of a file if infinite
HalfWidth = Annotated[float, half_width]  # rad, in (0, pi]
Reals: TypeAlias = ArrayLike  # one or more
Positives: TypeAlias = ArrayLike  # the same, each above 0
PositivePair: TypeAlias = ArrayLike
NonNegativePair: TypeAlias = ArrayLike


def part(kind: str = "", room: str = "", **names: str) -> Callable[[T], T]:
    """Mark a class or a function as the part that `kind` selects in a section (`room`) of a scenario, such as "search".

    Without them, it is the part of a section that has one kind only. names: fields or parameters with another name in a
    file, by their key. An angle whose key ends in `_deg` is in degrees there.
    """

    def marked(made: T) -> T:
        return made

    return marked


def check_fields(made: Any, prefix: str = "") -> None:
    """Check the fields of a dataclass or named tuple against their types. Optional fields may be None.

    Types are those of this module, words, bool, and classes and protocols of the library. Others are not checked. A
    dataclass stores the checked numbers.

    Raises:
        InputError: an invalid field. The message has its name, the expected and the given value.
    """
    kind: type = type(made)
    for name, field, optional, check in _checks(kind, prefix):
        value = getattr(made, name)
        if value is not None or not optional:
            checked = check(field, value)
            if checked is not None and checked is not value and not isinstance(made, tuple):
                object.__setattr__(made, name, checked)


class Checked:
    """Base of dataclasses whose constructor checks their fields against their types (`check_fields`)."""

    __slots__ = ()

    def __post_init__(self) -> None:
        check_fields(self)


@cache
def _checks(kind: type, prefix: str) -> tuple[tuple[str, str, bool, Callable[[str, Any], Any]], ...]:
    return tuple((name, f"{prefix}{name}", optional, check) for name, optional, check in _found(kind))


def _found(kind: type) -> Iterator[tuple[str, bool, Callable[[str, Any], Any]]]:
    hints = get_type_hints(kind, include_extras=True)
    for name in kind.__match_args__:  # type: ignore[attr-defined]
        hint = hints[name]
        options = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
        choices = [option for option in options if option is not NoneType]
        choice, words = choices[0], get_args(choices[0])
        if len(choices) > 1:
            continue
        if get_origin(choice) is Annotated:
            yield name, NoneType in options, words[1]
        elif get_origin(choice) is Literal:
            yield name, NoneType in options, partial(one_of, words=words)
        elif choice is bool:
            yield name, NoneType in options, flag
        elif isinstance(choice, type) and choice.__module__.startswith("vedette."):
            yield name, NoneType in options, partial(instance, kind=choice)
