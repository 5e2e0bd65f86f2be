"""Which joint actions are allowed, by course and by pair of courses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Bools, Ints


@dataclass(frozen=True, slots=True, eq=False)
class Mask:
    """Which courses and pairs of courses are allowed; a joint action is where all of its own are.

    Attributes:
        single: (num_courses,) which courses each sensor may take, one array a sensor.
        together: (num_courses of i, of j) which courses of sensors i < j go together, by (i, j); others all do.
        notes: what a reader of the decision must know.

    Raises:
        InputError: a table of another shape, or of a pair that is none.
    """

    single: tuple[Bools, ...]
    together: Mapping[tuple[int, int], Bools] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    _beside: tuple[Mapping[int, Ints], ...] = field(init=False)

    def __post_init__(self) -> None:
        beside: tuple[dict[int, Ints], ...] = tuple({} for _ in self.single)
        shape = self.shape
        for (first, second), table in self.together.items():
            if not 0 <= first < second < len(shape):
                raise InputError(f"mask: expected pairs of sensors below {len(shape)}; got {first, second}")
            wanted = (shape[first], shape[second])
            if table.shape != wanted:
                raise InputError(f"mask of sensors {first, second}: expected shape {wanted}; got {table.shape}")
            clash = np.asarray(~table, np.int64)
            # One row a course of the other sensor, so that a look-up is a row in one piece.
            beside[first][second] = np.ascontiguousarray(clash.T)
            beside[second][first] = clash
        object.__setattr__(self, "_beside", beside)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of courses of each sensor."""
        return tuple(len(own) for own in self.single)

    def violations(self, actions: Ints) -> Ints:
        """(num,) how many courses, and how many pairs of courses, of joint actions (num, num_sensors) are forbidden."""
        found = np.zeros(len(actions), np.int64)
        for s, own in enumerate(self.single):
            if not own.all():
                found += ~own[actions[:, s]]
        for (first, second), table in self.together.items():
            found += ~table[actions[:, first], actions[:, second]]
        return found

    def allows(self, actions: Ints) -> Bools:
        """(num,) whether joint actions (num, num_sensors) are allowed."""
        return np.asarray(self.violations(actions) == 0)

    def others(self, sensor: int) -> Mapping[int, Ints]:
        """The sensors that one may clash with, each with (its num_courses, num_courses of `sensor`): 1 for a clash."""
        return self._beside[sensor]

    def clashes(self, at: Sequence[int], sensor: int) -> Ints:
        """(num_courses,) violations that each course of one sensor has part in, the others as in a joint action.

        at: courses; those below 0 are of sensors that are not decided, and clash with none.
        """
        found = (~self.single[sensor]).astype(np.int64)
        for other, clash in self._beside[sensor].items():
            if at[other] >= 0:
                found += clash[at[other]]
        return found
