"""Sections about what carries a sensor: what it may do, and where that takes it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from vedette.scenarios.faults import Finding
from vedette.scenarios.sections.base import Numbers, Point, Positive, Section, SomeNumbers, check
from vedette.scenarios.sections.custom import Custom

if TYPE_CHECKING:  # with the platforms come the models, and the compiler, which a check does without
    from vedette.platforms import Platform

Row = tuple[float, ...]
HalfWidth = Annotated[float, Field(gt=0.0, le=180.0)]


class _PlatformSection(Section):
    """What a platform has unless it says otherwise: no more than a place and a heading, and a rest."""

    def build(self, folder: Path) -> Platform:
        """What carries the sensor; `folder` is what a custom platform's file is relative to.

        Raises:
            InputError: a custom platform that cannot be had.
        """
        raise NotImplementedError

    def components(self) -> Row:
        """What its pose has at the start beyond place and heading."""
        return ()

    def first_action(self, heading_deg: float) -> Row | None:
        """What it does where nothing decides: its course at the start; None: the first of its actions."""
        return None

    @property
    def top_speed(self) -> float:
        """m/s."""
        return 0.0


class Still(_PlatformSection):
    """Stays where it is."""

    kind: Literal["still"] = Field(default="still", description="Kind of platform [-].")

    def build(self, folder: Path) -> Platform:
        """A platform with nothing to decide."""
        from vedette.platforms import Still

        return Still()


class Courses(_PlatformSection):
    """Turns at once, and keeps course and speed until the next decision; an action is a heading."""

    kind: Literal["courses"] = Field(default="courses", description="Kind of platform [-].")
    speed: Annotated[float, Field(ge=0.0)] | None = Field(default=None, description="Speed when under way [m/s].")
    speeds: Annotated[tuple[Annotated[float, Field(ge=0.0)], ...], Field(strict=False, min_length=1)] | None = Field(
        default=None, description="Instead of speed: several, of which an action chooses one [m/s]."
    )
    headings_deg: SomeNumbers = Field(
        default=tuple(range(-180, 181, 30)),
        description="Headings, counter-clockwise from east, in the order of tables and figures. Those that are one "
        "course (-180 and 180) are evaluated once and shown each; of equal rewards the first action wins [deg].",
    )
    relative: bool = Field(default=False, description="Whether they are changes of heading, added to it [-].")

    @check
    def _one_of_both(self) -> Iterator[Finding]:
        if (self.speed is None) == (self.speeds is None):
            yield (), "either speed or speeds", "neither" if self.speed is None else "both"

    def build(self, folder: Path) -> Platform:
        """Courses at one speed or several."""
        from vedette.platforms import Courses

        return Courses(self.top_speed if self.speeds is None else self.speeds, self.headings_deg, self.relative)

    def first_action(self, heading_deg: float) -> Row | None:
        """Its heading at the start, at its speed, or the first of several."""
        return (heading_deg,) if self.speeds is None else (heading_deg, self.speeds[0])

    @property
    def top_speed(self) -> float:
        """m/s."""
        return max(self.speeds) if self.speeds is not None else self.speed or 0.0


class Steps(_PlatformSection):
    """Steps of one length, each made at a speed and followed by waiting; an action is a step."""

    kind: Literal["steps"] = Field(default="steps", description="Kind of platform [-].")
    length: Positive = Field(description="Length of a step [m].")
    speed: Positive = Field(description="Speed on the way [m/s].")
    directions_deg: SomeNumbers = Field(
        default=(0.0, 45.0, 90.0, 135.0, 180.0, -135.0, -90.0, -45.0),
        description="Directions, counter-clockwise from east [deg].",
    )
    stay: bool = Field(default=True, description="Whether staying is an action, too, the last one [-].")

    def build(self, folder: Path) -> Platform:
        """Steps, and staying."""
        from vedette.platforms import Steps

        return Steps(self.length, self.speed, self.directions_deg, self.stay)

    def first_action(self, heading_deg: float) -> Row | None:
        """It stays where it may."""
        return (0.0, 0.0) if self.stay else None

    @property
    def top_speed(self) -> float:
        """m/s."""
        return self.speed


class Waypoints(_PlatformSection):
    """Follows a path from waypoint to waypoint; an action is the waypoint to head for, counted from 1."""

    kind: Literal["waypoints"] = Field(default="waypoints", description="Kind of platform [-].")
    points: Annotated[tuple[Point, ...], Field(strict=False, min_length=1)] = Field(description="The path [m].")
    speed: Positive = Field(description="Speed when under way [m/s].")
    closed: bool = Field(default=False, description="Whether the first follows the last; else it waits there [-].")

    def build(self, folder: Path) -> Platform:
        """A path."""
        from vedette.platforms import Waypoints

        return Waypoints(self.points, self.speed, self.closed)

    @property
    def top_speed(self) -> float:
        """m/s."""
        return self.speed


class CustomPlatform(_PlatformSection, Custom):
    """A user's own `vedette.platforms.Platform`."""

    kind: Literal["custom"] = Field(default="custom", description="Kind of platform [-].")
    pose: Numbers = Field(default=(), description="Its pose at the start beyond place and heading [-].")
    gives: ClassVar[str] = "vedette.platforms:Platform"

    def build(self, folder: Path) -> Platform:
        """The user's own."""
        made: Platform = self.made(folder)
        return made

    def components(self) -> Row:
        """What its pose has at the start beyond place and heading."""
        return self.pose

    @property
    def top_speed(self) -> float:
        """m/s; nobody knows how fast it is."""
        return math.inf


