"""Sensors files: YAML files with `sensors` and any other section of a scenario, but without its time and targets."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any, NamedTuple

from vedette.errors import InputError, ScenarioError
from vedette.internal.quantities import COMPONENTS, HEIGHT_DEPENDENT
from vedette.internal.reading import read_text
from vedette.internal.text import pluralise
from vedette.kernels.base.types import CLIMB, HEIGHT, PLANE, STATE_COMPONENTS, VELOCITY, common_components
from vedette.scenarios.diagnostics import Diagnostic, Fault, describe
from vedette.scenarios.loading import diagnose, locate_fault
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.base import Section
from vedette.scenarios.sections.courses import headings_beside_north
from vedette.scenarios.sections.recording import RecordingSection
from vedette.scenarios.sections.targets import RecordedTargets
from vedette.scenarios.validation import read_section
from vedette.scenarios.wording import name_in_words
from vedette.scenarios.yaml_reader import MAX_BYTES, Document, read_yaml

# Sections of a scenario that a sensors file need not give.
_PLACEHOLDERS: dict[str, Any] = {
    "time": {"num_steps": 1},
    "region": {"x_min": -1e6, "x_max": 1e6, "y_min": -1e6, "y_max": 1e6},
}
EXPECTED_BIRTHS = 0.5  # expected births from measurements in the region between two scans
_EXISTENCE = 0.03  # largest existence probability of a birth from a measurement
HEIGHT_STD, _CLIMB_STD = 4000.0, 10.0  # m and m/s, standard deviations of a birth
MAX_STEPS = 1_000_000  # steps, the maximum of a scenario
# Sections about files, which commands name, and what they add to the section.
_SECTIONS_OF_FILES: dict[str, tuple[type[Section], dict[str, str]]] = {
    "recording": (RecordingSection, {"path": "scans.csv"}),
    "targets": (RecordedTargets, {"kind": "recorded", "path": "truth.csv"}),
}
_MAX_NAMED = 5  # sensors that a summary names
_ASSUMED = ("region", "motion", "survival", "birth")  # each is assumed from the scans unless it is given


class SensorsFile(NamedTuple):
    """A valid sensors file."""

    names: tuple[str, ...]  # of the sensors
    quantities: tuple[str, ...]  # that they measure, such as "bearing"
    not_given: tuple[str, ...]  # sections that `vedette track` assumes

    @property
    def summary(self) -> str:
        """Summary such as `2 sensors (Calshot, boat), bearing and range`."""
        named = ", ".join(self.names[:_MAX_NAMED]) + (", ..." if len(self.names) > _MAX_NAMED else "")
        return f"{pluralise(len(self.names), 'sensor')} ({named}), {' and '.join(self.quantities)}"


def is_sensors_file(path: FilePath) -> bool:
    """Return True if the file is YAML with `sensors`, but has neither `time` nor a `kind` of `targets`."""
    if not path.is_file() or path.suffix.lower() == ".toml":
        return False
    data = read_yaml(read_text(path, "sensors file", MAX_BYTES), str(path)).data
    if not isinstance(data, Mapping) or "sensors" not in data or "time" in data:
        return False
    targets = data.get("targets")
    return not isinstance(targets, Mapping) or "kind" not in targets


def check_sensors_file(path: FilePath) -> SensorsFile:
    """Check a sensors file without scans.

    Raises:
        InputError: the file cannot be read.
        ScenarioError: with every fault of the file.
    """
    document = read_sensors_file(path)
    given = {key: value for key, value in document.data.items() if key not in _SECTIONS_OF_FILES}
    data = {**placeholder_sections(given, 10.0), "name": path.stem, **given}
    data |= {"time": {"num_steps": MAX_STEPS}, "targets": {"kind": "scripted", "tracks": []}}
    model, faults = diagnose(replace(document, data=data), path.parent)
    texts = [(fault.place, _message_for_sensors_file(fault, document, data, path)) for fault in faults]
    texts += [(fault.place, fault.message(str(path))) for fault in _faults_of_files(document)]
    if model is None or texts:
        raise ScenarioError([text for _, text in sorted(texts)])
    return SensorsFile(model.sensor_names, _quantities(model), _not_given(document.data))


def _faults_of_files(document: Document) -> Iterator[Fault]:
    """Yield the faults of the sections about files, which commands name."""
    for name, (section, rest) in _SECTIONS_OF_FILES.items():
        given = document.data.get(name, {})
        diagnostics = [Diagnostic((), "a mapping", describe(given))]
        if isinstance(given, Mapping):
            _, diagnostics = read_section(section, {**rest, **given})
        yield from (locate_fault(document, each._replace(path=(name, *each.path))) for each in diagnostics)


def placeholder_sections(given: Mapping[str, Any], speed: float) -> dict[str, Any]:
    """Return sections that a sensors file does not give, before scans are read; speed: std of velocities, m/s."""
    has_height = measures_heights(given)
    section = given.get("motion")
    motion: Mapping[str, Any] = section if isinstance(section, Mapping) else {}
    names = _state_components(motion, "constant_velocity_height" if has_height else "constant_velocity")
    birth = measured_birth(100.0, speed, names)
    return {**_PLACEHOLDERS, "birth": birth, **({"motion": {"kind": "constant_velocity_height"}} if has_height else {})}


def _state_components(motion: Mapping[str, Any], default: str) -> Sequence[str]:
    """Return the names of the components of states, as far as a section of the motion says. default: its kind."""
    modes, kind = motion.get("modes"), motion.get("kind", default)
    if isinstance(modes, Mapping):
        each = [mode.get("motion", {}) for mode in modes.values() if isinstance(mode, Mapping)]
        return common_components([_state_components(own, default) for own in each if isinstance(own, Mapping)])
    names = motion.get("components", STATE_COMPONENTS.get(kind) if isinstance(kind, str) else None)
    return names if isinstance(names, Sequence) else PLANE


def measures_heights(given: Mapping[str, Any]) -> bool:
    """Return True if a sensor of a file has a measurement that depends on the height of a target."""
    sensors, defaults = given.get("sensors"), given.get("sensor_defaults")
    sections = [defaults, *(sensors if isinstance(sensors, list) else ())]
    measured = [section.get("measurement") for section in sections if isinstance(section, Mapping)]
    return any(isinstance(each, Mapping) and each.get("kind") in HEIGHT_DEPENDENT for each in measured)


def measured_birth(std: float, speed: float, components: Sequence[str]) -> dict[str, Any]:
    """Return a section `birth` with births from measurements.

    Args:
        std: of positions, m.
        speed: standard deviation of velocities, m/s.
        components: names of the components of states.
    """
    known = {**dict.fromkeys(PLANE[:2], std), **dict.fromkeys(PLANE[VELOCITY], speed)}
    known |= {HEIGHT: HEIGHT_STD, CLIMB: _CLIMB_STD}
    stds = [known.get(name, 0.1) for name in components]
    return {"sites": [], "from_measurements": {"expected": EXPECTED_BIRTHS, "max_existence": _EXISTENCE, "std": stds}}


def _quantities(model: ScenarioModel) -> tuple[str, ...]:
    kinds = dict.fromkeys(sensor.measurement.kind for sensor in model.sensors)
    return tuple(dict.fromkeys(name_in_words(name) for kind in kinds for name in COMPONENTS.get(kind, (kind,))))


def _not_given(given: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the sections that are assumed; clutter is one of them if any sensor has none."""
    shared = given.get("sensor_defaults") or {}
    has_clutter = "clutter" in shared or all("clutter" in sensor for sensor in given["sensors"])
    return (*(name for name in _ASSUMED if name not in given), *(() if has_clutter else ("clutter",)))


