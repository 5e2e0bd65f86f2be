"""Every example of README and documentation, as a stranger runs it: in a process of its own, warnings as errors.

The blocks of a page are one program, in the order of the page. The pages of the Python API share one process.
"""

from __future__ import annotations

import importlib
import importlib.util
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from campaigns.filled import fill, make_campaign
from vedette.campaigns.export import export_tables
from vedette.campaigns.results import open_results

ROOT = Path(__file__).resolve().parents[1]
NEEDED = {"polars": importlib.util.find_spec("polars") is not None}  # what a block may import and the check may lack


def blocks(page: Path) -> list[str]:
    return re.findall(r"```python\n(.*?)```", page.read_text("utf-8"), re.DOTALL)


PAGES = {
    path.relative_to(ROOT).as_posix(): found
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    if path.parent.name != "reference" and (found := blocks(path))
}
REFERENCE = sorted(path for path in (ROOT / "docs" / "reference").glob("*.md") if path.name != "index.md")
SCRIPTS = [
    path.relative_to(ROOT).as_posix()
    for path in sorted((ROOT / "examples").glob("*.py"))
    if "__main__" in path.read_text("utf-8")  # not what they share
]


def results_folder(place: Path) -> None:
    """What the page on reports begins with: a folder `results` from a campaign of one group of strategies."""
    fill(place / "results", make_campaign(grid={}))


def tables_folder(place: Path) -> None:
    """The same seen from within, with its tables."""
    fill(place, make_campaign())
    export_tables(open_results(place), place / "tables")


# What a page starts from, and words of what it must print.
BEGINNINGS: dict[str, Callable[[Path], None]] = {"docs/report.md": results_folder, "docs/results.md": tables_folder}
SHOWN = {
    "README.md": ["jdm      mean OSPA ", "runner-up: less by"],
    "docs/campaigns.md": ["paper-a"],
    "docs/central-filters.md": ["[[200.  50.]] "],
    "docs/choosing.md": ["expected_loss: assigned_target has +"],
    "docs/coming-from.md": ["N = 1"],
    "docs/constraints.md": ["no target within 100 m: [0.0237"],
    "docs/control.md": ["+-", "filter_steps", "candidates left", "joint actions evaluated"],
    "docs/drifting-biases.md": ["biases are found from 60.0 s on"],
    "docs/evidence/lost-tracks.md": [
        "OSPA, m",
        "targets dropped: up to 2.1 per scan",
        "covariances too small at",
        "covariances too large at",
        "standard deviations from the nearest birth site",
        "labels are kept, and 4 targets are there at once",
        "targets lost by fusion: ",
    ],
    "docs/explanations.md": ["runner-up: less by", "sensor 1 with heading_deg 60"],
    "docs/faq.md": ["the same"],
    "docs/filters.md": ["target at", "LMB of 4 labels", "4 labels\n(1, 0) 1.0", "((1, 0), (10, 0))"],
    "docs/fusion.md": ["ParallelUpdate ", "Clmb by views "],
    "docs/gym.md": [
        "3 decisions; at the end 40.0 s",
        "'ends': (2, 13, 3)",
        "(3, 10, 4) (3,)",
        "['sensor_1', 'sensor_2'] True",
        "the same run: True",
    ],
    "docs/horizons.md": ["heading_deg 90 [", "joint sequences evaluated"],
    "docs/late-scans.md": ["5 scans, 1 late, 0 dropped", "at 10.0 s"],
    "docs/live.md": ['"line": 12, "time": 5.0, "tracks": [{"label":'],
    "docs/loop.md": ["go to"],
    "docs/manoeuvres.md": ["[0.971 0.029]"],
    "docs/metrics.md": ["True"],
    "docs/platforms.md": ["('dx', 'dy', 'pointing_deg') 12"],
    "docs/radio-networks.md": ["the boats are sure of 1 and 1 ships"],
    "docs/report.md": [],
    "docs/results.md": ["gospa_m", "margin", "jdm-rate-5.0", "heading_deg", "farthest_m"],
    "docs/rewards.md": ["certainty_of_number is a function of two densities"],
    "docs/runs.md": [
        "m; [10.0, 20.0, 30.0]",
        "RunRecord of paper-e by idm",
        "Plan of idm for 2 sensors\n  sensor 1: heading_deg",
        "std_vy_mps",
        "targets; hypotheses of each sensor",
    ],
    "docs/scenarios.md": ["array([-90.])"],
    "docs/searches.md": ["of 65 joint actions evaluated"],
    "docs/signatures.md": ["500.", "7.07106781e+03"],
    "docs/smoothing.md": ["filtered: position RMSE 1", "smoothed: position RMSE "],
    "docs/stonesoup.md": ["targets, ", "looks along 30 degrees; the ship is at 33"],
    "docs/target-classes.md": ["[-1.18  0.96]"],
    "docs/tutorial.md": ["best: sensor 1 goes east and sensor 2 north", "Plan of jdm for 2 sensors"],
    "docs/undetected-targets.md": ["scan 20: 2.96 not yet found, "],
    "examples/cameras.py": ["jdm     OSPA", "100%"],
    "examples/from_stonesoup.py": ["states, existence at the end"],
    "examples/gym_policy.py": ["eight-mobile: in the environment run 0 gives", "policy    OSPA"],
    "examples/hundred_sensors.py": ["900 courses of 100 sensors"],
    "examples/late_scans.py": ["26 of 60 scans dropped", "0 of 60 scans dropped"],
    "examples/limited_views.py": ["of the targets in sight tracked"],
    "examples/manoeuvres.py": [
        "0.3 m/s²  mean error",
        "lost after 41 s",
        "modes of motion              mean error  12.3 m",
    ],
    "examples/own_campaign.py": ["near_farthest nearest sensor", "m to jdm"],
    "examples/own_fusion.py": ["own: the surest sensor   OSPA"],
    "examples/own_motion.py": ["with the current              mean error  26.4 m"],
    "examples/own_reward.py": ["own: near the harbour  error near the harbour"],
    "examples/own_sensor.py": ["greatest difference between the two"],
    "examples/recorded_scans.py": ["3 ships at the end"],
    "examples/smoothed_tracks.py": ["filtered          position error 14", "smoothed          position error  7"],
    "examples/time_differences.py": ["from 40 s on: mean error 5.3 m, 3.00 targets estimated of 3"],
}


