"""`vedette upgrade FILE.toml` gives campaign files the present names, and changes nothing else of them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from vedette.campaigns.renamed import upgraded_toml
from vedette.campaigns.spec import load_spec, parse_spec
from vedette.cli import app
from vedette.errors import InputError

FORMER = """\
# Names of strategies, of fields, and inside sections.
name = "fixed"   # the name of the campaign
scenarios = ["paper-a"]
planners = ["jdm", 'fixed', "still"]   # and `told`
runs = 2
compare = "sensors.*.moves_from"
set."ospa.from_step" = 5
set.ospa.to_step = 9

[grid]
"sensors.*.moves_from" = ["first_decision", 'start']
'sensors.0.platform.kind' = ["courses", "still"]

[[variants]]
name = "steps"
set = { "fusion" = { kind = "clmb", by_views = true }, "network" = { hops = 1 } }

[[variants]]
name = "courses"

[variants.set]
"sensors.*.platform" = { kind = "courses", speed = 5.0 }
"metrics" = { still = { kind = "tracked_share", "min_detection" = 0.5 } }
"""
PRESENT = """\
# Names of strategies, of fields, and inside sections.
name = "fixed"   # the name of the campaign
scenarios = ["paper-a"]
planners = ["jdm", 'constant', "stationary"]   # and `told`
runs = 2
compare = "sensors.*.stationary_until_first_decision"
set."ospa.first_scan" = 5
set.ospa.last_scan = 9

[grid]
"sensors.*.stationary_until_first_decision" = [true, false]
'sensors.0.platform.kind' = ["heading", "stationary"]

[[variants]]
name = "steps"
set = { "fusion" = { kind = "clmb", field_of_view_weighting = true }, "network" = { max_hops = 1 } }

[[variants]]
name = "courses"

[variants.set]
"sensors.*.platform" = { kind = "heading", speed = 5.0 }
"metrics" = { still = { kind = "tracked_fraction", "min_detection_probability" = 0.5 } }
"""


def test_a_campaign_file_is_rewritten(tmp_path: Path) -> None:
    file = tmp_path / "fixed.toml"
    file.write_text(FORMER)
    done = CliRunner().invoke(app, ["upgrade", str(file)])
    assert (done.exit_code, done.stderr) == (0, "")
    assert file.read_text() == PRESENT
    assert done.stdout.splitlines()[:2] == [
        "line 4: planners[1]: fixed -> constant",
        "line 4: planners[2]: still -> stationary",
    ]
    assert done.stdout.splitlines()[-1] == f"{file}: 15 changes"
    assert load_spec(file) == parse_spec(PRESENT)
    assert upgraded_toml(PRESENT) == (PRESENT, [])
    again = CliRunner().invoke(app, ["upgrade", str(file)])
    assert again.stdout == f"{file}: up to date; nothing was changed\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (FORMER.replace("jdm", "jd\\u006d").replace("'fixed'", '"fi\\u0078ed"'), "replace by hand: fixed by constant"),
        (FORMER + '"ospa" = { from_step = 1, first_scan = 2 }\n', "expected one of from_step and first_scan, got both"),
        ("name = [", "expected TOML"),
        ('[project]\nname = "still"\n', "expected a campaign file, with `scenarios`"),
    ],
)
def test_a_file_with_a_fault_is_not_touched(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "f.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        upgraded_toml(text, str(file))
    assert CliRunner().invoke(app, ["upgrade", str(file)]).exit_code == 1
    assert file.read_text() == text


def test_numbers_that_are_not_equal_to_themselves_are_no_hindrance() -> None:
    text = 'scenarios = []\nset = { "ospa.from_step" = nan }\n'
    assert tomllib.loads(upgraded_toml(text)[0])["set"].keys() == {"ospa.first_scan"}
