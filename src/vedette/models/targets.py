"""Target model: motion, survival and birth, shared by all filters."""

from dataclasses import dataclass, field

from vedette.errors import InputError
from vedette.models.birth import BirthModel
from vedette.models.fields import check_fields
from vedette.models.motion import MotionModel, SurvivalModel


@dataclass(frozen=True, slots=True)
class TargetModel:
    """Model of the targets. One object is shared by all filters that track them.

    Two target models are equal if their parts are the same objects.

    Attributes:
        motion: motion model.
        survival: survival model.
        birth: birth model.
        state_dim: length of a target's state.
        num_classes: number of classes of targets, as in the birth model, or 0 if they have none.

    Raises:
        InputError: a part of another kind, or models of different state dimensions.
    """

    motion: MotionModel
    survival: SurvivalModel
    birth: BirthModel
    state_dim: int = field(init=False)
    num_classes: int = field(init=False)

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "state_dim", self.motion.state_dim)
        object.__setattr__(self, "num_classes", self.birth.num_classes)
        if self.birth.state_dim != self.state_dim:
            raise InputError(
                f"birth.means: expected states of dimension {self.state_dim}, as the motion model; "
                f"got {self.birth.state_dim}"
            )
