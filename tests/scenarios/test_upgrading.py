"""`vedette upgrade FILE` gives scenario and sensors files the present names, and changes nothing else of them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scenarios.minimal import MINIMAL, changed
from vedette.cli import app
from vedette.errors import InputError, ScenarioError
from vedette.scenarios import load_scenario, renamed
from vedette.scenarios.loading import parse_scenario
from vedette.scenarios.overrides import replace_fields
from vedette.scenarios.renamed import changes
from vedette.scenarios.sensors_file import check_sensors_file
from vedette.scenarios.upgrading import upgraded_yaml
from vedette.scenarios.yaml_reader import read_yaml

MOTION, NORTH = "{kind: constant_velocity, sigma_v: 1.0}", "heading_deg: 4.0"
FUSION, CONTROL = "fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]}", "{decision_steps: [4, 8]}"
OSPA, DEFAULTS = "ospa: {cutoff: 50.0, first_scan: 5, last_scan: 20}", "  noise: {kind: constant, std: [0.02, 3.0]}"
TARGETS = MINIMAL[MINIMAL.index("targets:\n") : MINIMAL.index("sensor_defaults:")]
SOFT = "{kind: soft_sector, probability: 0.9, max_range: 60.0, range_slope: 1.0, CUT: true}"
AXES = "{kind: by_axis, std: [1.0, 1.0], GROWTH: [1e-5, 1e-5]}"
STEPS = "{kind: STEPS, length: 9.0, speed: 5.0, STAY: false}"
CAMERA = "{kind: camera, half_width_deg: 40.0, pointings_deg: [0.0], CARRIER: "
CROWN = "{kind: joint, search: {kind: cross_entropy, num_samples: 9, SHARE: 0.2}}"

# Text of `MINIMAL`, and what stands in its place: with `former>present` for each renamed key and value.
CASES = [
    [(MOTION, "{kind: constant_velocity, acceleration>noise_model: held>discrete_white}  # as in the paper")],
    [(MOTION, '{kind: constant_velocity, "acceleration">"noise_model": "continuous">"continuous_white"}')],
    [
        (NORTH, "'moves_from'>'stationary_until_first_decision': \"start\">false"),
        (
            DEFAULTS,
            f"{DEFAULTS}\n  moves_from>stationary_until_first_decision: first_decision>true   # waits\n"
            "  truth>true_parameters:   # what is simulated\n    bias: {range: 3.0}",
        ),
    ],
    [
        (
            DEFAULTS,
            f"  measurement: {{kind: position}}\n  noise: {AXES}\n  detection: {SOFT}\n"
            f"  truth>true_parameters: {{noise: {AXES}, detection: {SOFT}, first_detection: {SOFT}}}",
        ),
    ],
    [
        (
            NORTH,
            "scans: {drop_out>scan_loss_probability: 0.1, late: {share>probability: 0.5, up_to>max_delay: 2.0}}",
        )
    ],
    [(NORTH, f"platform: {STEPS}"), ("[0.0, -40.0]}", "[0.0, -40.0], platform: {kind: courses>heading, speed: 1.0}}")],
    [(NORTH, "platform: {kind: &rests still>stationary}")],
    [(NORTH, f"platform: {CAMERA}{STEPS}}}"), ("[0.0, -40.0]}", f"[0.0, -40.0], platform: {CAMERA}{{kind: S}}}}}}")],
    [(NORTH, f"platform: {CAMERA}{{kind: courses>heading, speed: 2.0}}}}")],
    [(TARGETS, "targets: {kind: crowd>uniform, number: 3, std: [1.0, 1.0]}\n")],
    [
        ("{kind: m_delta_glmb}", "{kind: lmb}"),
        (FUSION, "fusion: {kind: clmb, by_views>field_of_view_weighting: true, feedback: true}\nnetwork: NETWORK"),
        (OSPA, f"{OSPA}\nundetected: {{cell>cell_size: 9.0, expected: 1, speed: 1, enters>birth_density: PLACE}}"),
    ],
    [
        (
            CONTROL,
            "{decision_steps: [4, 8], undetected_worth>undetected_target_value: 0.0, search: {kind: cross_entropy, "
            "SHARE: 0.2}}",
        ),
    ],
    [
        ("{kind: m_delta_glmb}", "{kind: lmb}"),
        (FUSION, "fusion: {kind: sequential}"),
        (CONTROL, "{decision_steps: [4, 8], association: known, lookahead: {method: tree, rollout: ROLL}, SEARCH}"),
        (
            OSPA,
            "ospa: {cutoff: 50.0, from_step>first_scan: 5, to_step>last_scan: 20}\n"
            "metrics:\n  tracked_share: {kind: tracked_share>tracked_fraction, min_detection>"
            "min_detection_probability: 0.4}\n  wait: {kind: time_to_track, from_step>first_scan: 1}\n"
            f"planners:\n  printed: {{kind: joint, SEARCH}}\n  kept: {CROWN}\n"
            "  far: {kind: lookahead, method: tree, rollout: ROLL}\n"
            "  assigned: {kind: assigned>assigned_target, targets: [2, 1]}\n  told: {kind: told>true_targets}",
        ),
    ],
]
SHORT = {
    "CUT": "cut>hard_limit",
    "GROWTH": "growth>quadratic_growth",
    "STEPS": "steps>grid_moves",
    "STAY": "stay>allow_staying",
    "CARRIER": "carrier>platform",
    "SHARE": "elite_share>elite_fraction",
    "SEARCH": "search: {kind: sequential_greedy, order: printed>sensor_order}",
    "ROLL": "kept>repeat_last",
    "NETWORK": "{loss>link_loss_probability: 0.1, hops>max_hops: 2}",
    "PLACE": "border>boundary",
    "{kind: S}": "{kind: still>stationary}",
}
PAIR = r"""([\w"']+)>([\w"']+)"""


def texts(case: list[tuple[str, str]]) -> tuple[str, str]:
    """The scenario with former names, and with present ones."""
    found = changed(*case)
    for short, whole in SHORT.items():
        found = found.replace(short, whole)
    return re.sub(PAIR, r"\1", found), re.sub(PAIR, r"\2", found)


@pytest.mark.parametrize("case", CASES, ids=range(len(CASES)))
def test_a_file_with_former_names_is_rewritten(case: list[tuple[str, str]], tmp_path: Path) -> None:
    former, present = texts(case)
    file = tmp_path / "old scene.yaml"
    file.write_text(former, encoding="utf-8")
    with pytest.raises(ScenarioError) as error:
        load_scenario(file)
    assert f"`vedette upgrade '{file}'` rewrites the file" in str(error.value)
    assert upgraded_yaml(former)[0] == present
    assert upgraded_yaml(present) == (present, [])
    done = CliRunner().invoke(app, ["upgrade", str(file)])
    assert (done.exit_code, done.stderr) == (0, "")
    assert file.read_text(encoding="utf-8") == present
    assert load_scenario(file).model == parse_scenario(present)


def test_every_renamed_key_and_value_is_tried() -> None:
    tried = {(c.former, c.present) for case in CASES for c in changes(read_yaml(texts(case)[0], "f").data)}
    tried |= {("gather", "scan_window"), ("anywhere", "uniform")}  # in the tests below
    tables = (*renamed._KEYS.values(), *renamed._VALUES.values())
    assert {pair for table in tables for pair in table.items()} <= tried  # type: ignore[attr-defined]


SENSORS = """\
# Two radars.\r
recording: {gather: 2.5}   # s\r
undetected: {cell: 5000.0, expected: 1.0, speed: 5.0, enters: anywhere}\r
sensors:\r
  - name: "carrier"   # no key\r
    position: [0.0, 40.0]\r
    truth: &true {bias: {range: 3.0}}\r
  - {name: truth, position: [0.0, -40.0], truth: *true}\r
"""


def test_a_sensors_file_keeps_its_letters(tmp_path: Path) -> None:
    file = tmp_path / "radars.yaml"
    file.write_bytes(b"\xef\xbb\xbf" + SENSORS.encode())
    done = CliRunner().invoke(app, ["upgrade", str(file), "--json"])
    assert done.exit_code == 0
    document = json.loads(done.stdout)
    assert [(each["number"], each["former"], each["present"]) for each in document["changes"]] == [
        (2, "gather", "scan_window"),
        (3, "cell", "cell_size"),
        (3, "anywhere", "uniform"),
        (3, "enters", "birth_density"),
        (7, "truth", "true_parameters"),
        (8, "truth", "true_parameters"),
    ]
    wanted = (
        SENSORS.replace("gather", "scan_window").replace("cell:", "cell_size:").replace("truth: ", "true_parameters: ")
    )
    wanted = wanted.replace("enters: anywhere", "birth_density: uniform")
    assert file.read_bytes() == b"\xef\xbb\xbf" + wanted.encode()
    assert check_sensors_file(file).names == ("carrier", "truth")
    again = CliRunner().invoke(app, ["upgrade", str(file)])
    assert again.stdout == f"{file}: up to date; nothing was changed\n"


def test_changes_are_printed_with_their_lines(tmp_path: Path) -> None:
    file = tmp_path / "f.yaml"
    file.write_text(texts(CASES[2])[0])
    done = CliRunner().invoke(app, ["upgrade", str(file)])
    assert done.stdout.splitlines() == [
        "line 16: sensor_defaults.moves_from: first_decision -> true",
        "line 16: sensor_defaults: moves_from -> stationary_until_first_decision",
        "line 17: sensor_defaults: truth -> true_parameters",
        "line 20: sensors[0].moves_from: start -> false",
        "line 20: sensors[0]: moves_from -> stationary_until_first_decision",
        f"{file}: 5 changes",
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            MINIMAL.replace("first_scan: 5", "first_scan: 5, from_step: 5"),
            "ospa.from_step: expected one of .*, got both",
        ),
        (MINIMAL.replace("first_scan: 5", "from_step: 5, from_step: 5"), "expected each key once"),
        (
            MINIMAL.replace("first_scan: 5", '"from\\x5fstep": 5'),
            r"edit the file by hand: line 23: ospa: from_step -> fi",
        ),
        (
            MINIMAL.replace("first_scan: 5", "from_step: &k still").replace("north, ", "north, platform: {kind: *k}, "),
            "got an alias|an alias of a node|edit the file by hand",
        ),
        ("a: [", "a syntax error"),
        ("- still\n", "expected a scenario or sensors file"),
    ],
)
def test_a_file_with_a_fault_is_not_touched(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "f.yaml"
    file.write_text(text)
    with pytest.raises((InputError, ScenarioError), match=message):
        upgraded_yaml(text, str(file))
    assert CliRunner().invoke(app, ["upgrade", str(file)]).exit_code == 1
    assert file.read_text() == text


def test_a_shared_value_that_is_renamed_in_one_of_its_places_is_left_to_the_user() -> None:
    text = MINIMAL.replace("north", "&k still").replace("name: south", "name: south, platform: {kind: *k}")
    with pytest.raises(
        InputError, match=r"edit the file by hand: line 18: sensors\[1\]\.platform\.kind: still -> stat"
    ):
        upgraded_yaml(text)


def test_former_names_in_fields_and_options_are_named() -> None:
    scenario = load_scenario("paper-a")
    with pytest.raises(ScenarioError, match=r"now last_scan: `vedette upgrade FILE` rewrites a campaign file"):
        replace_fields(scenario, {"ospa.to_step": 9})
    with pytest.raises(ScenarioError, match=r"now stationary_until_first_decision: `vedette upgrade FILE`"):
        replace_fields(scenario, {"sensors.*.moves_from": "start"})
    done = CliRunner().invoke(app, ["run", "paper-a", "--planner", "fixed"])
    assert done.exit_code == 2
    assert "got 'fixed' (now constant)" in " ".join(done.stderr.split())


def test_a_file_of_results_is_upgraded_with_them(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_text("{}")
    (tmp_path / "scenario.yaml").write_text(texts(CASES[0])[0])
    done = CliRunner().invoke(app, ["upgrade", str(tmp_path / "scenario.yaml")])
    assert done.exit_code == 2
    assert (tmp_path / "scenario.yaml").read_text() == texts(CASES[0])[0]
