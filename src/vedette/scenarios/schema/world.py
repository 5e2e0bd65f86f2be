"""Sections about the world: time, region, motion, survival, births and the true targets."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vedette.scenarios.schema.base import (
    Custom,
    Numbers,
    Point,
    Positive,
    Probability,
    Section,
    SomeNumbers,
    Whole,
    expected,
)

Step = Annotated[Whole, Field(ge=1)]


class Time(Section):
    """The scans: step k of 1 .. num_steps is at start + (k - 1) * step_period."""

    num_steps: Annotated[Whole, Field(ge=1, le=1_000_000, description="Number of scans [-].")]
    step_period: Positive = Field(default=1.0, description="Time between scans [s].")
    start: float = Field(default=1.0, description="Time of the first scan [s].")


class RegionSection(Section):
    """The surveillance region: a rectangle, x to the east and y to the north."""

    x_min: float = Field(description="Western edge [m].")
    x_max: float = Field(description="Eastern edge [m].")
    y_min: float = Field(description="Southern edge [m].")
    y_max: float = Field(description="Northern edge [m].")

    @model_validator(mode="after")
    def _positive(self) -> RegionSection:
        if self.x_max <= self.x_min:
            raise expected(f"a number above x_min, {self.x_min:g}", at=("x_max",))
        if self.y_max <= self.y_min:
            raise expected(f"a number above y_min, {self.y_min:g}", at=("y_max",))
        return self


StateOrder = Annotated[
    Literal["grouped", "interleaved"],
    Field(
        description="Order in which this file writes states: grouped is [px, py, vx, vy] (the order of the paper's F "
        "and Q), interleaved is [px, vx, py, vy] (the order of its text). A turn rate comes last. The library itself "
        "always has them grouped [-]."
    ),
]


class ConstantVelocity(Section):
    """Constant velocity with white acceleration noise, held over a step. State [px, py, vx, vy]."""

    kind: Literal["constant_velocity"] = Field(default="constant_velocity", description="Kind of motion [-].")
    sigma_v: float = Field(default=5.0, ge=0.0, description="Standard deviation of the acceleration [m/s^2].")
    state_order: StateOrder = "grouped"


class CoordinatedTurn(Section):
    """Turn at an unknown rate. State [px, py, vx, vy, turn rate in rad/s]."""

    kind: Literal["coordinated_turn"] = Field(default="coordinated_turn", description="Kind of motion [-].")
    sigma_v: float = Field(default=5.0, ge=0.0, description="Standard deviation of the acceleration [m/s^2].")
    sigma_turn_rate_deg: float = Field(
        default=1.0, ge=0.0, description="Standard deviation of the turn acceleration [deg/s^2]."
    )
    state_order: StateOrder = "grouped"


class CustomMotion(Custom):
    """A user's `MotionModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of motion [-].")
    state_dim: Annotated[Whole, Field(ge=2, le=100, description="Number of components of its state [-].")]


Motion = Annotated[ConstantVelocity | CoordinatedTurn | CustomMotion, Field(discriminator="kind")]


class ConstantSurvival(Section):
    """The same probability of survival everywhere."""

    kind: Literal["constant"] = Field(default="constant", description="Kind of survival [-].")
    probability: Probability = Field(default=0.98, description="Probability of living on to the next scan [-].")


