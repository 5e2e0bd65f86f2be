"""What all densities are: frozen bundles of arrays that are their own and read-only, checked when they are made.

Kernels go by a density's offsets and indices without looking, so that what was checked must stay as it was: a number
written into one of them later would have a kernel read memory that is not its own.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from operator import attrgetter
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from vedette.densities.inspection import Targets
from vedette.internal.representation import SummaryRepr, TabularRepr
from vedette.kernels.base.types import Floats

_Made = TypeVar("_Made", bound=SummaryRepr)


class Container(SummaryRepr):
    """A frozen dataclass of arrays and other containers.

    The arrays of its fields are read-only views of arrays that nobody else holds. Those are what kernels take (see
    `for_kernel`): a read-only array is of another type to Numba, which would compile everything anew for it.
    """

    __slots__ = ()

    def _own_arrays(self) -> None:
        """Take copies of the arrays that were given; for a public constructor, before its checks."""
        for name in self.__match_args__:  # type: ignore[attr-defined]
            value = getattr(self, name)
            if type(value) is np.ndarray:
                object.__setattr__(self, name, _held(np.array(value, order="C")))

    def with_fields(self, **changed: Any) -> Self:
        """The same with other values of some fields, which are the library's own; see `unchecked`."""
        names = self.__match_args__  # type: ignore[attr-defined]
        return unchecked(type(self), *(changed[name] if name in changed else getattr(self, name) for name in names))

    def __reduce__(self) -> tuple[Any, ...]:
        """Through the constructor and its checks: what is unpickled may have been written by anybody."""
        return type(self), tuple(getattr(self, name) for name in self.__match_args__)  # type: ignore[attr-defined]


class MultiTarget(Container, TabularRepr):
    """A density of a set of targets."""

    __slots__ = ()
    _weight: ClassVar[str] = "existence"  # what the weights of `_targets` are called

    @abstractmethod
    def _targets(self) -> Targets:
        """Its labels, or else its Bernoullis or components, with what each is worth and its mean and covariance."""

    def to_table(self) -> dict[str, list[Any]]:
        """A row a label, or else a Bernoulli or a component, by columns, as `pandas.DataFrame` takes them.

        `label` (`birth step.index`) where there are labels, `existence` (of an intensity's components
        `expected_number`), the likeliest `measurement` of the last scan (None: missed) where it is known (see
        `TrackTable`), mean and standard deviations as in the table of a run's tracks: `x_m`, `y_m`, `vx_mps`, `vy_mps`,
        `std_x_m` and so on, those of the marginal density.
        """
        return self._targets().columns(self._weight)

    def plot(self, ax: Any) -> None:
        """Draw places (m) into axes of Matplotlib, with ellipses of two standard deviations, and labels.

        What is unlikely is faint. Raises `InputError` for states of one number.
        """
        self._targets().draw(ax)

    def _detail(self) -> str:
        return self._targets().in_words()

    @property
    @abstractmethod
    def state_dim(self) -> int:
        """Length of a target's state."""

    @abstractmethod
    def cardinality(self) -> Floats:
        """Probabilities of 0, 1, ..., n targets; see `vedette.densities.cardinality_distribution`."""


def unchecked(container: type[_Made], *fields: Any) -> _Made:
    """A container (or what holds some) of the library's own making, whose checks would cost more than some steps.

    It takes arrays as they are: those that no caller of the library holds.
    """
    made = object.__new__(container)
    for name, value in zip(container.__match_args__, fields, strict=True):  # type: ignore[attr-defined]
        if type(value) is np.ndarray:
            if type(value.base) is not np.ndarray and value.flags.carray:  # most: without the call
                value = value.view()
                value.setflags(False)  # type: ignore[call-arg]  # by name it takes three times as long
            else:
                value = _held(value)
        object.__setattr__(made, name, value)
    return made


def for_kernel(array: NDArray[Any]) -> Any:
    """A container's array as kernels take it; an array that is nobody's field, as it is."""
    return array if array.flags.writeable else array.base


def kernel_arrays(*fields: str) -> Callable[[Container], tuple[Any, ...]]:
    """What takes the arrays of these fields (two or more) as kernels do; in a fraction of the time of `for_kernel`."""
    return attrgetter(*(f"{field}.base" for field in fields))


def _held(array: NDArray[Any]) -> NDArray[Any]:
    """An array as a field: as it is where it is one already, and without a copy where it stands alone."""
    base, flags = array.base, array.flags
    if type(base) is not np.ndarray:
        view = array.view() if flags.carray else np.array(array, order="C").view()
    elif not flags.writeable and array.size == base.size and array.strides == base.strides:
        return array
    else:  # a part of another, whose base is not of its shape
        view = np.array(array, order="C").view()
    view.setflags(False)  # type: ignore[call-arg]  # by name, or as an attribute, it takes three times as long
    return view
