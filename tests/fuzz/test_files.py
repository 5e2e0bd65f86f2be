"""Fuzzers of every file that a person writes: scenarios, campaigns, recorded targets; and of fields set by path."""

from __future__ import annotations

import csv
import datetime
import io
import json
import shutil
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from fuzz.mutations import covariance, nudged, pick, spoil_bytes, spoil_data, spoil_text
from fuzz.outcomes import bounded, check_message, outcome
from scenarios.minimal import MINIMAL
from vedette.campaigns.cells import resolve
from vedette.campaigns.spec import load_spec
from vedette.errors import NumericalError, VedetteError
from vedette.evaluation.runs import run_scenario
from vedette.models import Region
from vedette.recorded.cleaning import Cleaning
from vedette.recorded.targets import RecordedTargets
from vedette.scenarios import Scenario, list_builtin, load_scenario, parse_scenario
from vedette.scenarios.build import build_experiment, build_planner
from vedette.scenarios.dumping import dump_scenario, scenario_files
from vedette.scenarios.overrides import replace_fields
from vedette.scenarios.summary import summary_line, summary_rows
from vedette.scenarios.yaml_reader import read_yaml
from vedette.simulation.journal import RunStopped

Check = Callable[[np.random.Generator], object]
TryCases = Callable[[Check, int], None]

# A first run compiles kernels.
SECONDS_TO_RUN = 900

pytestmark = pytest.mark.fuzz

SHIPS = "time,id,longitude,latitude\n" + "".join(
    f"{2.0 * k},{ship},{-1.1 + 0.0004 * k:.4f},{50.78 + 0.002 * ship:.4f}\n" for k in range(12) for ship in (1, 2)
)
TEXTS = {name: path.read_text(encoding="utf-8") for name, path in list_builtin().items()}
TEXTS["minimal"] = MINIMAL
TEXTS["lmb"] = MINIMAL.replace("m_delta_glmb", "lmb").replace("cm_delta_glmb", "clmb")
TEXTS["ships"] = MINIMAL.replace(
    MINIMAL[MINIMAL.index("targets:") : MINIMAL.index("sensor_defaults:")],
    "targets: {kind: recorded, path: ships.csv, crop: false}\n",
)
DATA = {name: read_yaml(text, name).data for name, text in TEXTS.items()}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder for scenario files, with the data that they name."""
    (tmp_path / "data").mkdir()
    data = next(iter(list_builtin().values())).parents[1] / "data"
    for name in ("solent.csv", "solent-land.geojson"):
        shutil.copy(data / name, tmp_path / "data")
    (tmp_path / "scenarios").mkdir()
    (tmp_path / "scenarios" / "ships.csv").write_text(SHIPS)
    return tmp_path / "scenarios"


def has_custom(value: Any) -> bool:
    """Whether anything in a scenario is the user's own code, which checking does not run."""
    if isinstance(value, dict):
        return value.get("kind") == "custom" or any(map(has_custom, value.values()))
    return isinstance(value, list | tuple) and any(map(has_custom, value))


def scenario_bytes(rng: np.random.Generator) -> bytes:
    name = pick(rng, list(TEXTS))
    if rng.random() < 0.35:
        return spoil_text(rng, TEXTS[name])
    data = spoil_data(rng, DATA[name])
    if rng.random() < 0.25 and isinstance(data, dict):
        dim = 5 if rng.random() < 0.1 else 4
        site = {"existence": 0.1, "mean": [0.0] * dim, "cov": covariance(rng, dim)}
        data["birth"] = {"steps": pick(rng, ["every", [1]]), "sites": [site]}
    if rng.random() < 0.2 and isinstance(data, dict):
        data["sensor_defaults"] = spoil_data(rng, {"noise": {"kind": "constant", "std": [0.01, 1.0]}}, 1)
    text = json.dumps(data, indent=1, ensure_ascii=bool(rng.random() < 0.5))
    for word, number in (("-Infinity", "-.inf"), ("Infinity", ".inf"), ("NaN", ".nan")):
        text = text.replace(word, number)
    return text.encode("utf-8", "surrogatepass")


def check_accepted(scenario: Scenario) -> None:
    """What checking accepts can be told, written, read back and built."""
    summary_line(scenario).encode()
    for _, text in summary_rows(scenario.model):
        text.encode()
    text = dump_scenario(scenario.model)
    assert parse_scenario(text, folder=scenario.folder) == scenario.model
    scenario_files(scenario.model, scenario.folder)
    if has_custom(scenario.model.model_dump()):
        return
    build_experiment(scenario)
    for planner in planners(scenario):
        build_planner(scenario, planner)


