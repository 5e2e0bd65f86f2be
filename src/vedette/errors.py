"""The errors that this library raises. Each message names the field, what was expected and what came."""

_MOST_LINES, _LONGEST_LINE = 50, 2000


class VedetteError(Exception):
    """Base of every error raised on purpose by this library."""


class InputError(VedetteError, ValueError):
    """An argument, scan, file or folder that cannot be used.

    Every constructor raises it for an argument of another type, or outside the domain that its type or its description
    states.
    """


class MissingPackageError(InputError, ImportError):
    """A required package is not installed. The message names the extra that installs it."""


class ModelError(VedetteError):
    """A model function raised, or returned something that is not a valid value of its kind."""


class NumericalError(VedetteError, ArithmeticError):
    """A computation left the domain in which it is defined, e.g. a covariance that is not positive definite."""


class SlowRewardWarning(UserWarning):
    """A planner computes rewards one by one, because the reward or the fusion has no method to precompute them."""


class ImplausibleWarning(UserWarning):
    """A valid argument that is probably a mistake: another unit, exchanged numbers, or a limit that cuts births."""


class ScenarioError(VedetteError):
    """A scenario with one or more faults. The message lists the first fifty and counts the others.

    Attributes:
        faults: one line a fault, in file order: place, field, what was expected, what came.
    """

    def __init__(self, faults: list[str]) -> None:
        self.faults = list(faults)
        super().__init__(_message(self.faults))


def _message(faults: list[str]) -> str:
    """Return the first faults, cut to a bearable length, and the number of the others."""
    shown = [
        fault if len(fault) <= _LONGEST_LINE else f"{fault[:_LONGEST_LINE]}\N{HORIZONTAL ELLIPSIS}"
        for fault in faults[:_MOST_LINES]
    ]
    more = len(faults) - len(shown)
    return "\n".join([*shown, *([f"and {more} more"] if more else [])])