def read_sensors_file(sensors: FilePath, text: str | None = None) -> Document:
    """Read a sensors file; raises `InputError` if it is no mapping, or has `heading_deg` but counts from north.

    text: its contents; None: those of the file.
    """
    document = read_yaml(read_text(sensors, "sensors file", MAX_BYTES) if text is None else text, str(sensors))
    if not isinstance(document.data, Mapping):
        raise InputError(f"{sensors}: expected a mapping with `sensors`; got {describe(document.data)}")
    if "time" not in document.data and (paths := headings_beside_north(document.data)):
        wanted = "course_deg, clockwise from true north, as bearings in this file"
        faults = (Diagnostic(path, wanted, "heading_deg, which counts from east") for path in paths)
        raise ScenarioError([locate_fault(document, each).message(str(sensors)) for each in faults])
    return document


def validated_model(document: Document, data: Mapping[str, Any], sensors: FilePath) -> ScenarioModel:
    """Return the scenario of a document with other data; raises `ScenarioError` for its faults."""
    model, faults = diagnose(replace(document, data=data), sensors.parent)
    if model is None:
        raise ScenarioError([_message_for_sensors_file(fault, document, data, sensors) for fault in faults])
    return model


def _message_for_sensors_file(fault: Fault, document: Document, data: Mapping[str, Any], sensors: FilePath) -> str:
    """Return the message of a fault, without fields and places that the sensors file does not have."""
    path = fault.diagnostic.path
    if path == ("recording",):
        got = fault.diagnostic.got
        return got if data["recording"]["path"] in got else f"{sensors}: recording.{got}"
    if path[:1] == ("targets",) and "targets" not in document.data:
        file, got = data["targets"]["path"], fault.diagnostic.got
        if path == ("targets", "path"):
            return got if file in got else f"{file}: {got}"
        where = ".".join(map(str, path))
        return f"{file}: {where}: expected {fault.diagnostic.expected}, got {got} (it belongs in {sensors})"
    if path[:1] == ("sensors",) and path[-2:] == ("measurement", "kind") and "birth" not in document.data:
        wanted = "a measurement that says where a target is, or births at sites: give one wide site in birth.sites"
        fault = Fault(fault.place, fault.diagnostic._replace(expected=wanted))
    return fault.message(str(sensors))
