"""Sections about the platforms of sensors: their actions and motion."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field

from vedette.scenarios.diagnostics import Finding
from vedette.scenarios.sections.base import HalfWidth, Numbers, Point, Positive, Reals, check
from vedette.scenarios.sections.custom import Custom
from vedette.scenarios.sections.derived import Part, derived, one_of

if TYPE_CHECKING:  # importing the platforms imports the models and the compiler, which a check does not need
    from vedette.platforms import Platform

Row = tuple[float, ...]


class _PlatformSection(Part):
    """What a platform has unless it says otherwise: no more than a place and a heading, and a rest."""

    def components(self) -> Row:
        """Return the components of its pose at the start after place and heading."""
        return ()

    def first_action(self, heading_deg: float) -> Row | None:
        """Return its action before any decision: its course at the start; None: the first of its actions."""
        return None

    @property
    def top_speed(self) -> float:
        """Largest speed, m/s."""
        return float(self.speed) if "speed" in type(self).model_fields else 0.0


class Stationary(_PlatformSection):
    """Stays where it is."""

    kind: Literal["stationary"] = Field(default="stationary", description="Kind of platform [-].")
    of: ClassVar[str] = "vedette.platforms.courses:Stationary"


@derived("vedette.platforms.courses:HeadingPlatform", first=("speed", "speeds"))
class Heading(_PlatformSection):
    """Turns at once, and keeps course and speed until the next decision; an action is a heading."""

    kind: Literal["heading"] = Field(default="heading", description="Kind of platform [-].")
    speed: Annotated[float, Field(ge=0.0)] | None = Field(default=None, description="Speed when under way [m/s].")
    speeds: Annotated[tuple[Annotated[float, Field(ge=0.0)], ...], Field(strict=False, min_length=1)] | None = Field(
        default=None, description="Instead of speed: several, of which an action chooses one [m/s]."
    )
    headings_deg: Reals = Field(
        default=tuple(range(-180, 181, 30)),
        description="Headings, counter-clockwise from east, in the order of tables and figures. Those that are one "
        "course (-180 and 180) are evaluated once and shown each; of equal rewards the first action wins [deg].",
    )

    @check
    def _one_of_both(self) -> Iterator[Finding]:
        if (self.speed is None) == (self.speeds is None):
            yield (), "either speed or speeds", "neither" if self.speed is None else "both"

    def to_arguments(self) -> dict[str, Any]:
        """Return the arguments of the platform, with one speed or several."""
        return {**super().to_arguments(), "speed": self.top_speed if self.speeds is None else self.speeds}

    def first_action(self, heading_deg: float) -> Row | None:
        """Return its heading at the start, at its speed, or the first of several."""
        return (heading_deg,) if self.speeds is None else (heading_deg, self.speeds[0])

    @property
    def top_speed(self) -> float:
        """Largest speed, m/s."""
        return max(self.speeds) if self.speeds is not None else self.speed or 0.0


@derived("vedette.platforms.courses:GridPlatform")
class GridMoves(_PlatformSection):
    """Steps of one length, each made at a speed and followed by waiting; an action is a step."""

    kind: Literal["grid_moves"] = Field(default="grid_moves", description="Kind of platform [-].")

    def first_action(self, heading_deg: float) -> Row | None:
        """Return the step of length 0 if it may stay, else None."""
        return (0.0, 0.0) if self.allow_staying else None


@derived("vedette.platforms.courses:Waypoints")
class Waypoints(_PlatformSection):
    """Follows a path from waypoint to waypoint; an action is the waypoint to head for, counted from 1."""

    kind: Literal["waypoints"] = Field(default="waypoints", description="Kind of platform [-].")
    points: Annotated[tuple[Point, ...], Field(strict=False, min_length=1)] = Field(description="The path [m].")
    speed: Positive = Field(description="Speed when under way [m/s].")


class CustomPlatform(_PlatformSection, Custom):
    """A user's own `vedette.platforms.Platform`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of platform [-].")
    pose: Numbers = Field(default=(), description="Its pose at the start beyond place and heading [-].")
    gives: ClassVar[str] = "vedette.platforms:Platform"

    def build(self, folder: Path | None = None, **_: Any) -> Platform:
        """Return the custom platform."""
        platform: Platform = self.instantiate(folder or Path())
        return platform

    def components(self) -> Row:
        """Return the components of its pose at the start after place and heading."""
        return self.pose

    @property
    def top_speed(self) -> float:
        """Largest speed, m/s; unknown for a custom platform."""
        return math.inf


MountingPlatform = Annotated[Stationary | Heading | GridMoves | Waypoints | CustomPlatform, Field(discriminator="kind")]


@derived("vedette.platforms.camera:Pointing", first=("pointing_deg", "half_width_deg"))
class Camera(_PlatformSection):
    """Points and may zoom, at rest or on a platform; an action is a pointing, and an action of that platform.

    Detection of kind `camera` looks along the pointing.
    """

    kind: Literal["camera"] = Field(default="camera", description="Kind of platform [-].")
    pointing_deg: float = Field(default=0.0, description="Where it points at the start, as a heading [deg].")
    half_width_deg: HalfWidth = Field(description="Half the width of its field of view at the start [deg].")
    half_widths_deg: Annotated[tuple[HalfWidth, ...], Field(strict=False)]
    platform: MountingPlatform = Field(default=Stationary(), description="Platform that carries it [-].")

    def build(self, folder: Path | None = None, **_: Any) -> Platform:
        """Return a camera, on its platform if that moves."""
        from vedette.platforms import MountedPlatform

        pointing: Platform = super().build(folder)
        return (
            pointing
            if isinstance(self.platform, Stationary)
            else MountedPlatform(self.platform.build(folder), pointing)
        )

    def components(self) -> Row:
        """Return pointing and half width, rad."""
        return math.radians(self.pointing_deg), math.radians(self.half_width_deg)

    def first_action(self, heading_deg: float) -> Row | None:
        """Return the action that keeps its pointing."""
        carried = () if isinstance(self.platform, Stationary) else self.platform.first_action(heading_deg)
        zoom = (self.half_width_deg,) if self.half_widths_deg else ()
        return None if carried is None else (*carried, self.pointing_deg, *zoom)

    @property
    def top_speed(self) -> float:
        """Largest speed, m/s."""
        return self.platform.top_speed


if TYPE_CHECKING:
    AnyPlatform = _PlatformSection
else:
    _WRITTEN = (Stationary, Heading, GridMoves, Waypoints, Camera, CustomPlatform)
    AnyPlatform = one_of("platform", "platforms", own=_WRITTEN, parent=_PlatformSection)
