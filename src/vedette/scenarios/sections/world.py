"""Sections about the world: time, region, motion and survival."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, get_args

import numpy as np
from pydantic import Field

from vedette.kernels.base.types import STATE_COMPONENTS, common_components
from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import GaussianMethod, Name, Positive, Probability, Section, Whole, check
from vedette.scenarios.sections.custom import Custom, MissingMember
from vedette.scenarios.sections.derived import Part, derived, of_kind, one_of

if TYPE_CHECKING:  # importing the models imports the compiler, which a check does not need
    from vedette.kernels.base.types import Floats
    from vedette.models import MotionModel


# Largest distance of a time from a scan, in scans: rounding of sums of decimal fractions.
TIME_TOLERANCE = 1e-6


class Time(Section):
    """The scans: step k of 1 .. num_steps is at start + (k - 1) * step_period."""

    num_steps: Annotated[Whole, Field(ge=1, le=1_000_000, description="Number of scans [-].")]
    step_period: Positive = Field(default=1.0, description="Time between scans [s].")
    start: float = Field(default=1.0, description="Time of the first scan [s].")

    @check
    def _distinct(self) -> Iterator[Finding]:
        latest = abs(self.start) + self.num_steps * self.step_period
        if self.step_period < 1e6 * math.ulp(latest):
            yield ("step_period",), f"a period that can be told apart at {latest:g} s", describe(self.step_period)

    def build(self) -> Floats:
        """Return the times of the scans in s, (num_steps,); that of step k is entry k - 1."""
        return self.start + self.step_period * np.arange(self.num_steps, dtype=np.float64)

    def step_at(self, moment: float) -> int | None:
        """Return the scan at a time, s; None if there is none."""
        position = (moment - self.start) / self.step_period + 1.0
        return round(position) if abs(position - round(position)) <= TIME_TOLERANCE else None


def _not_above(name: str, value: float, other: str, least: float) -> Iterator[Finding]:
    if value <= least:
        yield (name,), f"a number above {other}, {least:g}", describe(value)


@derived("vedette.models.region:Region")
class RegionSection(Part):
    """The surveillance region: a rectangle, x to the east and y to the north."""

    _width = check(lambda self: _not_above("x_max", self.x_max, "x_min", self.x_min))
    _height = check(lambda self: _not_above("y_max", self.y_max, "y_min", self.y_min))


StateOrder = Annotated[
    Literal["grouped", "interleaved"],
    Field(
        description="Order in which this file writes states: grouped is [px, py, vx, vy] (the order of the paper's F "
        "and Q), interleaved is [px, vx, py, vy] (the order of its text). A turn rate, or height and vertical "
        "velocity, come last. The library itself always has them grouped [-]."
    ),
]


class _Motion(Part):
    """How targets move, and in which order the file writes their states."""

    state_order: StateOrder = "grouped"

    @property
    def components(self) -> tuple[str, ...]:
        """Names of the components of a state."""
        return STATE_COMPONENTS[self.kind]


class CustomMotion(Custom):
    """A user's `MotionModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of motion [-].")
    components: tuple[str, ...] = Field(strict=False, min_length=2, description="Components of its state, by name [-].")
    gives: ClassVar[str] = "vedette.models:MotionModel"

    @property
    def state_order(self) -> Literal["grouped"]:
        """Order of states: that of the model."""
        return "grouped"

    def build(self, folder: Path, method: GaussianMethod = "auto") -> MotionModel:
        """Return the motion model.

        Raises `InputError` if the components of its state differ from the given ones, or have another order.
        """
        from vedette.models.motion import STATE_ORDER

        motion: MotionModel = self.instantiate(folder)
        if motion.components != self.components:
            wanted = f"those of {self.function}, {', '.join(motion.components)}"
            raise MissingMember(self, "components", wanted, ", ".join(self.components))
        if (fault := motion.velocity_fault()) is not None:
            raise MissingMember(self, "function", f"a state {STATE_ORDER}", fault)
        return motion if method == "auto" else replace(motion, method=method)


if TYPE_CHECKING:
    OneMotion = _Motion
else:
    OneMotion = one_of("motion", "models", parent=_Motion)


