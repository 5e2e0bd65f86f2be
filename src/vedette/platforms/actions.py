"""Actions as rows of named numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.arguments import float_array, sequence


@dataclass(frozen=True, slots=True, eq=False)
class Actions:
    """What one sensor may do, one action a row.

    Attributes:
        columns: what the numbers of an action are: `heading_deg`, an absolute heading counter-clockwise from +x, or
            whatever the platform calls them; units other than SI's in the name.
        values: (num_actions, num_columns), in the order of tables.

    Raises:
        InputError: no action, or numbers that are not finite or not as many as columns.
    """

    columns: tuple[str, ...]
    values: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", sequence("actions.columns", self.columns, "names of columns"))
        values = float_array("actions.values", self.values, (None, len(self.columns)))
        if len(values) == 0:
            raise InputError("actions.values: expected at least one action; got none")
        object.__setattr__(self, "values", values)

    @classmethod
    def of(cls, **numbers: float) -> Actions:
        """A single action, as in `Actions.of(heading_deg=30.0)`."""
        return cls(tuple(numbers), np.array([list(numbers.values())]))

    def __len__(self) -> int:
        return len(self.values)

    def text(self, index: int) -> str:
        """One action in words: `heading_deg 30, speed 5`."""
        numbers = zip(self.columns, self.values[index].tolist(), strict=True)
        return ", ".join(f"{name} {round(value, 6):g}" for name, value in numbers)
