"""Checks of arguments. Each raises `InputError` with the field, the expected and the given value."""

import inspect
import math
import numbers
import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cache
from typing import Any, Protocol, TypeGuard

import numpy as np
from numpy.typing import NDArray

from vedette.errors import InputError
from vedette.internal.covariances import covariance_fault
from vedette.internal.text import plain, printable
from vedette.internal.unit_warnings import warn_implausible
from vedette.kernels.base.types import HEADING, Floats

_MAX_COUNT = 2**62
_MOST_STATE_DIMENSIONS = 10_000


def reject(field: str, expected: str, got: Any) -> InputError:
    """Return the error for an invalid argument. A long value is shortened."""
    text = printable(got if isinstance(got, str) else plain(got))
    if not isinstance(got, str) and " at 0x" in text:  # the address of an object does not describe it
        text = " ".join([f"a {type(got).__name__}", *([got.__qualname__] if hasattr(got, "__qualname__") else [])])
    return InputError(f"{field}: expected {expected}; got {text if len(text) <= 200 else text[:197] + '...'}")


def real(field: str, value: Any) -> float:
    """Return the value as a float. It must be a finite real number."""
    try:
        number = math.nan if isinstance(value, bool) or not isinstance(value, numbers.Real) else float(value)
    except OverflowError:  # a whole number of hundreds of digits
        number = math.inf
    if not math.isfinite(number):
        raise reject(field, "a finite number", value)
    return number


def is_infinite(value: Any) -> bool:
    """Return True for the float infinity, which stands for no limit."""
    return isinstance(value, float) and value == math.inf


def positive(field: str, value: Any) -> float:
    """Return the value as a float. It must be finite and above 0."""
    if real(field, value) <= 0.0:
        raise reject(field, "a number above 0", value)
    return float(value)


def non_negative(field: str, value: Any) -> float:
    """Return the value as a float. It must be finite and at least 0."""
    if real(field, value) < 0.0:
        raise reject(field, "a number of at least 0", value)
    return float(value)


def probability(field: str, value: Any) -> float:
    """Return the value as a float. It must be in [0, 1]."""
    if not 0.0 <= real(field, value) <= 1.0:
        raise reject(field, "a probability in [0, 1]", value)
    return float(value)


def chance(field: str, value: Any) -> float:
    """Return the value as a float. It must be above 0 and below 1."""
    if not 0.0 < real(field, value) < 1.0:
        raise reject(field, "a probability above 0 and below 1", value)
    return float(value)


def one_of(field: str, value: Any, words: Collection[str]) -> str:
    """Return the value. It must be one of these words."""
    if not isinstance(value, str) or value not in words:
        raise reject(field, f"one of {', '.join(words)}", value)
    return value


def flag(field: str, value: Any) -> bool:
    """Return the value as a bool. It must be true or false."""
    if not isinstance(value, bool | np.bool_):
        raise reject(field, "true or false", value)
    return bool(value)


def provides(value: object, protocol: Any) -> TypeGuard[Any]:
    """Return what `isinstance` returns for a protocol, ten times faster before Python 3.12, for use in loops."""
    for name in protocol_members(protocol):  # noqa: SIM110  # a generator needs one more call per name
        if getattr(value, name, None) is None:
            return False
    return True


@cache
def protocol_members(protocol: type) -> tuple[str, ...]:
    """Return the names of the methods, properties and attributes of a protocol, in the order of their definition."""
    bases = [base for base in protocol.__mro__ if base.__dict__.get("_is_protocol", False) and base is not Protocol]
    names = (name for base in reversed(bases) for name in (*vars(base), *inspect.get_annotations(base)))
    return tuple(dict.fromkeys(name for name in names if name == "__call__" or not name.startswith("_")))


def instance(field: str, value: Any, kind: type) -> None:
    """Raise unless `value` is an instance of the class, or implements the protocol."""
    if not (provides(value, kind) if getattr(kind, "_is_protocol", False) else isinstance(value, kind)):
        article = "an" if kind.__name__[0] in "AEIOU" else "a"
        raise reject(field, f"{article} {kind.__name__}", None if value is None else type(value).__name__)


def sequence(field: str, values: Any, expected: str) -> tuple[Any, ...]:
    """Return the items of a list, tuple, array or iterator. Texts and mappings are rejected."""
    if isinstance(values, str | bytes | Mapping) or not isinstance(values, Iterable):
        raise reject(field, expected, values)
    if isinstance(values, np.ndarray) and values.ndim == 0:
        raise reject(field, expected, values)
    return tuple(values)


def one_a_sensor(num_sensors: int, **fields: Any) -> None:
    """Raise unless each field is a list, tuple or array with one item per sensor."""
    for field, values in fields.items():
        if isinstance(values, list | tuple) and len(values) == num_sensors:  # the fast path, at every scan
            continue
        if not isinstance(values, Sequence | np.ndarray) or isinstance(values, str | bytes):
            raise reject(field, f"{num_sensors}, one a sensor", None if values is None else type(values).__name__)
        num_values = 0 if isinstance(values, np.ndarray) and values.ndim == 0 else len(values)
        if num_values != num_sensors:
            raise reject(field, f"{num_sensors}, one a sensor", num_values)


def dimension(field: str, value: Any) -> int:
    """Return the value as an int. It must be a whole number from 1 to 2^62, the largest for kernels."""
    if isinstance(value, bool) or not isinstance(value, numbers.Integral) or value < 1:
        raise reject(field, "a whole number of at least 1", value)
    if int(value) > _MAX_COUNT:
        raise reject(field, "a whole number of at most 2^62", value)
    return int(value)