def run(place: Path, *program: str) -> str:
    """What a program printed, which must have ended well."""
    command = [sys.executable, "-W", "error", "-X", "faulthandler", *program]
    result = subprocess.run(command, cwd=place, capture_output=True, text=True, timeout=600, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def test_every_page_and_script_is_listed() -> None:
    assert [*PAGES, *SCRIPTS] == list(SHOWN)


@pytest.mark.parametrize("name", [*PAGES, *SCRIPTS])
def test_an_example_runs_by_itself(name: str, tmp_path: Path) -> None:
    if name in PAGES:
        unmet = [package for package, there in NEEDED.items() if not there]
        program = "\n".join(block for block in PAGES[name] if not any(f"import {one}" in block for one in unmet))
        BEGINNINGS.get(name, lambda place: None)(tmp_path)
        (tmp_path / "example.py").write_text(program, "utf-8")
        printed = run(tmp_path, "example.py")
    else:
        printed = run(tmp_path, str(ROOT / name), "--picture", "drawn.png")
        assert (tmp_path / "drawn.png").read_bytes().startswith(b"\x89PNG")
    for words in SHOWN[name]:
        assert words in printed


def test_the_examples_of_the_python_api_run(tmp_path: Path) -> None:
    """Each page has examples, and starts without the names of the others."""
    for page in REFERENCE:
        (tmp_path / f"{page.stem}_page.py").write_text("\n".join(blocks(page)), "utf-8")
    pages = [f"{page.stem}_page.py" for page in REFERENCE]
    assert all((tmp_path / page).stat().st_size for page in pages)
    (tmp_path / "all.py").write_text(f"import runpy\nfor page in {pages}:\n    runpy.run_path(page)\n", "utf-8")
    run(tmp_path, "all.py")


@pytest.mark.parametrize("page", REFERENCE, ids=lambda page: page.stem)
def test_a_page_of_the_python_api_lists_every_name_by_its_task(page: Path) -> None:
    text = page.read_text("utf-8")
    package = importlib.import_module(re.findall(r"^::: (\S+)$", text, re.MULTILINE)[0])
    rows = re.findall(r"^\| [^|`]+ \| (`.*)$", text, re.MULTILINE)
    own = [name for name, one in vars(package).items() if getattr(one, "__module__", "") == package.__name__]
    public = getattr(package, "__all__", [name for name in own if not name.startswith("_")])
    assert sorted(name for row in rows for name in re.findall(r"`(\w+)`", row)) == sorted(public)