Carrier = Annotated[Still | Courses | Steps | Waypoints | CustomPlatform, Field(discriminator="kind")]


class Camera(_PlatformSection):
    """Is pointed, and may zoom, on the spot or on what carries it; an action is a pointing, and what the carrier does.

    Detection of kind `camera` looks along the pointing.
    """

    kind: Literal["camera"] = Field(default="camera", description="Kind of platform [-].")
    pointing_deg: float = Field(default=0.0, description="Where it points at the start, as a heading [deg].")
    half_width_deg: HalfWidth = Field(description="Half the width of its field of view at the start [deg].")
    pointings_deg: SomeNumbers = Field(description="Where it may point, counter-clockwise from east [deg].")
    relative: bool = Field(default=False, description="Whether these are changes of its pointing, added to it [-].")
    half_widths_deg: Annotated[tuple[HalfWidth, ...], Field(strict=False)] = Field(
        default=(), description="Half widths that it may zoom to; none: it does not zoom [deg]."
    )
    turn_rate_deg: Positive | None = Field(default=None, description="How fast it turns; none: at once [deg/s].")
    carrier: Carrier = Field(default=Still(), description="What carries it [-].")

    def build(self, folder: Path) -> Platform:
        """A camera, carried where its carrier moves."""
        from vedette.platforms import Carried, Pointing

        pointing = Pointing(self.pointings_deg, self.relative, self.half_widths_deg, self.turn_rate_deg)
        return pointing if isinstance(self.carrier, Still) else Carried(self.carrier.build(folder), pointing)

    def components(self) -> Row:
        """Pointing and half width, rad."""
        return math.radians(self.pointing_deg), math.radians(self.half_width_deg)

    def first_action(self, heading_deg: float) -> Row | None:
        """It keeps its pointing."""
        carried = () if isinstance(self.carrier, Still) else self.carrier.first_action(heading_deg)
        zoom = (self.half_width_deg,) if self.half_widths_deg else ()
        return None if carried is None else (*carried, self.pointing_deg, *zoom)

    @property
    def top_speed(self) -> float:
        """m/s."""
        return self.carrier.top_speed


AnyPlatform = Annotated[Still | Courses | Steps | Waypoints | Camera | CustomPlatform, Field(discriminator="kind")]