def count(field: str, value: Any) -> int:
    """Return the value as an int. It must be a whole number of at least 0."""
    if isinstance(value, bool) or not isinstance(value, numbers.Integral) or value < 0:
        raise reject(field, "a whole number of at least 0", value)
    return int(value)


def no_gaussians(state_dim: Any) -> tuple[Floats, Floats]:
    """Return (0, state_dim) means and (0, state_dim, state_dim) covariances, and raise for an invalid `state_dim`."""
    dim = dimension("state_dim", state_dim)
    if dim > _MOST_STATE_DIMENSIONS:
        raise reject("state_dim", f"a whole number of at most {_MOST_STATE_DIMENSIONS}", state_dim)
    return np.empty((0, dim)), np.empty((0, dim, dim))


def step_number(value: Any) -> int:
    """Return the value as the number of a step. It must be a whole number from 1 on that labels can hold."""
    whole = not isinstance(value, bool) and isinstance(value, numbers.Integral)
    if not whole or not 1 <= value < 2**63:
        raise reject("step", "a whole number from 1 on, below 2^63", value)
    return int(value)


def generator(value: Any) -> np.random.Generator:
    """Return the random generator. A seed is rejected, because each call with it would get the same numbers."""
    if not isinstance(value, np.random.Generator):
        raise reject("rng", "a numpy.random.Generator, such as numpy.random.default_rng(1)", value)
    return value


def as_array(field: str, values: Any, kinds: str, expected: str) -> NDArray[Any]:
    """Return `values` as an array of one of these `numpy.dtype` kinds (an empty array may have any kind).

    Raises `InputError` for values that cannot be converted without loss: masked entries, imaginary parts, booleans,
    texts, objects, rows of different lengths.
    """
    if type(values) is not np.ndarray and _is_masked(values):
        raise reject(field, f"{expected} without masked entries", "masked ones")
    try:
        array = np.asarray(values)
    except (TypeError, ValueError, OverflowError):
        raise reject(field, expected, values) from None
    if array.size and array.dtype.kind not in kinds:
        raise reject(field, expected, f"an array of {array.dtype}")
    return array


def _is_masked(values: Any) -> bool:
    """Return True if NumPy would drop a mask of the array, or of an array in a list."""
    masks = sys.modules.get("numpy.ma")  # without this module there are no masked arrays
    if masks is not None and isinstance(values, list | tuple):
        return any(_is_masked(value) for value in values if isinstance(value, list | tuple | masks.MaskedArray))
    return masks is not None and isinstance(values, masks.MaskedArray) and bool(masks.is_masked(values))


def float_array(field: str, values: Any, shape: tuple[int | None, ...], *, finite: bool = True) -> Floats:
    """Return a C-contiguous, writeable float64 copy of `values` with the given shape (None: any length).

    NaN is never accepted. Infinities are accepted only if `finite` is false.
    """
    if type(values) is np.ndarray and values.dtype == np.float64:
        given = values
    else:
        given = as_array(field, values, "fiu", f"numbers in an array of shape {_shape_text(shape)}")
    fits = given.ndim == len(shape)
    for expected_length, length in zip(shape, given.shape, strict=False):
        fits = fits and expected_length in (None, length)
    if not fits:
        raise reject(field, f"an array of shape {_shape_text(shape)}", f"shape {given.shape}")
    array = np.array(given, dtype=np.float64, order="C")
    # If the sum of squares is finite, all numbers are: one call. Otherwise some may only be too large to be squared.
    lacks_none = math.isfinite(np.vdot(array, array)) if finite else not np.isnan(array).any()
    if not (lacks_none or (finite and np.isfinite(array).all())):
        raise reject(field, "finite numbers" if finite else "numbers that are not NaN", values)
    return array


def _shape_text(shape: tuple[int | None, ...]) -> str:
    return str(tuple("any" if length is None else length for length in shape)).replace("'any'", "any")


def params_vector(field: str, values: Any) -> Floats:
    """Return the parameter vector of a model function: any length, infinities allowed."""
    return float_array(field, values, (None,), finite=False)


def pose_vector(field: str, values: Any) -> Floats:
    """Return a sensor pose [px, py, heading_rad, ...] as an array, and warn of a heading that looks like degrees."""
    pose = float_array(field, values, (None,))
    if len(pose) < 3:
        raise reject(field, "an array of shape (3 or more,)", f"shape {pose.shape}")
    if abs(pose[HEADING]) >= 10.0:
        warn_if_degrees(field, float(pose[HEADING]))
    return pose


def warn_if_degrees(field: str, heading: float) -> None:
    """Warn of a heading that looks like degrees: a whole number whose size is from 10 to 720."""
    if 10.0 <= abs(heading) <= 720.0 and heading == round(heading):
        degrees = f"{heading:g} degrees are {math.radians(heading):.4f} rad"
        warn_implausible(field, "a heading in radians", f"{heading:g}, a whole number", degrees)


def state_table(field: str, values: Any, state_dim: int | None = None) -> Floats:
    """Return the states as an (n, state_dim) array. A single state may be given as a vector."""
    array = as_array(field, values, "fiu", "numbers, one state a row")
    if array.ndim == 1 and array.size:
        return float_array(field, array[np.newaxis], (1, state_dim))
    return float_array(field, array, (None, state_dim))


def positive_definite(field: str, matrix: Floats) -> None:
    """Raise unless `matrix` is symmetric positive definite, with variances that can be squared."""
    fault = covariance_fault(matrix)
    if fault is not None:
        raise reject(field, fault[0], f"{fault[1]}, in {plain(matrix)}")
