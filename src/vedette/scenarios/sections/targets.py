"""Sections about the true targets: scripted, recorded, or drawn."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from vedette.errors import InputError
from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import (
    SHA256_FIELD,
    Point,
    Positive,
    Probability,
    Reals,
    Section,
    Sha256,
    Step,
    check,
)
from vedette.scenarios.sections.derived import Derived, derived
from vedette.scenarios.sections.world import RegionSection

if TYPE_CHECKING:  # importing the models imports the compiler, which a check does not need
    from vedette.kernels.base.types import Floats
    from vedette.models import MotionModel, Region
    from vedette.recorded import RecordedTargets as RecordedSource
    from vedette.simulation import PoissonTargets as PoissonSource
    from vedette.simulation import ScriptedTargets as ScriptedSource
    from vedette.simulation import UniformTargets as UniformSource


def _negative_stds(stds: Sequence[float]) -> Iterator[Finding]:
    for i, std in enumerate(stds):
        if std < 0.0:
            yield ("std", i), "a number of at least 0", describe(std)


class ScriptedTarget(Section):
    """One true target that follows the motion model."""

    state: Reals = Field(description="State at its first scan [m, m/s, ...].")
    start_step: Step = Field(default=1, description="First scan at which it is there [-].")
    end_step: Step | None = Field(default=None, description="Last scan at which it is there; none: to the end [-].")
    process_noise: bool = Field(default=False, description="Whether its motion is disturbed by the process noise [-].")
    std: Reals | None = Field(
        default=None,
        description="Standard deviation of each component of its first state, which every run draws anew around state; "
        "none: the same in every run [m, m/s, ...].",
    )

    _not_negative = check(lambda self: _negative_stds(self.std or ()))

    @check
    def _lifetime(self) -> Iterator[Finding]:
        if self.end_step is not None and self.end_step < self.start_step:
            yield ("end_step",), f"a step from start_step, {self.start_step}, on", describe(self.end_step)


class ScriptedTargets(Section):
    """Targets written out here."""

    kind: Literal["scripted"] = Field(default="scripted", description="Kind of targets [-].")
    tracks: Annotated[tuple[ScriptedTarget, ...], Field(strict=False)] = Field(description="The targets [-].")

    def expected_number(self, num_steps: int) -> float | None:
        """Return the largest number of targets at one scan."""
        changes = np.zeros(num_steps + 2, np.int64)
        for track in self.tracks:
            changes[min(track.start_step, num_steps + 1)] += 1
            changes[min((track.end_step or num_steps) + 1, num_steps + 1)] -= 1
        return float(np.cumsum(changes)[: num_steps + 1].max())

    def build(self, motion: MotionModel, order: list[int], times: Floats, region: Region) -> ScriptedSource:
        """Return the targets, moved by `motion`, whose states have the section's components in this order."""
        from vedette.simulation import ScriptedTargets

        tracks = self.tracks
        shape = (len(tracks), motion.state_dim)
        states = np.array([track.state for track in tracks]).reshape(shape)
        stds = np.array([track.std or (0.0,) * motion.state_dim for track in tracks]).reshape(shape)
        return ScriptedTargets(
            motion,
            states[:, order],
            np.array([times[track.start_step - 1] for track in tracks]),
            np.array([times[(track.end_step or len(times)) - 1] for track in tracks]),
            [track.process_noise for track in tracks] or False,
            stds[:, order] if stds.any() else None,
        )


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
    altitude: str | None = Field(
        default=None, description="Altitude, if it is recorded, in m or the unit at the end of the name (_ft, _fl) [m]."
    )

    @check
    def _pairs(self) -> Iterator[Finding]:
        given = self.to_arguments()
        for first, second in (("x", "y"), ("longitude", "latitude"), ("vx", "vy")):
            if (first in given) != (second in given):
                yield (), f"{first} and {second} together", f"only {first if first in given else second}"
                return
        if "x" in given and "longitude" in given:
            yield (), "either x and y, or longitude and latitude", "both"

    def to_arguments(self) -> dict[str, str]:
        """Return the given names: key -> name in the file."""
        return {key: name for key in type(self).model_fields if (name := getattr(self, key)) is not None}