def planners(scenario: Scenario) -> list[str]:
    unlabelled = scenario.model.filter.kind in ("phd", "cphd", "cb_member")
    return ["random", "constant", "stationary"] + ([] if unlabelled else ["jdm", "idm"])


def test_scenario_files(try_cases: TryCases, folder: Path) -> None:
    path = folder / "scenario.yaml"

    def check(rng: np.random.Generator) -> None:
        raw = scenario_bytes(rng)
        path.write_bytes(raw)
        with bounded(raw):
            loaded = outcome(lambda: load_scenario(path))
            if loaded is not None:
                check_accepted(loaded)

    try_cases(check, 150)


def small(rng: np.random.Generator) -> dict[str, Any]:
    """A valid scenario of two or three scans and a decision that looks one step ahead with one sample."""
    name = pick(rng, ["paper-a", "minimal", "lmb", "ships", "linear-10"])
    data = json.loads(json.dumps(DATA[name]))
    data["time"] = {**data["time"], "num_steps": int(rng.integers(2, 4))}
    labelled = name != "linear-10" or rng.random() < 0.5
    data["control"] = {
        "decision_steps": [1] if labelled else [],
        "horizon_steps": 1,
        "num_samples": 1,
        "ideal_measurements": pick(rng, ["ideal", "expected", "sampled"]),
    }
    data["ospa"] = {}
    data["birth"] = {**data["birth"], "steps": "every"}
    for track in data["targets"].get("tracks", []):
        track["start_step"] = 1
        track.pop("end_step", None)
    if not labelled:
        data["filter"] = {"kind": pick(rng, ["phd", "cphd", "cb_member"])}
        data["fusion"] = {"kind": "none"}
    elif len(data["sensors"]) == 1:
        data["fusion"] = {"kind": "none"}
    if rng.random() < 0.4 and data["filter"]["kind"] != "lmb" and labelled:
        data["filter"] = {"kind": pick(rng, ["delta_glmb", "m_delta_glmb"]), "gaussian_method": "ukf"}
    return data


def pressed(rng: np.random.Generator, data: dict[str, Any]) -> dict[str, Any]:
    """The scenario with a few of its numbers at or beyond the edge of what makes sense."""
    if rng.random() < 0.3:
        dim = len(data["birth"]["sites"][0]["mean"])
        data["birth"]["sites"][0] = {"existence": 0.1, "mean": [0.0] * dim, "cov": covariance(rng, dim)}
    for _ in range(int(rng.integers(1, 4))):
        section = pick(rng, ["motion", "birth", "targets", "sensors", "sensor_defaults", "filter", "fusion", "region"])
        holder = data.get(section)
        found = [place for place in _numbers(holder)]
        if found:
            collection, key = pick(rng, found)
            collection[key] = nudged(rng, collection[key])
    return data


def _numbers(data: Any) -> list[tuple[Any, Any]]:
    if not isinstance(data, dict | list):
        return []
    keys = list(data) if isinstance(data, dict) else list(range(len(data)))
    here = [(data, key) for key in keys if isinstance(data[key], int | float) and not isinstance(data[key], bool)]
    return here + [place for key in keys for place in _numbers(data[key])]


def is_numerical(error: VedetteError) -> bool:
    """Whether arithmetic ended, at numbers so extreme that no file could tell: a noise of a billionth of the spread."""
    # The second is said of the model, as no filter can tell a noise that is too small from one that is not definite.
    cause = error.__cause__ if isinstance(error, RunStopped) else error
    return isinstance(cause, NumericalError) or "innovation covariance is not positive definite" in str(error)


def test_what_is_accepted_can_be_run(try_cases: TryCases, folder: Path) -> None:
    path = folder / "scenario.yaml"

    def check(rng: np.random.Generator) -> None:
        data = pressed(rng, small(rng))
        path.write_text(json.dumps(data, indent=1))
        with bounded(data, SECONDS_TO_RUN):
            loaded = outcome(lambda: load_scenario(path))
            if loaded is None:
                return
            check_accepted(loaded)
            try:
                run_scenario(loaded, pick(rng, planners(loaded)), seed=0, num_threads=1)
            except VedetteError as error:
                check_message(error)
                if not is_numerical(error):
                    raise

    try_cases(check, 25)


