"""Section about how an action is valued."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from vedette.scenarios.faults import Finding
from vedette.scenarios.sections.base import Positive, Probability, Section, check
from vedette.scenarios.sections.custom import Custom

if TYPE_CHECKING:  # with the planners comes the compiler, which a check does without
    from vedette.control.preparation import AnyReward as Built


class CauchySchwarzReward(Section):
    """Cauchy-Schwarz divergence between the predicted and the updated density (paper eqs. 5, 8 and 13 to 17)."""

    kind: Literal["cauchy_schwarz"] = Field(default="cauchy_schwarz", description="Kind of reward [-].")
    words: ClassVar[str] = "CS divergence"
    unit_volume: Literal["reference"] | Positive = Field(
        default=1.0,
        description='Unit K of hyper-volume: a number, or "reference" for (4 pi)^(d/2) sqrt(det P) of the predicted '
        "density, under which localisation counts as much as cardinality [-].",
    )

    def build(self, folder: Path) -> Built:
        """The value of an updated density."""
        from vedette.control import CauchySchwarzReward

        return CauchySchwarzReward(self.unit_volume)


class RenyiReward(Section):
    """Renyi divergence of the predicted from the updated density."""

    kind: Literal["renyi"] = Field(default="renyi", description="Kind of reward [-].")
    words: ClassVar[str] = "Rényi divergence"
    order: Positive = Field(
        default=0.5, description="Exponent of the predicted density; not 1. 0.5: twice the Bhattacharyya distance [-]."
    )

    @check
    def _not_one(self) -> Iterator[Finding]:
        if self.order == 1.0:
            yield ("order",), "a number other than 1", "1"

    def build(self, folder: Path) -> Built:
        """The value of an updated density."""
        from vedette.control import RenyiReward

        return RenyiReward(self.order)


class KullbackLeiblerReward(Section):
    """Kullback-Leibler divergence of the updated from the predicted density, target by target."""

    kind: Literal["kullback_leibler"] = Field(default="kullback_leibler", description="Kind of reward [-].")
    words: ClassVar[str] = "KL divergence, nats"

    def build(self, folder: Path) -> Built:
        """The value of an updated density."""
        from vedette.control import KullbackLeiblerReward

        return KullbackLeiblerReward()


class CardinalityVarianceReward(Section):
    """Less the variance of the number of targets after the update."""

    kind: Literal["cardinality_variance"] = Field(default="cardinality_variance", description="Kind of reward [-].")
    words: ClassVar[str] = "minus variance of cardinality"

    def build(self, folder: Path) -> Built:
        """The value of an updated density."""
        from vedette.control import CardinalityVarianceReward

        return CardinalityVarianceReward()


class ExpectedGospaReward(Section):
    """Less the mean squared GOSPA error of the best estimate after the update."""

    kind: Literal["expected_gospa"] = Field(default="expected_gospa", description="Kind of reward [-].")
    words: ClassVar[str] = "minus squared GOSPA, m²"
    cutoff: Positive = Field(default=100.0, description="Error that counts as a lost target [m].")

    def build(self, folder: Path) -> Built:
        """The value of an updated density."""
        from vedette.control import ExpectedGospaReward

        return ExpectedGospaReward(self.cutoff)


class PeecsReward(Section):
    """Less the posterior expected error of cardinality and states."""

    kind: Literal["peecs"] = Field(default="peecs", description="Kind of reward [-].")
    words: ClassVar[str] = "minus PEECS"
    share: Probability = Field(default=0.5, description="Weight of the error of the number of targets [-].")
    cutoff: Positive = Field(default=100.0, description="Error of a position that counts as 1 [m].")

    def build(self, folder: Path) -> Built:
        """The value of an updated density."""
        from vedette.control import PeecsReward

        return PeecsReward(self.share, self.cutoff)


class ExpectedLossReward(Section):
    """Less the error to be expected of the targets' positions; in closed form, without samples."""

    kind: Literal["expected_loss"] = Field(default="expected_loss", description="Kind of reward [-].")
    words: ClassVar[str] = "minus expected loss"
    cutoff: Positive = Field(default=100.0, description="Error that counts as a lost target [m].")
    order: Positive = Field(
        default=1.0, description="Power of the error, as of the score: 1 of OSPA, 2 of squared errors [-]."
    )

    def build(self, folder: Path) -> Built:
        """The value of the scans."""
        from vedette.control import ExpectedLossReward

        return ExpectedLossReward(self.cutoff, self.order)


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

    def build(self, folder: Path) -> Built:
        """The user's own."""
        made: Built = self.made(folder)
        return made


AnyReward = Annotated[
    CauchySchwarzReward
    | RenyiReward
    | KullbackLeiblerReward
    | CardinalityVarianceReward
    | ExpectedGospaReward
    | PeecsReward
    | ExpectedLossReward
    | CustomReward,
    Field(discriminator="kind"),
]
