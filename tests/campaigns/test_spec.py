"""Campaign files: what they mean, and what is said of their faults."""

from __future__ import annotations

from pathlib import Path

import pytest

from vedette.campaigns.cells import Campaign, resolve
from vedette.campaigns.spec import load_spec, parse_spec
from vedette.errors import InputError

SMALL = 'name = "small"\nscenarios = ["paper-a"]\nruns = 3\n'


def campaign(text: str = "", base: str = SMALL) -> Campaign:
    return resolve(parse_spec(base + text))


def test_the_least_campaign_compares_the_papers_strategies() -> None:
    least = campaign()
    assert [cell.name for cell in least.cells] == ["jdm", "idm", "random"]
    assert [cell.planner for cell in least.cells] == ["jdm", "idm", "random"]
    assert (least.compare, least.seed, least.num_runs) == ("planner", 0, 3)
    assert len(least.groups()) == 1
    assert [(cell.name, run) for cell, run in least.tasks[:4]] == [("jdm", 0), ("idm", 0), ("random", 0), ("jdm", 1)]


def test_every_combination_of_all_axes_is_a_cell() -> None:
    full = campaign(
        """
        planners = ["jdm", "stationary"]
        fusions = ["cm_delta_glmb", "clmb"]
        set."ospa.cutoff" = 50.0
        [grid]
        "sensors.*.platform.speed" = [30.0, 50.0, 70.0]
        "control.num_samples" = [5]
        """.replace("        ", ""),
        'name = "full"\nscenarios = ["paper-a", "paper-e"]\nruns = 2\n',
    )
    assert len(full.cells) == 2 * 2 * 2 * 3
    assert len({cell.name for cell in full.cells}) == len(full.cells)
    first, last = full.cells[0], full.cells[-1]
    assert first.name == "paper-a-jdm-cm_delta_glmb-speed-30.0"
    assert last.settings == {
        "scenario": "paper-e",
        "planner": "stationary",
        "fusion": "clmb",
        "sensors.*.platform.speed": 70.0,
        "control.num_samples": 5,
    }
    assert last.scenario.model.fusion.kind == "clmb"
    assert [sensor.platform.model_dump()["speed"] for sensor in last.scenario.model.sensors] == [70.0, 70.0]
    assert last.scenario.model.control.num_samples == 5
    assert last.scenario.model.ospa.cutoff == 50.0
    assert len(full.groups()) == 12
    assert all([cell.planner for cell in group] == ["jdm", "stationary"] for group in full.groups())


def test_variants_hold_settings_that_belong_together() -> None:
    variants = campaign(
        """
        planners = ["stationary"]
        [[variants]]
        name = "GLMB"
        [[variants]]
        name = "LMB, CLMB"
        set = {"filter.kind" = "lmb", "fusion.kind" = "clmb"}
        """.replace("        ", "")
    )
    assert [cell.name for cell in variants.cells] == ["stationary-GLMB", "stationary-LMB_CLMB"]
    assert variants.compare == "variant"
    assert [cell.scenario.model.filter.kind for cell in variants.cells] == ["delta_glmb", "lmb"]


def test_a_central_filter_is_compared_with_fusions() -> None:
    both = campaign('planners = ["stationary"]\nfusions = ["cm_delta_glmb", "central"]\n')
    assert [cell.name for cell in both.cells] == ["stationary-cm_delta_glmb", "stationary-central"]
    assert both.compare == "fusion"


def test_scenarios_are_named_or_lie_beside_the_file(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "scene.yaml").write_text(resolve_text("paper-e"))
    (folder / "spec.toml").write_text(
        'name = "x"\nscenarios = ["scene.yaml", "paper-a"]\nruns = 1\nplanners = ["stationary"]'
    )
    beside = resolve(load_spec(folder / "spec.toml"), folder)
    assert [cell.name for cell in beside.cells] == ["scene-stationary", "paper-a-stationary"]
    with pytest.raises(
        InputError, match=r"scenarios\.0: .*absent\.yaml: no such file; expected a YAML file or one of "
    ):
        resolve(parse_spec('name = "x"\nscenarios = ["absent.yaml"]\nruns = 1'), folder)


def resolve_text(name: str) -> str:
    from vedette.scenarios import load_scenario
    from vedette.scenarios.dumping import dump_scenario

    return dump_scenario(load_scenario(name).model)


def test_the_digest_is_of_all_that_fixes_a_result_and_of_nothing_else(tmp_path: Path) -> None:
    reference = campaign().digest()
    assert campaign().digest() == reference
    assert campaign(base=SMALL.replace("small", "other")).digest() == reference
    assert campaign(base=SMALL.replace("3", "30")).digest() == reference
    assert campaign("seed = 1").digest() != reference
    assert campaign('planners = ["jdm", "idm"]').digest() != reference
    assert campaign('set."control.num_samples" = 3').digest() != reference