PATHS = [
    *(
        "control.num_samples",
        "sensors.*.platform.speed",
        "sensors.0.speed",
        "sensors.\u00b2.speed",
        "sensors.\u0663.speed",
    ),
    *("sensors.-1.speed", "sensors.99999999999999999999.speed", "sensors." + "9" * 5000 + ".speed"),
    *("sensors.*.x", "sensors.*", "sensors", "birth.sites.0.cov", "birth.sites.*.std", "targets.tracks.*.state.0"),
    *("targets", "motion", "motion.arguments.a", "filter.kind", "filter.limits", "fusion.weights.0", "region.x_max"),
    *("time.num_steps", "name", "", ".", "*", "a\x00b", "\x1b[31m", "x" * 10_000, ".".join("x" * 3000)),
]


def value(rng: np.random.Generator) -> Any:
    holder = spoil_data(rng, {"a": pick(rng, [1, 1.0, "a", [1.0], {"kind": "lmb"}, True])}, 2)
    return next(iter(holder.values()), None)


def test_fields_set_by_path(try_cases: TryCases, folder: Path) -> None:
    (folder / "ships.yaml").write_text(TEXTS["ships"])
    loaded = [load_scenario(name) for name in ("paper-a", "linear-10", folder / "ships.yaml")]

    def check(rng: np.random.Generator) -> None:
        fields = {pick(rng, PATHS): value(rng) for _ in range(int(rng.integers(1, 3)))}
        with bounded(fields):
            changed = outcome(lambda: replace_fields(pick(rng, loaded), fields))
            if changed is not None:
                check_accepted(changed)

    try_cases(check, 80)


CAMPAIGNS = [path.read_text() for path in sorted(Path(__file__).parents[2].glob("examples/campaigns/*.toml"))]
CAMPAIGNS += [
    'name = "own"\nscenarios = ["small.yaml"]\nplanners = ["random", "stationary"]\nruns = 2\n'
    'set = {"ospa.cutoff" = 20}\n'
    '[grid]\n"sensors.*.platform.speed" = [1.0, 2.0]\n[[variants]]\nname = "a"\nset = {"control.num_samples" = 3}\n'
    '[[variants]]\nname = "b"\n',
    'name = "times"\nscenarios = ["small.yaml"]\nruns = 2\n[grid]\n"time.start" = [1e400, inf, nan, 2024-01-01]\n',
]
DEEP = ["[" * 5000, "a = " + "[" * 2000 + "]" * 2000, "a = " + "{b=" * 900 + "1" + "}" * 900, "a." * 900 + "b = 1"]


def campaign_bytes(rng: np.random.Generator) -> bytes:
    if rng.random() < 0.04:
        return pick(rng, DEEP).encode()
    raw = spoil_text(rng, pick(rng, CAMPAIGNS))
    return raw.replace(b"runs = 100", b"runs = 10")


def test_campaign_files(try_cases: TryCases, folder: Path) -> None:
    (folder / "small.yaml").write_text(MINIMAL)
    path = folder / "campaign.toml"

    def check(rng: np.random.Generator) -> None:
        raw = campaign_bytes(rng)
        path.write_bytes(raw)
        with bounded(raw):
            spec = outcome(lambda: load_spec(path))
            if spec is None:
                return
            campaign = outcome(lambda: resolve(spec, folder))
            if campaign is not None:
                campaign.digest()
                assert (folder / campaign.default_folder).name == campaign.default_folder
                outcome(lambda: (folder / campaign.default_folder).exists() and None)

    try_cases(check, 60)


CELLS: list[Any] = [
    *(
        "",
        " ",
        "1",
        "2.5",
        "-1e400",
        "nan",
        "inf",
        "1_000",
        "\u0663",
        "0x10",
        "x" * 5000,
        "1e308",
        "-1e308",
        "200",
        "91",
    ),
    *("2024-01-01T00:00:00Z", "2024-01-01T00:00:00+25:00", "9999-12-31T23:59:59-12:00", "0001-01-01T00:00:00+12:00"),
    *("\x1b[31m", '"', "a,b"),
]
VALUES: list[Any] = [
    *(None, True, 0, 2**62, 1.5, float("nan"), float("inf"), 1e308, "a", b"\xff", Decimal("1.5"), [1.0], {"a": 1}),
    *(datetime.datetime(2024, 1, 1), datetime.datetime(2024, 1, 1, tzinfo=datetime.UTC)),
    *(datetime.date(2024, 1, 1), datetime.timedelta(days=1)),
]


