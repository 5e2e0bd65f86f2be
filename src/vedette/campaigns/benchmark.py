"""The benchmark of the field: its scenes, and the campaigns of entrants and of the library's own on them.

Each scene has a folder, in it a results folder of the library's own strategies and one of each entrant: all of the same
seed and runs, so that they are paired; entrants, scenes and runs may be added at any time.
"""

from __future__ import annotations

import re
import shlex
import shutil
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from vedette.campaigns.cells import Campaign, resolve, safe_name
from vedette.campaigns.manifest import MANIFEST, read_manifest
from vedette.campaigns.results import open_results
from vedette.campaigns.spec import CampaignSpec
from vedette.errors import InputError, VedetteError
from vedette.internal.programs import start_program
from vedette.scenarios import GeneratedCrowd
from vedette.scenarios.build import build_experiment, build_planner, told_of
from vedette.scenarios.generated import GeneratedScene, scene_text
from vedette.scenarios.generated_crowd import crowd_text
from vedette.scenarios.sections.base import sections_in
from vedette.scenarios.sections.program import ProgramSection

Role: TypeAlias = Literal["planner", "tracker"]

OWN = "vedette"  # folder of the library's own strategies
_FILE = Path(__file__).with_name("benchmark.toml")
_REFERENCE = "vedette.simulation.reference_filters"
_TRACKERS: dict[str, dict[str, Any]] = {
    "vedette": {},
    "last scan": {"kind": "custom", "function": f"{_REFERENCE}:LastScanFilter"},
    "oracle": {"kind": "custom", "function": f"{_REFERENCE}:OracleFilter"},
}


@dataclass(frozen=True, slots=True)
class Scene:
    """A scene of the benchmark.

    Attributes:
        name: of it, and of its folder.
        role: what entrants are on it.
        about: it, in a line.
        beside: the library's own strategies, the first to compare with.
        sensors, crowd: how many of each, where the scene is generated; else 0.
        decide_every: scans between decisions, where it is generated with sensors.
        quick: whether it is one of those that take a minute together.
    """

    name: str
    role: Role
    about: str
    beside: tuple[str, ...]
    sensors: int = 0
    crowd: int = 0
    decide_every: int = 1
    quick: bool = False

    def scenario(self, folder: Path) -> str:
        """The scenario's name, or its file, which is written into the folder."""
        if not self.sensors and not self.crowd:
            return self.name
        text = (
            crowd_text(GeneratedCrowd(num_targets=self.crowd))
            if self.crowd
            else scene_text(GeneratedScene(num_sensors=self.sensors, decide_every=self.decide_every))
        )
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{self.name}.yaml").write_text(text, encoding="utf-8")
        return str((folder / f"{self.name}.yaml").resolve())


@cache
def scenes() -> dict[str, Scene]:
    """All scenes, by name."""
    found = {}
    data: dict[Role, Any] = tomllib.loads(_FILE.read_text(encoding="utf-8"))  # type: ignore[assignment] # of its keys
    for role, said in data.items():
        for each in said["scenes"]:
            found[each["name"]] = Scene(role=role, beside=tuple(said["beside"]), **each)
    return found


@dataclass(frozen=True, slots=True)
class Entrant:
    """Somebody's planner or tracker.

    Attributes:
        name: of it, and of its folders.
        role: what it is.
        section: how a scenario names it.
    """

    name: str
    role: Role
    section: dict[str, Any]


def entrant(role: Role, said: str, *, seconds: float, folder: Path) -> Entrant:
    """An entrant as `NAME=COMMAND`, `NAME=file.py:attribute` or `NAME=package.module:attribute`.

    Args:
        role: what it is.
        said: name, and what it is.
        seconds: that a program may take for an answer.
        folder: in which commands are started, and that files are relative to.

    Raises `InputError` for anything else, a name that is no folder's or one of the library's own.
    """
    name, sign, what = said.partition("=")
    taken = {OWN, *(own for scene in scenes().values() for own in scene.beside)}
    if not sign or not what.strip() or not name or safe_name(name) != name or name.startswith((".", "-")):
        raise InputError(f"{role}: expected NAME=COMMAND or NAME=file.py:attribute; got {said!r}")
    if name in taken:
        raise InputError(f"{role}: expected another name than {', '.join(sorted(taken))}; got {name!r}")
    if re.fullmatch(r"[\w.]+:[\w.]+|[^:\s]+\.py:[\w.]+", what):
        module, _, attribute = what.rpartition(":")
        place = str((folder / module).resolve()) if module.endswith(".py") else module
        if module.endswith(".py") and not Path(place).is_file():
            raise InputError(f"{role} {name}: expected a file; got {place}")
        return Entrant(name, role, {"kind": "custom", "function": f"{place}:{attribute}"})
    command = {"command": shlex.split(what), "folder": str(folder.resolve()), "seconds": seconds}
    return Entrant(name, role, {"kind": "program", **command})


def campaign_of(scene: Scene, entrant: Entrant | None, runs: int, seed: int, folder: Path, **how: Any) -> Campaign:
    """The campaign of a scene: of an entrant, or of the library's own. folder: of the benchmark; how: see `resolve`."""
    names = scene.beside if entrant is None else (entrant.name,)
    given: dict[str, Any] = {"name": f"{scene.name}-{OWN if entrant is None else entrant.name}", "runs": runs}
    given |= {"seed": seed, "scenarios": (scene.scenario(folder / "scenes"),)}
    if scene.role == "planner":
        own: Any = {} if entrant is None else {"planners": {entrant.name: entrant.section}}
        spec = CampaignSpec(**given, planners=names, set=own)
    else:
        filters = _TRACKERS if entrant is None else {entrant.name: entrant.section}
        variants = [
            {"name": name, "set": {"fusion": {"kind": "central", "filter": filters[name]}} if filters[name] else {}}
            for name in names
        ]
        spec = CampaignSpec(**given, planners=("still",), variants=variants, compare="variant")  # type: ignore[arg-type]
    return resolve(spec, **how)


def try_entrant(own: Entrant, campaign: Campaign) -> None:
    """Make an entrant on the scene of a campaign, and greet it where it is a program.

    Raises `InputError` where it cannot be had: what a typo in a command does, and not a run that was lost.
    """
    scenario, planner = campaign.cells[0].scenario, campaign.cells[0].planner
    rng = np.random.default_rng(campaign.seed)
    try:
        build_planner(scenario, planner)
        build_experiment(scenario)
        for _, section in sections_in(scenario.model):
            if isinstance(section, ProgramSection):
                asked = section.asked(scenario.folder)
                scene, seconds = told_of(scenario), asked["start_seconds"]
                start_program(asked["command"], asked["folder"], own.role, scene, rng, seconds)
    except VedetteError as error:
        raise InputError(f"{own.role} {own.name}: expected one that can be started; {error}") from None


def make_way(campaign: Campaign, folder: Path) -> None:
    """Clear a folder of an entrant that has changed since and finished no run there.

    Raises `InputError` where it has finished some, which are not to be mixed with those of now.
    """
    if not (folder / MANIFEST).is_file() or read_manifest(folder)["digest"] == campaign.digest():
        return
    there = open_results(folder)
    if any(there.finished(cell.name) for cell in there.campaign.cells):
        raise InputError(
            f"{folder}: expected runs of {folder.name} as it is now; got those of another program, scene or seed "
            "of that name (enter it under another name, or remove the folder)"
        )
    shutil.rmtree(folder)