def test_the_digest_covers_the_files_that_a_scenario_names(tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text(resolve_text("paper-a"))
    model = "from vedette.models import constant_velocity\n\n\ndef motion():\n    return constant_velocity({})\n"
    (tmp_path / "own.py").write_text(model.format(5.0))
    own = 'set.motion = {kind = "custom", function = "own.py:motion", components = ["px", "py", "vx", "vy"]}'
    spec = parse_spec(f'name = "x"\nscenarios = ["scene.yaml"]\nruns = 1\nplanners = ["stationary"]\n{own}')
    before = resolve(spec, tmp_path).digest()
    (tmp_path / "own.py").write_text(model.format(6.0))
    assert resolve(spec, tmp_path).digest() != before


def test_names_of_cells_fit_any_folder() -> None:
    fields = {f"sensors.{i}.noise.{name}": [1.0, 2.0] for i in (0, 1) for name in ("sigma_range", "sigma_bearing_deg")}
    text = "\n".join(f'"{field}" = {values}' for field, values in fields.items())
    cells = campaign(f'filters = ["m_delta_glmb", "delta_glmb"]\n[grid]\n{text}').cells
    names = [cell.name for cell in cells]
    assert len(set(names)) == len(names) == 96
    assert max(map(len, names)) <= 120


@pytest.mark.parametrize("name", ["-rf", "--force", ".", "..", ".hidden", "../up", "nul", "Con.x", "COM1"])
def test_names_that_no_file_should_have_are_refused(name: str) -> None:
    """A folder named `-rf-results` is an option to the next command that is given it."""
    text = 'name = "{}"\nscenarios = ["paper-a"]\nruns = 1\n[[variants]]\nname = "{}"\n'
    wanted = r"expected a name that (begins with neither a dash nor a dot|files can have everywhere)"
    with pytest.raises(InputError, match=rf"^<text>: name: {wanted}.*, got "):
        parse_spec(text.format(name, "a"))
    with pytest.raises(InputError, match=rf"^<text>: variants\[0\]\.name: {wanted}.*, got "):
        parse_spec(text.format("a", name))


def test_more_runs_of_the_same_campaign() -> None:
    more = campaign().with_runs(7)
    assert (more.num_runs, more.spec["runs"], len(more.tasks)) == (7, 7, 21)
    assert more.digest() == campaign().digest()
    with pytest.raises(InputError, match="runs: expected a number of at most 1000000"):
        campaign().with_runs(10**11)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name =", r"spec\.toml: expected TOML; Invalid value"),
        ("", r"(?s)spec\.toml: name: required key is missing.*scenarios.*runs"),
        (SMALL + "planners = []", r"planners: expected a list of at least 1, got an empty list"),
        (
            SMALL + 'planner = ["jdm"]',
            r"planner: expected one of compare, .*, got an unknown key \(did you mean planners\?\)",
        ),
        (SMALL + 'planners = "jdm"', r"planners: expected a list, got \"jdm\""),
        (SMALL + 'planners = ["jdm", "idm", "jdm"]', r"planner: expected each value once, got \"jdm\" again"),
        (SMALL.replace("3", "0"), r"runs: expected a number of at least 1, got 0"),
        (SMALL.replace("3", "2.5"), r"runs: expected a whole number, got 2\.5"),
        (SMALL + "seed = -1", r"seed: expected a number of at least 0, got -1"),
        (SMALL + 'compare = "speed"', r"compare: expected one of planner, got \"speed\""),
        (SMALL + 'compare = "scenario"', r"compare: .* planner, as runs of two scenarios are no pairs, got"),
        (SMALL.replace("small", "x" * 61), r"name: expected text of at most 60 characters"),
        (SMALL + 'set."ospa.cutoff" = nan', r"set\.ospa\.cutoff: expected a finite number, got nan"),
        (SMALL + '[grid]\nplanner = ["jdm"]', r"grid: expected paths of scenario fields, got \"planner\""),
        (SMALL + '[grid]\n"ospa.cutoff" = 3', r"grid\.ospa\.cutoff: expected a list, got 3"),
        (SMALL + '[[variants]]\nnam = "a"', r"variants\[0\]\.nam: expected one of name, set, got an unknown key"),
    ],
)
def test_what_is_wrong_with_the_file_is_named(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_spec(text, "spec.toml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('filters = ["lmb"]', r"cell jdm: fusion\.kind: expected sequential, parallel, clmb, arithmetic_average, "),
        ('filters = ["glmb"]', r"cell jdm: filter\.kind: expected one of"),
        ('[grid]\n"control.num_samples" = [5, 0]', r"cell jdm-num_samples-0: control\.num_samples: expected a number"),
        (
            "set.control.num_samples = 5",
            r"cell jdm: control: expected the whole section, with .*\"control\.num_samples\"",
        ),
        ('[grid]\n"control.samples" = [5]', r"cell jdm: control\.samples: expected one of"),
    ],
)
def test_a_combination_that_cannot_be_is_named_by_its_cell(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        campaign(text)


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"absent\.toml: no such file; expected a campaign file"):
        load_spec(tmp_path / "absent.toml")
    (tmp_path / "latin.toml").write_bytes('name = "café"'.encode("latin-1"))
    with pytest.raises(InputError, match=r"latin\.toml: expected UTF-8 text; byte 11"):
        load_spec(tmp_path / "latin.toml")


@pytest.mark.parametrize(
    "file", sorted((Path(__file__).parents[2] / "examples" / "campaigns").glob("*.toml")), ids=lambda file: file.stem
)
def test_the_examples_can_be_run(file: Path) -> None:
    assert len(resolve(load_spec(file), file.parent).cells) > 1