def csv_bytes(rng: np.random.Generator) -> bytes:
    how = rng.random()
    if how < 0.4:
        return spoil_text(rng, SHIPS)
    rows = list(csv.reader(io.StringIO(SHIPS)))
    for _ in range(int(rng.integers(1, 4))):
        row = pick(rng, rows)
        if row:
            row[int(rng.integers(len(row)))] = pick(rng, CELLS)
        if rng.random() < 0.2:
            rows.append(list(pick(rng, rows)))
    out = io.StringIO()
    csv.writer(out).writerows(rows)
    return out.getvalue().encode("utf-8", "surrogatepass")


def write_parquet(rng: np.random.Generator, path: Path) -> None:
    num = 12
    columns: dict[str, Any] = {
        "time": [float(k // 2) for k in range(num)],
        "id": [k % 2 for k in range(num)],
        "x": [1.0 * k for k in range(num)],
        "y": [2.0 * k for k in range(num)],
    }
    for _ in range(int(rng.integers(0, 3))):
        name = pick(rng, [*columns, "vx", "vy", "longitude", ""])
        thing = pick(rng, VALUES)
        columns[name] = pick(rng, [[thing] * num, [thing] + [None] * (num - 1)])
    parquet.write_table(pyarrow.table(columns), path)
    if rng.random() < 0.4:
        path.write_bytes(spoil_bytes(rng, path.read_bytes()))


def test_recorded_files(try_cases: TryCases, folder: Path) -> None:
    choices = [
        None,
        {"time": "time"},
        {"longitude": "x", "latitude": "y"},
        {"x": "longitude", "y": "latitude"},
        {"": ""},
    ]
    origins = [None, (-1.1, 50.78), (1e300, 0.0), (180.0, -90.0), (0.0, 0.0)]
    moments = [None, 0.0, 1e300, "2024-01-01T00:00:00Z", "never", "9" * 5000]

    def check(rng: np.random.Generator) -> None:
        path = folder / pick(rng, ["data.csv", "data.CSV", "data.parquet"])
        if path.suffix == ".parquet":
            write_parquet(rng, path)
        else:
            path.write_bytes(csv_bytes(rng))
        cleaning = Cleaning(
            max_gap=pick(rng, [60.0, 1e-9, 1e300]),
            max_speed=pick(rng, [None, 30.0, 1e-300]),
            region=pick(rng, [None, Region(-1e3, 1e3, -1e3, 1e3)]),
        )
        with bounded(path.read_bytes()):
            targets = outcome(
                lambda: RecordedTargets.from_file(
                    path,
                    columns=pick(rng, choices) if rng.random() < 0.3 else None,
                    origin_deg=pick(rng, origins) if rng.random() < 0.2 else None,
                    time_origin=pick(rng, moments) if rng.random() < 0.2 else None,
                    cleaning=cleaning,
                )
            )
            if targets is not None:
                truth = outcome(lambda: targets.truth(np.arange(5.0), rng=rng))
                assert truth is None or all(np.isfinite(truth.at(k)[1]).all() for k in range(5))

    try_cases(check, 150)


def test_a_recorded_scenario_that_is_accepted_can_be_run(try_cases: TryCases, folder: Path) -> None:
    """The file of recorded targets spoilt, and the section that names it."""
    data = DATA["ships"]
    path = folder / "scenario.yaml"

    def check(rng: np.random.Generator) -> None:
        (folder / "ships.csv").write_bytes(csv_bytes(rng) if rng.random() < 0.7 else SHIPS.encode())
        section = {**data["targets"], "max_speed": 30.0, "time_origin": 0.0, "origin_deg": [-1.1, 50.78]}
        targets = section if rng.random() < 0.5 else spoil_data(rng, section, 2)
        path.write_text(json.dumps({**data, "targets": targets}).replace("Infinity", ".inf").replace("NaN", ".nan"))
        with bounded(path.read_bytes()):
            loaded = outcome(lambda: load_scenario(path))
            if loaded is not None:
                check_accepted(loaded)
                experiment = build_experiment(loaded)
                experiment.targets.truth(experiment.times, rng=rng)

    try_cases(check, 60)
