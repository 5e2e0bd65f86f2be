"""Section about how an action is valued."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from pydantic import Field

from vedette.scenarios.faults import Finding
from vedette.scenarios.sections.base import check
from vedette.scenarios.sections.custom import Custom
from vedette.scenarios.sections.derived import Part, derived, one_of


@derived("vedette.control.rewards.power:RenyiReward")
class RenyiReward(Part):
    """Renyi divergence of the predicted from the updated density."""

    kind: Literal["renyi"] = Field(default="renyi", description="Kind of reward [-].")

    @check
    def _not_one(self) -> Iterator[Finding]:
        if self.order == 1.0:
            yield ("order",), "a number other than 1", "1"


class CustomReward(Custom):
    """A user's own `vedette.control.Reward`, a function of the predicted and the updated density, `PowerReward` or
    `LabelReward`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of reward [-].")
    words: ClassVar[str] = ""
    gives: ClassVar[str] = "vedette.control:Reward"

    def lacking(self, found: object) -> str:
        """As of other kinds; a reward of sums is no function."""
        from vedette.control import LabelReward, PowerReward

        return "" if isinstance(found, PowerReward | LabelReward) else super().lacking(found)

    def build(self, folder: Path) -> Any:
        """The user's own."""
        return self.made(folder)


if TYPE_CHECKING:
    AnyReward = Part
else:
    AnyReward = one_of("reward", "control/rewards", own=(RenyiReward, CustomReward))
