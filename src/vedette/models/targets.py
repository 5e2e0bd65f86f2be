"""The targets as every sensor's filter knows them: how they move, live on and appear."""

from __future__ import annotations

from dataclasses import dataclass, fields

from vedette.errors import InputError
from vedette.models.birth import BirthModel
from vedette.models.motion import MotionModel, SurvivalModel

_KINDS = {"motion": MotionModel, "survival": SurvivalModel, "birth": BirthModel}


@dataclass(frozen=True, slots=True)
class TargetModel:
    """What all sensors know of the targets; held once, and shared by every filter that tracks them.

    Two are equal if they are of the very same parts.

    Attributes:
        motion: how a target moves.
        survival: whether it goes on living.
        birth: where targets appear.

    Raises:
        InputError: a part of another kind, or models of different state dimensions.
    """

    motion: MotionModel
    survival: SurvivalModel
    birth: BirthModel

    def __post_init__(self) -> None:
        for part in fields(self):
            value, kind = getattr(self, part.name), _KINDS[part.name]
            if not isinstance(value, kind):
                raise InputError(f"{part.name}: expected a {kind.__name__}; got {type(value).__name__}")
        if self.birth.state_dim != self.state_dim:
            raise InputError(
                f"birth.means: expected states of dimension {self.state_dim}, as the motion model; "
                f"got {self.birth.state_dim}"
            )

    @property
    def state_dim(self) -> int:
        """Length of a target's state."""
        return self.motion.state_dim