class CustomSurvival(Custom):
    """A user's `SurvivalModel`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of survival [-].")


Survival = Annotated[ConstantSurvival | CustomSurvival, Field(discriminator="kind")]
CovRows = Annotated[tuple[SomeNumbers, ...], Field(strict=False)]
Steps = Annotated[tuple[Step, ...], Field(strict=False)]


class BirthSite(Section):
    """A place where targets appear: one Bernoulli of the birth density."""

    existence: float = Field(gt=0.0, lt=1.0, description="Probability that a target appears, at each such scan [-].")
    mean: SomeNumbers = Field(description="Mean state [m, m/s, ...].")
    std: SomeNumbers | None = Field(
        default=None, description="Standard deviation of each state component; else give cov [m, m/s, ...]."
    )
    cov: CovRows | None = Field(
        default=None, description="Covariance of the state, row by row; else give std [m^2, m^2/s, ...]."
    )

    @model_validator(mode="after")
    def _one_spread(self) -> BirthSite:
        if (self.std is None) == (self.cov is None):
            raise expected("either std or cov", got="both" if self.std else "neither")
        return self


class Birth(Section):
    """LMB births, the same at every sensor: all share one label space. Label = (birth step, index of the site)."""

    steps: Literal["every"] | Steps = Field(
        default="every", description='Scans at which targets may appear: a list, or "every" [-].'
    )
    sites: Annotated[tuple[BirthSite, ...], Field(strict=False, min_length=1)] = Field(description="The sites [-].")


class ScriptedTarget(Section):
    """One true target that follows the motion model."""

    state: SomeNumbers = Field(description="State at its first scan [m, m/s, ...].")
    start_step: Step = Field(default=1, description="First scan at which it is there [-].")
    end_step: Step | None = Field(default=None, description="Last scan at which it is there; none: to the end [-].")
    process_noise: bool = Field(default=False, description="Whether its motion is disturbed by the process noise [-].")


class ScriptedTargets(Section):
    """Targets written out here."""

    kind: Literal["scripted"] = Field(default="scripted", description="Kind of targets [-].")
    tracks: Annotated[tuple[ScriptedTarget, ...], Field(strict=False)] = Field(description="The targets [-].")


class Columns(Section):
    """Names of the columns, where they differ from the names of these keys. Places are x, y or longitude, latitude."""

    time: str | None = Field(default=None, description="Time: a number of seconds, or ISO 8601 [s].")
    id: str | None = Field(default=None, description="Which target [-].")
    x: str | None = Field(default=None, description="East [m].")
    y: str | None = Field(default=None, description="North [m].")
    longitude: str | None = Field(default=None, description="Longitude, WGS84 [deg].")
    latitude: str | None = Field(default=None, description="Latitude, WGS84 [deg].")
    vx: str | None = Field(default=None, description="Velocity to the east, if it is recorded [m/s].")
    vy: str | None = Field(default=None, description="Velocity to the north, if it is recorded [m/s].")

    @model_validator(mode="after")
    def _one_pair(self) -> Columns:
        given = self.given()
        for first, second in (("x", "y"), ("longitude", "latitude"), ("vx", "vy")):
            if (first in given) != (second in given):
                raise expected(f"{first} and {second} together", got=f"only {first if first in given else second}")
        if "x" in given and "longitude" in given:
            raise expected("either x and y, or longitude and latitude", got="both")
        return self

    def given(self) -> dict[str, str]:
        """The names that are given: key -> name in the file."""
        return {key: name for key in type(self).model_fields if (name := getattr(self, key)) is not None}


class RecordedTargets(Section):
    """Targets from a CSV or Parquet file of reports: time, which target, where. Interpolated at the scans."""

    kind: Literal["recorded"] = Field(default="recorded", description="Kind of targets [-].")
    path: str = Field(min_length=1, description="CSV or Parquet file, relative to the scenario file [-].")
    columns: Columns = Field(default=Columns(), description="Names of its columns [-].")
    time_origin: float | str | None = Field(
        default=None, description="Recorded time of the first scan, a number or ISO 8601; none: the earliest [s]."
    )
    origin_deg: Point | None = Field(
        default=None, description="Longitude and latitude of x = y = 0; none: the middle of the reports [deg]."
    )
    max_gap: Positive = Field(default=60.0, description="A longer silence ends the track [s].")
    min_speed: float = Field(
        default=0.0, ge=0.0, description="A track slower than this on average is left out (moored) [m/s]."
    )
    max_speed: Positive | None = Field(
        default=None, description="Reports that would need more are dropped (jumps); none: no limit [m/s]."
    )
    crop: bool = Field(default=True, description="Whether tracks end at the edges of the region [-].")


Targets = Annotated[ScriptedTargets | RecordedTargets, Field(discriminator="kind")]

__all__ = [
    "Birth",
    "BirthSite",
    "Columns",
    "ConstantSurvival",
    "ConstantVelocity",
    "CoordinatedTurn",
    "CustomMotion",
    "CustomSurvival",
    "Motion",
    "Numbers",
    "RecordedTargets",
    "RegionSection",
    "ScriptedTarget",
    "ScriptedTargets",
    "Survival",
    "Targets",
    "Time",
]