class Mode(Section):
    """Motion and detection of targets in a mode, and how long they stay in it."""

    motion: OneMotion = Field(default=of_kind("constant_velocity"), description="How targets move in this mode [-].")
    stay_s: Positive | None = Field(default=None, description="Mean time in this mode; none: for ever [s].")
    to: dict[Name, Probability] = Field(
        default={}, description="Probability of each mode that follows this one; none: all others alike [-]."
    )
    at_birth: Probability | None = Field(
        default=None, description="Probability of this mode of a new target; none, for all modes: in the long term [-]."
    )
    detection_factor: Probability = Field(
        default=1.0, description="Factor on the probability of detection in this mode; 0 is hidden [-]."
    )


class ModesMotion(Section):
    """Targets that change their motion: each mode has its own, and a mean time after which another follows."""

    kind: Literal["modes"] = Field(default="modes", description="Kind of motion [-].")
    modes: Annotated[dict[Name, Mode], Field(min_length=2)] = Field(description="The modes, by name [-].")
    merge_distance: Positive | None = Field(
        default=2.0,
        description="Mahalanobis distance within which predicted components of one mode merge; none: all of them, as "
        "in the interacting multiple model [-].",
    )

    @property
    def components(self) -> tuple[str, ...]:
        """Names of the components of a state: all that a mode has."""
        return common_components([mode.motion.components for mode in self.modes.values()])

    @property
    def state_order(self) -> Literal["grouped"]:
        """Order of states."""
        return "grouped"

    @check
    def _grouped(self) -> Iterator[Finding]:
        for name, mode in self.modes.items():
            if (order := mode.motion.state_order) != "grouped":
                yield (
                    ("modes", name, "motion", "state_order"),
                    "grouped, as states of several motions are",
                    describe(order),
                )

    @check
    def _next(self) -> Iterator[Finding]:
        for name, mode in self.modes.items():
            others = [other for other in self.modes if other != name]
            for other in mode.to:
                if other not in others:
                    yield ("modes", name, "to", other), f"another mode, one of {', '.join(others)}", describe(other)
            if mode.to and abs(sum(mode.to.values()) - 1.0) > TIME_TOLERANCE:
                yield ("modes", name, "to"), "probabilities that sum to 1", describe(round(sum(mode.to.values()), 9))

    @check
    def _at_birth(self) -> Iterator[Finding]:
        given = [mode.at_birth for mode in self.modes.values() if mode.at_birth is not None]
        if given and (len(given) < len(self.modes) or abs(sum(given) - 1.0) > TIME_TOLERANCE):
            yield ("modes",), "at_birth of all modes or of none, with sum 1", describe(given)

    def build(self, folder: Path, method: GaussianMethod = "auto") -> MotionModel:
        """Return the motion model."""
        from vedette.models import Modes

        modes, given = tuple(self.modes.values()), any(mode.at_birth is not None for mode in self.modes.values())
        even = 1.0 / max(len(modes) - 1, 1)
        to = [
            [(mode.to.get(name, 0.0) if mode.to else even) * (name != own) for name in self.modes]
            for own, mode in self.modes.items()
        ]
        return Modes(
            [mode.motion.build(folder) for mode in modes],
            [math.inf if mode.stay_s is None else mode.stay_s for mode in modes],
            names=tuple(self.modes),
            to=to,
            at_birth=[mode.at_birth or 0.0 for mode in modes] if given else None,
            detection_factors=[mode.detection_factor for mode in modes],
            merge_distance=math.inf if self.merge_distance is None else self.merge_distance,
            method=method,
        )


if TYPE_CHECKING:
    Motion = _Motion
    Survival = Part
else:
    Motion = one_of("motion", "models", own=(*get_args(get_args(OneMotion)[0]), CustomMotion, ModesMotion))
    Survival = one_of("survival", "models", "vedette.models:SurvivalModel")


def grouped_order(motion: Motion) -> list[int]:
    """Return the index in the file's states of each component of the library's states [px, py, vx, vy, ...]."""
    if motion.state_order == "grouped":
        return list(range(len(motion.components)))
    return [0, 2, 1, 3, *range(4, len(motion.components))]
