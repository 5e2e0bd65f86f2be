"""Commands about scenario files: list, init, generate, crowd, schema."""

from __future__ import annotations

import json
import re
import shutil
import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from vedette.cli.completing import built_in_scenarios
from vedette.cli.errors import check_ending, usage_error
from vedette.cli.options import Overwrite, SceneFile
from vedette.cli.output import echo, emit_json, note, print_json, print_names
from vedette.errors import InputError

if TYPE_CHECKING:
    from vedette.scenarios import Scenario
    from vedette.scenarios.diagnostics import Path as Place

SCHEMA_FILE = "vedette.schema.json"
_MAX_WIDTH = 120  # of the block of assumptions


def list_() -> None:
    """List the built-in scenarios."""
    from vedette.scenarios import list_builtin
    from vedette.scenarios.yaml_reader import read_yaml

    files = list_builtin()
    described = {name: read_yaml(file.read_text("utf-8"), name).data["description"] for name, file in files.items()}
    print_names(described)
    emit_json([{"name": name, "description": text} for name, text in described.items()])


def init(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="File to write, or a folder.")] = Path("scenario.yaml"),
    source: Annotated[
        str,
        typer.Option("--from", metavar="NAME", help="Scenario to start from.", autocompletion=built_in_scenarios),
    ] = "shore-radar",
    overwrite: Overwrite = False,
) -> None:
    """Write a commented scenario file to start from, and next to it a JSON schema for editors."""
    from vedette.scenarios import list_builtin, load_scenario

    builtin = list_builtin()
    if source not in builtin:
        raise usage_error(f"expected one of {', '.join(builtin)}; got {source}", "--from")
    is_file = path.suffix in (".yaml", ".yml")
    if path.suffix and not is_file and not path.is_dir():
        raise usage_error(f"expected a file that ends in .yaml or .yml, or a folder; got {path}", "path")
    target = path if is_file else path / "scenario.yaml"
    _write_start(_starting_files(load_scenario(source), target), target, overwrite)


Pattern = Annotated[
    Literal["spread", "crowd"],
    typer.Option("--pattern", metavar="NAME", help="spread: groups of targets separate; crowd: they meet."),
]
FieldOfView = Annotated[
    Literal["limited", "full"],
    typer.Option("--field-of-view", metavar="NAME", help="limited: sensors see 250 m; full: they see everything."),
]


def generate(
    path: SceneFile = None,
    sensors: Annotated[int, typer.Option("--sensors", metavar="N", min=1, max=1000, help="Number of sensors.")] = 5,
    targets: Annotated[
        int | None,
        typer.Option("--targets", metavar="N", min=1, max=2000, help="Number of targets; default: 2 per sensor."),
    ] = None,
    pattern: Pattern = "spread",
    view: FieldOfView = "limited",
    decide_every: Annotated[
        int, typer.Option("--decide-every", metavar="N", min=1, max=59, help="Scans between decisions, and horizon.")
    ] = 1,
    seed: Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Random seed of positions and courses.")] = 0,
    overwrite: Overwrite = False,
) -> None:
    """Generate a scene with many sensors, from a seed.

    The region has 500 m x 500 m per sensor, so that scenes with few and with many sensors compare.
    """
    from vedette.scenarios.generated import GeneratedScene, scene_text

    scene = GeneratedScene(
        num_sensors=sensors, pattern=pattern, view=view, num_targets=targets, decide_every=decide_every, seed=seed
    )
    _write_generated(path, scene.name, scene_text(scene), overwrite)


