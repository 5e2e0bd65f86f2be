"""Fuzzer of what Python code makes and calls: every public object, with something else at one or two arguments."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fuzz.mutations import JUNK, nudged, pick
from fuzz.objects import Data, everything
from fuzz.outcomes import bounded
from vedette.errors import VedetteError

pytestmark = [pytest.mark.fuzz, pytest.mark.filterwarnings("ignore::vedette.errors.ImplausibleWarning")]

OTHERS: list[Any] = [
    *(object(), np.nan, np.array([np.nan]), np.array(["a"]), np.array(1.0), np.zeros((2, 2)), np.float64(0.5), 1 + 2j),
    *(
        [None, None],
        [1.0, "a"],
        ("auto",),
        "auto",
        -5,
        7,
        -0.5,
        1.5,
        iter([0.5, 0.5]),
        inspect,
        (0.5, 0.5),
    ),
]
# Densities check their own, and more than these would work for a whole minute.
LARGEST = 1e6


def is_large(value: Any) -> bool:
    """Whether a number is valid where a count is wanted, and as such takes more than the machine has."""
    return isinstance(value, int | float) and not isinstance(value, bool) and LARGEST < abs(value) < 1e19


def spoilt(rng: np.random.Generator, arguments: Data) -> Data:
    changed = dict(arguments)
    for _ in range(int(rng.integers(1, 3))):
        name = pick(rng, list(arguments))
        values = [value for value in (*JUNK, *OTHERS) if not is_large(value)]
        changed[name] = nudged(rng, arguments[name]) if rng.random() < 0.2 else pick(rng, values)
        if is_large(changed[name]):
            changed[name] = arguments[name]
    return changed


def tried(call: Callable[[], Any]) -> Any:
    """What the call returns; None where it ends with an error of the library's that can be printed."""
    try:
        return call()
    except VedetteError as error:
        text = str(error)
    assert text.isprintable(), f"{text[:500]!r}"
    assert len(text) < 4000, f"{text[:500]!r}"
    return None


def test_examples_are_good() -> None:
    """What is spoilt is right before."""
    for made in everything().values():
        thing = made.make(**made.arguments)
        for name, arguments in made.calls:
            getattr(thing, name)(**arguments)


def test_objects_and_calls(try_cases: Callable[[Callable[[np.random.Generator], object], int], None]) -> None:
    examples = everything()

    def check(rng: np.random.Generator) -> None:
        name = pick(rng, list(examples))
        made = examples[name]
        called = bool(made.calls) and rng.random() < 0.5
        arguments = made.arguments if called else spoilt(rng, made.arguments)
        with bounded((name, arguments)), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                thing = tried(lambda: made.make(**arguments))
                for method, given in made.calls if thing is not None else ():
                    others = spoilt(rng, given) if called else given
                    tried(lambda method=method, others=others: getattr(thing, method)(**others))  # type: ignore[misc]
            except Exception as error:
                error.add_note(f"{name}: {arguments}")
                raise

    try_cases(check, 400)
