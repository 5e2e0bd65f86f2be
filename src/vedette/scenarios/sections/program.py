"""Custom programs that a scenario names, which exchange lines of JSON over a pipe; see docs/benchmark.md."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from vedette.scenarios.sections.base import Name, Positive, Section

if TYPE_CHECKING:  # importing the filters imports the compiler, which a check does not need
    from vedette.models import SensorModel, TargetModel
    from vedette.tracking import CentralFilter


class ProgramSection(Section):
    """A program in any language that answers each line of JSON with a line of JSON; one is started for each run."""

    kind: Literal["program"] = Field(default="program", description="Kind [-].")
    command: Annotated[tuple[Name, ...], Field(strict=False, min_length=1)] = Field(
        description="The program and its arguments [-]."
    )
    folder: str = Field(default=".", description="In which it is started, relative to the scenario file [-].")
    seconds: Positive = Field(default=1.0, description="That it may take for an answer; then it is ended [s].")
    start_seconds: Positive = Field(default=60.0, description="That it may take until it says that it is ready [s].")

    @property
    def code(self) -> str:
        """Description of the command that it runs."""
        return " ".join(self.command)

    def files(self, folder: Path) -> tuple[str, ...]:
        """Return the arguments that are files."""
        place = folder / self.folder
        return tuple(str(place / word) for word in self.command if (place / word).is_file())

    def call_arguments(self, folder: Path) -> dict[str, Any]:
        """Return the arguments for calling the program."""
        given = {name: getattr(self, name) for name in ("command", "seconds", "start_seconds")}
        return {**given, "folder": (folder / self.folder).resolve()}


class ProgramCentral(ProgramSection):
    """A tracker of all sensors' scans that is a program."""

    def instantiate(
        self,
        folder: Path,
        *,
        targets: TargetModel,
        sensors: tuple[SensorModel, ...],
        scene: Callable[[], dict[str, Any]],
    ) -> CentralFilter:
        """Return the filter that runs the program."""
        from vedette.tracking import ProgramFilter

        return ProgramFilter(targets, sensors, scene=scene, **self.call_arguments(folder))