def crowd(
    path: SceneFile = None,
    targets: Annotated[
        int, typer.Option("--targets", metavar="N", min=1, max=100_000, help="Number of targets.")
    ] = 100,
    density: Annotated[
        float, typer.Option("--density", metavar="N", min=1e-3, max=1e6, help="Targets per square kilometre.")
    ] = 25.0,
    clutter: Annotated[
        float,
        typer.Option("--clutter", metavar="N", min=0.0, max=100.0, help="False measurements per target and scan."),
    ] = 0.3,
    measured: Annotated[
        Literal["position", "bearing_range"],
        typer.Option("--measurement", metavar="NAME", help="position, or bearing_range from outside the square."),
    ] = "position",
    steps: Annotated[int, typer.Option("--steps", metavar="N", min=1, max=10_000, help="Number of scans.")] = 40,
    overwrite: Overwrite = False,
) -> None:
    """Generate a scene with many targets and one sensor.

    The area of the region grows with the number of targets, so that small and large crowds compare.
    """
    from vedette.scenarios.generated_crowd import GeneratedCrowd, crowd_text

    scene = GeneratedCrowd(num_targets=targets, density=density, clutter=clutter, measured=measured, num_steps=steps)
    _write_generated(path, scene.name, crowd_text(scene), overwrite)


def _write_generated(path: Path | None, name: str, text: str, overwrite: bool) -> None:
    """Write a scene to `path`, or under its name into that folder or the working directory."""
    target = Path(f"{name}.yaml") if path is None else path
    target = target if target.suffix in (".yaml", ".yml") else target / f"{name}.yaml"
    _write_start({target: _with_schema(text)}, target, overwrite)


def _write_start(files: dict[Path, str], target: Path, overwrite: bool) -> None:
    """Write the files, and the schema next to `target`. Raise `InputError` if one already exists."""
    existing = [str(file) for file in files if file.exists()]
    if existing and not overwrite:
        raise InputError(f"{', '.join(existing)}: already there; --overwrite replaces it")
    files = {**files, target.parent / SCHEMA_FILE: _schema_text()}
    for file, content in files.items():
        write_text(file, content)
        echo(f"wrote {file}")
    emit_json({"written": list(files)})


def _with_schema(text: str) -> str:
    return f"# yaml-language-server: $schema={SCHEMA_FILE}\n{text}"


def _starting_files(scenario: Scenario, target: Path) -> dict[Path, str]:
    """Return the files for a built-in scenario at `target`: its text, its data and their origin, if it has any."""
    from vedette.scenarios import list_builtin

    text = list_builtin()[scenario.name].read_text(encoding="utf-8")
    names = dict.fromkeys(re.findall(r"\.\./data/([\w.-]+)", text))
    files = {target.with_name(name): (scenario.folder / "../data" / name).read_text(encoding="utf-8") for name in names}
    if names:
        origin_text = (scenario.folder / "../data/README.md").read_text(encoding="utf-8")
        files[target.with_name(f"{next(iter(names))}.README.md")] = origin_text
    return {target: _with_schema(text.replace("../data/", "")), **files}


def print_warnings(scenario: Scenario, more: Iterable[tuple[Place, str]] = ()) -> list[str]:
    """Print the warnings of a scenario (`scenario_warnings`) to standard error, and return them."""
    from vedette.scenarios.warnings import scenario_warnings

    lines = list(scenario_warnings(scenario, more))
    for line in lines:
        note(line)
    return lines


def note_assumptions(assumed: Mapping[str, str], sensors: Path) -> None:
    """Print each assumed section and its description, as one aligned block on standard error."""
    if not assumed:
        return
    note(f"Assumed, because {sensors} does not give it:")
    width = min(shutil.get_terminal_size().columns, _MAX_WIDTH)
    for section, text in assumed.items():
        first = f"  {section:<10}  "
        note(textwrap.fill(text, width, initial_indent=first, subsequent_indent=" " * len(first)))


def schema(
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE", help="File to write; default: print.")] = None,
) -> None:
    """Print the JSON schema of scenario files.

    It describes every field. Editors use it to complete and check scenario files.
    """
    check_ending(out, "--out", "json")
    text = _schema_text()
    if out is None:
        echo(text, nl=False)
        print_json(json.loads(text))
    else:
        write_text(out, text)
        echo(f"wrote {out}")
        emit_json({"written": [out]})


def _schema_text() -> str:
    from vedette.scenarios import json_schema

    return json.dumps(json_schema(), indent=2) + "\n"


def write_text(path: Path, text: str) -> None:
    """Write a file completely or not at all, and make its folder. Raise `InputError` if this is not possible."""
    from vedette.internal.files import write_file

    write_file(path, lambda file: file.write(text.encode("utf-8")), make_folder=True)