@derived("vedette.recorded.cleaning:Cleaning", first=("path", "sha256", "columns", "time_origin", "origin_deg"))
class RecordedTargets(Derived):
    """Targets from a CSV or Parquet file of reports: time, which target, where. Interpolated at the scans."""

    kind: Literal["recorded"] = Field(default="recorded", description="Kind of targets [-].")
    path: str = Field(min_length=1, description="CSV or Parquet file, relative to the scenario file [-].")
    sha256: Sha256 | None = Field(default=None, description=SHA256_FIELD)
    columns: Columns = Field(default=Columns(), description="Names of its columns [-].")
    time_origin: float | str | None = Field(
        default=None, description="Recorded time of the first scan, a number or ISO 8601; none: the earliest [s]."
    )
    origin_deg: Point | None = Field(
        default=None,
        description="Longitude and latitude of x = y = 0; none: those of the scenario's "
        "origin, or the middle of the reports where it has none [deg].",
    )
    crop: bool = Field(default=True, description="Whether tracks end at the edges of the region [-].")

    def expected_number(self, num_steps: int) -> float | None:
        """Return None: the number is known only from the file."""
        return None

    def source(self, region: RegionSection, origin: Point | None, has_height: bool, folder: Path) -> RecordedSource:
        """Return the recorded targets. Raises `InputError` for a file that cannot be read or has no targets.

        An unchanged file is read only once. origin: of the scenario, longitude and latitude, deg. has_height: whether
        states have heights, which the targets then have if the file has them.
        """
        file = folder / self.path
        try:
            state = os.stat(file)
        except (OSError, ValueError):
            raise InputError(f"{self.path}: expected a readable file of recorded targets; got none") from None
        return _read(str(file.resolve()), state.st_mtime_ns, state.st_size, self, region, origin, has_height)


@lru_cache(maxsize=16)
def _read(
    file: str,
    changed_ns: int,
    num_bytes: int,
    section: RecordedTargets,
    region: RegionSection,
    origin: tuple[float, float] | None,
    has_height: bool,
) -> RecordedSource:
    from vedette.recorded import Cleaning
    from vedette.recorded import RecordedTargets as RecordedSource

    edges = region.build()
    found = RecordedSource.from_file(
        file,
        columns=section.columns.to_arguments(),
        origin_deg=section.origin_deg,
        usual_origin_deg=origin,
        time_origin=section.time_origin,
        cleaning=Cleaning(**section.to_arguments(), region=edges if section.crop else None),
        sha256=section.sha256,
    )
    return replace(found, with_height=True) if has_height and found.reports.altitudes is not None else found


class PoissonTargets(Section):
    """Targets drawn anew in every run, the same for all strategies: they move under the motion model, with its noise.

    What leaves the region is gone.
    """

    kind: Literal["poisson"] = Field(default="poisson", description="Kind of targets [-].")
    expected: Positive = Field(description="Mean number of births a scan [-].")
    mean: Reals = Field(description="Mean state of a birth [m, m/s, ...].")
    std: Reals = Field(description="Standard deviation of each state component of a birth [m, m/s, ...].")
    death_probability: Probability = Field(
        default=0.0, description="Probability with which a target dies from scan to scan [-]."
    )

    _spreads = check(lambda self: _negative_stds(self.std))

    def expected_number(self, num_steps: int) -> float | None:
        """Return the mean number of targets at the last scan, if none leaves the region; None without deaths."""
        if self.death_probability == 0.0:
            return None
        return self.expected * (1.0 - (1.0 - self.death_probability) ** num_steps) / self.death_probability

    def build(self, motion: MotionModel, order: list[int], times: Floats, region: Region) -> PoissonSource:
        """Return the targets, moved by `motion`, whose states have the section's components in this order."""
        from vedette.simulation import PoissonTargets

        mean, std = np.array(self.mean)[order], np.array(self.std)[order]
        return PoissonTargets(motion, self.expected, mean, np.diag(std**2), self.death_probability, region)


class UniformTargets(Section):
    """A steady crowd, drawn anew in every run: uniform over the region at the first scan and ever after.

    Births make up for deaths; where a target leaves the region another enters at the opposite edge.
    """

    kind: Literal["uniform"] = Field(default="uniform", description="Kind of targets [-].")
    number: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        description="Number of targets at the first scan, and on average later [-]."
    )
    std: Reals = Field(
        description="Standard deviation around 0 of each component of a first state but the position [m/s, ...]."
    )
    death_probability: Probability = Field(
        default=0.0, description="Probability with which a target dies from scan to scan [-]."
    )

    _spreads = check(lambda self: _negative_stds(self.std))

    def expected_number(self, num_steps: int) -> float | None:
        """Return the mean number at every scan."""
        return float(self.number)

    def build(self, motion: MotionModel, order: list[int], times: Floats, region: Region) -> UniformSource:
        """Return the targets, moved by `motion`."""
        from vedette.simulation import UniformTargets

        # In either order of a file, the components except the position have the order of the library.
        return UniformTargets(motion, self.number, region, np.array(self.std), self.death_probability)


class UnknownTargets(Section):
    """Nobody knows them: scans were recorded, and estimates have nothing to be scored against."""

    kind: Literal["unknown"] = Field(default="unknown", description="Kind of targets [-].")

    def expected_number(self, num_steps: int) -> float | None:
        """Return None."""
        return None

    def build(self, motion: MotionModel, order: list[int], times: Floats, region: Region) -> ScriptedSource:
        """Return no targets."""
        from vedette.simulation import ScriptedTargets

        return ScriptedTargets(motion, np.empty((0, motion.state_dim)))


Targets = Annotated[
    ScriptedTargets | RecordedTargets | PoissonTargets | UniformTargets | UnknownTargets, Field(discriminator="kind")
]
