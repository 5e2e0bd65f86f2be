"""Base classes of all densities: frozen bundles of their own read-only arrays, checked at creation.

Kernels use a density's offsets and indices without checks, so what was checked must not change: a number written into
one of the arrays later could make a kernel read memory that it does not own.
"""

from abc import abstractmethod
from collections.abc import Callable
from operator import attrgetter
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from vedette.densities.inspection import Targets
from vedette.errors import InputError, NumericalError, VedetteError
from vedette.internal.representation import SummaryRepr, TabularRepr
from vedette.kernels.base.types import CLASSES, MODE, Floats, Ints, Marks, Mixture
from vedette.kernels.gaussian.components import components_of
from vedette.kernels.gaussian.marks import NOT_DRAWN, unmarked
from vedette.models.arguments import no_gaussians

_Made = TypeVar("_Made", bound=SummaryRepr)


class Container(SummaryRepr):
    """A frozen dataclass of arrays and other containers.

    The arrays of its fields are read-only views of arrays that have no other owner. Kernels receive the latter (see
    `for_kernel`): a read-only array has another type in Numba, which would compile everything again for it.
    """

    __slots__ = ()

    def _own_arrays(self) -> None:
        """Replace the given arrays by copies. A public constructor calls this before its checks."""
        for name in self.__match_args__:  # type: ignore[attr-defined]
            value = getattr(self, name)
            if type(value) is np.ndarray:
                object.__setattr__(self, name, _held(np.array(value, order="C")))

    def with_fields(self, **changed: Any) -> Self:
        """Return a copy with other values of some fields, without checks. See `unchecked`."""
        made = object.__new__(type(self))
        for name in self.__match_args__:  # type: ignore[attr-defined]
            object.__setattr__(made, name, _held(changed[name]) if name in changed else getattr(self, name))
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        """Unpickle through the constructor and its checks, as a pickle may come from any source."""
        return type(self), tuple(getattr(self, name) for name in self.__match_args__)  # type: ignore[attr-defined]


class Components(Container):
    """Base of the containers of Gaussian components."""

    __slots__ = ()
    log_weights: Floats
    means: Floats
    covs: Floats
    marks: Marks

    def __post_init__(self) -> None:
        if np.shape(self.marks) == (0, CLASSES):  # the default
            object.__setattr__(self, "marks", unmarked(len(self.log_weights)))
        self._own_arrays()
        self.validate(error=InputError)

    @abstractmethod
    def validate(self, *, error: type[VedetteError] = NumericalError) -> None:
        """Raise unless the arrays are consistent and form a density."""

    @property
    def state_dim(self) -> int:
        """Length of a target's state."""
        return int(self.means.shape[1])

    @property
    def num_classes(self) -> int:
        """Number of classes of targets, or 0 if they have none."""
        return int(self.marks.shape[1]) - CLASSES

    @property
    def log_class_probs(self) -> Floats:
        """Log probabilities of the classes of each component, (num_components, num_classes)."""
        return self.marks[:, CLASSES:]

    @property
    def has_modes(self) -> bool:
        """True if the mode of a component is known."""
        return bool((self.marks[:, MODE] > NOT_DRAWN).any())

    @property
    def modes(self) -> Ints:
        """Mode of motion of each component, (num_components,), -1 before it is drawn at the first prediction."""
        return self.marks[:, MODE].astype(np.int64)

    def _components(self) -> Mixture:
        """Return the components as a kernel bundle."""
        return Mixture._make(_COMPONENTS(self))


class Inspected(TabularRepr):
    """Base of densities and estimates, whose targets are shown in words, as a table and as a drawing."""

    __slots__ = ()
    _weight: ClassVar[str] = "existence"  # name of the weights of `_targets`

    @abstractmethod
    def _targets(self) -> Targets:
        """Return the labels (or Bernoullis, or components) with the weight, mean and covariance of each."""

    def to_table(self) -> dict[str, list[Any]]:
        """Return a table by columns, as for `pandas.DataFrame`, with one row per label (or Bernoulli, or component).

        Columns: `label` (`birth step.index`) if there are labels; `existence` (for the components of an intensity
        `expected_number`); the likeliest `measurement` of the last scan (None: missed) if it is known (see
        `TrackTable`); mean and standard deviations as in the table of a run's tracks: `x_m`, `y_m`, `vx_mps`, `vy_mps`,
        `std_x_m` and so on, those of the marginal density.
        """
        return self._targets().columns(self._weight)

    def plot(self, ax: Any) -> None:
        """Draw positions (m) into axes of Matplotlib, with labels and ellipses of two standard deviations.

        Improbable targets are faint. Raises `InputError` for one-dimensional states.
        """
        self._targets().draw(ax)

    def _detail(self) -> str:
        return self._targets().in_words()


class MultiTarget(Container, Inspected):
    """A density of a set of targets."""

    __slots__ = ()

    @abstractmethod
    def cardinality(self) -> Floats:
        """Return the probabilities of 0, 1, ..., n targets. See `vedette.densities.cardinality_distribution`."""


def unchecked(container: type[_Made], *fields: Any) -> _Made:
    """Return a container (or an object that holds some) of internal arrays, without the checks, which can be slow.

    The arrays are used as they are: no caller of the library may hold them.
    """
    made, put, array = object.__new__(container), object.__setattr__, np.ndarray
    for name, value in zip(container.__match_args__, fields, strict=True):  # type: ignore[attr-defined]
        if type(value) is array and type(value.base) is not array and value.flags.carray:
            value = value.view()  # the common case, without a call of _held
            value.setflags(False)  # type: ignore[call-arg]  # three times as fast as by keyword
        elif type(value) is array:
            value = _held(value)
        put(made, name, value)
    return made


def for_kernel(array: NDArray[Any]) -> Any:
    """Return the writeable array behind a container's field, for kernels. Other arrays are returned as they are."""
    return array if array.flags.writeable else array.base


def kernel_arrays(*fields: str) -> Callable[[Container], tuple[Any, ...]]:
    """Return a function that gives the kernel arrays of these fields (two or more), faster than `for_kernel`."""
    return attrgetter(*(f"{field}.base" for field in fields))


_COMPONENTS = kernel_arrays(*Mixture._fields)


def no_components(like: Any) -> Mixture:
    """Return no components, with the states and marks of a container or a birth model, or of a state dimension."""
    dim, marks = (like.state_dim, like.marks) if hasattr(like, "marks") else (like, unmarked())
    return components_of(np.empty(0), *no_gaussians(dim), marks[:0])


def _held(value: Any) -> Any:
    """Return an array as a read-only field, without a copy if possible, and anything else as it is."""
    if type(value) is not np.ndarray:
        return value
    base, flags = value.base, value.flags
    if type(base) is not np.ndarray:
        view = value.view() if flags.carray else np.array(value, order="C").view()
    elif not flags.writeable and value.size == base.size and value.strides == base.strides:
        return value
    else:  # a part of another array, whose base has another shape
        view = np.array(value, order="C").view()
    view.setflags(False)  # type: ignore[call-arg]  # three times as fast as by keyword or attribute
    return view
