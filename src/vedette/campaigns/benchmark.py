"""The benchmark: its scenes, and the campaigns of entrants and of the library's own strategies on them.

Each scene has a folder with a results folder of the library's own strategies and one of each entrant. All use the same
seed and runs, so that they are paired. Entrants, scenes and runs may be added at any time.
"""

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
from vedette.scenarios.build import build_experiment, build_planner, scene_for_program
from vedette.scenarios.generated import GeneratedScene, scene_text
from vedette.scenarios.generated_crowd import crowd_text
from vedette.scenarios.sections.base import sections_in
from vedette.scenarios.sections.program import ProgramSection

Role: TypeAlias = Literal["planner", "tracker"]

OWN = "vedette"  # folder name of the library's own strategies
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
        name: name of the scene and of its folder.
        role: role of the entrants on it.
        about: description in one line.
        beside: names of the library's own strategies, the reference first.
        sensors, crowd: numbers of sensors and targets of a generated scene, else 0.
        decide_every: scans between decisions of a generated scene with sensors.
        quick: whether it is one of the scenes that together take a minute.
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
        """Return the name of the scenario, or the path of its generated file, which is written into the folder."""
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
    """Return all scenes by name."""
    by_name = {}
    data: dict[Role, Any] = tomllib.loads(_FILE.read_text(encoding="utf-8"))  # type: ignore[assignment] # role keys
    for role, section in data.items():
        for fields in section["scenes"]:
            by_name[fields["name"]] = Scene(role=role, beside=tuple(section["beside"]), **fields)
    return by_name


@dataclass(frozen=True, slots=True)
class Entrant:
    """A planner or tracker entered into the benchmark."""

    name: str  # name of the entrant and of its folders
    role: Role  # planner or tracker
    section: dict[str, Any]  # its section in a scenario


def entrant(role: Role, text: str, *, seconds: float, folder: Path) -> Entrant:
    """Return the entrant given as `NAME=COMMAND`, `NAME=file.py:attribute` or `NAME=package.module:attribute`.

    Args:
        role: planner or tracker.
        text: the entrant in one of these forms.
        seconds: time limit of a program for an answer.
        folder: working directory of commands. File names are relative to it.

    Raises `InputError` for another text, or a name that is unfit for a folder or used by the library.
    """
    name, sign, target = text.partition("=")
    taken = {OWN, *(strategy for scene in scenes().values() for strategy in scene.beside)}
    if not sign or not target.strip() or not name or safe_name(name) != name or name.startswith((".", "-")):
        raise InputError(f"{role}: expected NAME=COMMAND or NAME=file.py:attribute; got {text!r}")
    if name in taken:
        raise InputError(f"{role}: expected another name than {', '.join(sorted(taken))}; got {name!r}")
    if re.fullmatch(r"[\w.]+:[\w.]+|[^:\s]+\.py:[\w.]+", target):
        module, _, attribute = target.rpartition(":")
        source = str((folder / module).resolve()) if module.endswith(".py") else module
        if module.endswith(".py") and not Path(source).is_file():
            raise InputError(f"{role} {name}: expected a file; got {source}")
        return Entrant(name, role, {"kind": "custom", "function": f"{source}:{attribute}"})
    command = {"command": shlex.split(target), "folder": str(folder.resolve()), "seconds": seconds}
    return Entrant(name, role, {"kind": "program", **command})


def campaign_of(scene: Scene, entrant: Entrant | None, runs: int, seed: int, folder: Path, **how: Any) -> Campaign:
    """Return the campaign of a scene for an entrant. None: for the library's own strategies.

    folder: folder of the benchmark. how: see `resolve`.
    """
    names = scene.beside if entrant is None else (entrant.name,)
    fields: dict[str, Any] = {"name": f"{scene.name}-{OWN if entrant is None else entrant.name}", "runs": runs}
    fields |= {"seed": seed, "scenarios": (scene.scenario(folder / "scenes"),)}
    if scene.role == "planner":
        settings: Any = {} if entrant is None else {"planners": {entrant.name: entrant.section}}
        spec = CampaignSpec(**fields, planners=names, set=settings)
    else:
        filters = _TRACKERS if entrant is None else {entrant.name: entrant.section}
        variants = [
            {"name": name, "set": {"fusion": {"kind": "central", "filter": filters[name]}} if filters[name] else {}}
            for name in names
        ]
        spec = CampaignSpec(**fields, planners=("stationary",), variants=variants, compare="variant")  # type: ignore[arg-type]
    return resolve(spec, **how)


def check_entrant(entrant: Entrant, campaign: Campaign) -> None:
    """Create an entrant on the scene of a campaign, and start it once if it is a program.

    Raises `InputError` if this fails: typos in a command are reported here and not as lost runs.
    """
    scenario, planner = campaign.cells[0].scenario, campaign.cells[0].planner
    rng = np.random.default_rng(campaign.seed)
    try:
        build_planner(scenario, planner)
        build_experiment(scenario)
        for _, section in sections_in(scenario.model):
            if isinstance(section, ProgramSection):
                program = section.call_arguments(scenario.folder)
                scene, seconds = scene_for_program(scenario), program["start_seconds"]
                start_program(program["command"], program["folder"], entrant.role, scene, rng, seconds)
    except VedetteError as error:
        raise InputError(f"{entrant.role} {entrant.name}: expected one that can be started; {error}") from None


def clear_stale_results(campaign: Campaign, folder: Path) -> None:
    """Delete the folder of an entrant that has changed and has finished no run there.

    Raises `InputError` if it has finished some, as they must not be mixed with new ones.
    """
    if not (folder / MANIFEST).is_file() or read_manifest(folder)["digest"] == campaign.digest():
        return
    results = open_results(folder)
    if any(results.finished(cell.name) for cell in results.campaign.cells):
        raise InputError(
            f"{folder}: expected runs of {folder.name} as it is now; got those of another program, scene or seed "
            "of that name (enter it under another name, or remove the folder)"
        )
    shutil.rmtree(folder)
