"""Sections about the search of joint actions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from vedette.scenarios.sections.base import Chance, Count, Section, Whole
from vedette.scenarios.sections.custom import Custom

if TYPE_CHECKING:  # with the planners comes the compiler, which a check does without
    from vedette.control import JointSearch


class Automatic(Section):
    """Every joint action of up to three sensors; coordinate ascent with two restarts for more."""

    kind: Literal["automatic"] = Field(default="automatic", description="Kind of search [-].")
    max_joint_actions: Count = Field(
        default=1_000_000, description="Number above which two or three sensors are searched by ascent, too [-]."
    )

    def build(self, folder: Path) -> JointSearch:
        """The search."""
        from vedette.control import AutomaticSearch

        return AutomaticSearch(self.max_joint_actions)


class Exhaustive(Section):
    """Every joint action, as in the paper."""

    kind: Literal["exhaustive"] = Field(default="exhaustive", description="Kind of search [-].")
    max_joint_actions: Count = Field(default=1_000_000, description="Bound on their number [-].")

    def build(self, folder: Path) -> JointSearch:
        """The search."""
        from vedette.control import ExhaustiveSearch

        return ExhaustiveSearch(self.max_joint_actions)


class Ascent(Section):
    """One sensor at a time, the others held, until no sensor alone can do better; for many sensors."""

    kind: Literal["coordinate_ascent"] = Field(default="coordinate_ascent", description="Kind of search [-].")
    num_restarts: Annotated[Whole, Field(ge=0, le=1_000_000)] = Field(
        default=2, description="Ascents from random joint actions, after that from the independent decision [-]."
    )

    def build(self, folder: Path) -> JointSearch:
        """The search."""
        from vedette.control import CoordinateAscent

        return CoordinateAscent(self.num_restarts)


class Greedy(Section):
    """One sensor after the other, once, by the reward of those decided."""

    kind: Literal["sequential_greedy"] = Field(default="sequential_greedy", description="Kind of search [-].")
    order: Literal["printed", "best_first"] = Field(
        default="printed", description="As the sensors stand, or always the one that adds most [-]."
    )

    def build(self, folder: Path) -> JointSearch:
        """The search."""
        from vedette.control import SequentialGreedy

        return SequentialGreedy(self.order)


class CrossEntropy(Section):
    """Joint actions drawn from probabilities that are drawn to the best of them."""

    kind: Literal["cross_entropy"] = Field(default="cross_entropy", description="Kind of search [-].")
    num_samples: Count = Field(default=200, description="Joint actions drawn in a round [-].")
    elite_share: Chance = Field(default=0.1, description="Share of them that the probabilities are drawn to [-].")
    smoothing: Annotated[float, Field(gt=0.0, le=1.0)] = Field(
        default=0.7, description="How far they are drawn there in a round; 1: all the way [-]."
    )
    max_rounds: Count = Field(default=50, description="Most rounds [-].")

    def build(self, folder: Path) -> JointSearch:
        """The search."""
        from vedette.control import CrossEntropy

        return CrossEntropy(self.num_samples, self.elite_share, self.smoothing, self.max_rounds)


class CustomSearch(Custom):
    """A user's own `vedette.control.JointSearch`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of search [-].")
    gives: ClassVar[str] = "vedette.control:JointSearch"

    def build(self, folder: Path) -> JointSearch:
        """The user's own."""
        made: JointSearch = self.made(folder)
        return made


AnySearch = Annotated[
    Automatic | Exhaustive | Ascent | Greedy | CrossEntropy | CustomSearch, Field(discriminator="kind")
]
