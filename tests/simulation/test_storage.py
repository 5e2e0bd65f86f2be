from __future__ import annotations

import json
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaluation.synthetic import make_record
from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.simulation import storage
from vedette.simulation.records import RunRecord
from vedette.simulation.storage import load_run, read_manifest, save_run

FILES = ("decisions.json", "scans.csv", "sensors.csv", "timings.csv", "tracks.csv", "truth.csv")


def assert_same(first: Any, second: Any) -> None:
    """Equal bit for bit, types and array layouts included."""
    assert type(first) is type(second)
    if is_dataclass(first):
        for field in fields(first):
            assert_same(getattr(first, field.name), getattr(second, field.name))
    elif isinstance(first, np.ndarray):
        assert first.dtype == second.dtype
        assert first.shape == second.shape
        assert first.tobytes() == second.tobytes()
    elif isinstance(first, tuple):
        assert len(first) == len(second)
        for a, b in zip(first, second, strict=True):
            assert_same(a, b)
    elif isinstance(first, dict):
        assert list(first) == list(second)
        assert_same(tuple(first.values()), tuple(second.values()))
    else:
        assert first == second


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    return save_run(make_record(), tmp_path / "run", scenario_text="name: synthetic\n")


@pytest.mark.parametrize("planner", ["jdm", "idm", "random", "fixed"])
def test_a_run_reads_back_bit_for_bit(tmp_path: Path, planner: str) -> None:
    record = make_record(planner)
    assert_same(load_run(save_run(record, tmp_path / "deep" / "run")), record)


def test_awkward_numbers_read_back(tmp_path: Path) -> None:
    record = make_record()
    means = record.estimates[5].means.copy()
    means[0] = [5e-324, -0.0, 1.7976931348623157e308, 0.1 + 0.2]
    estimates = (*record.estimates[:5], replace(record.estimates[5], means=means), *record.estimates[6:])
    ospa = record.ospa.copy()
    ospa[0, 0] = np.inf  # of an infinite cutoff
    record = replace(record, estimates=estimates, ospa=ospa)
    assert_same(load_run(save_run(record, tmp_path / "run")), record)


def test_tables_with_gaps_read_back(tmp_path: Path) -> None:
    record = make_record()
    decision = record.decisions[0]
    table = decision.plan.tables[0]
    gaps = np.arange(table.mean.shape[0]) != decision.plan.chosen[0]
    mean, error = table.mean.copy(), table.standard_error.copy()
    mean[gaps], error[gaps] = np.nan, np.nan
    plan = replace(decision.plan, tables=(replace(table, mean=mean, standard_error=error),))
    record = replace(record, decisions=(replace(decision, plan=plan),))
    save_run(record, tmp_path / "run")
    assert_same(load_run(tmp_path / "run"), record)
    assert "null" in (tmp_path / "run" / "decisions.json").read_text()


def test_runs_without_any_target_estimate_or_scan_read_back(tmp_path: Path) -> None:
    record = make_record("fixed")
    nothing = Estimate(np.empty((0, 2), np.int64), np.empty((0, 4)), np.empty((0, 4, 4)), np.empty(0))
    truth = replace(record.truth, offsets=np.zeros(41, np.int64), ids=np.empty(0, np.int64), states=np.empty((0, 4)))
    record = replace(record, estimates=(nothing,) * 40, truth=truth)
    assert_same(load_run(save_run(record, tmp_path / "run")), record)


def test_the_same_run_gives_the_same_bytes(tmp_path: Path) -> None:
    first, again = (save_run(make_record(), tmp_path / name) for name in ("first", "again"))
    for file in (*FILES, "manifest.json"):
        assert (first / file).read_bytes() == (again / file).read_bytes()


def test_files_are_open_and_described(saved: Path) -> None:
    assert sorted(path.name for path in saved.iterdir()) == sorted([*FILES, "manifest.json", "scenario.yaml"])
    assert (saved / "scans.csv").read_text().startswith("step,time_s,num_targets,num_estimates,ospa_m,localisation_m")
    assert (
        (saved / "sensors.csv").read_text().startswith("step,time_s,sensor,x_m,y_m,heading_rad,log_likelihood,num_hyp")
    )
    decision = json.loads((saved / "decisions.json").read_text())[0]
    assert len(decision["chosen_actions"]) == 2
    manifest = read_manifest(saved)
    assert manifest["run"]["seed"] == 7
    assert set(manifest["versions"]) == {"python", "vedette", "numpy", "scipy", "numba"}
    assert (saved / "scenario.yaml").read_text() == "name: synthetic\n"


def test_an_existing_run_is_replaced_only_when_asked(saved: Path) -> None:
    with pytest.raises(InputError, match="exists"):
        save_run(make_record("idm"), saved)
    assert load_run(saved).planner == "jdm"
    save_run(make_record("idm"), saved, overwrite=True)
    assert load_run(saved).planner == "idm"
    assert not (saved / "scenario.yaml").exists()
    assert [path.name for path in saved.parent.iterdir()] == ["run"]


def test_a_folder_of_something_else_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("years of work")
    with pytest.raises(InputError, match="holds something else and is kept"):
        save_run(make_record(), tmp_path, overwrite=True)
    assert (tmp_path / "thesis.txt").exists()


def test_an_empty_folder_is_used(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    assert load_run(save_run(make_record(), tmp_path / "run")).planner == "jdm"


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="expected a place to write a run"):
        save_run(make_record(), tmp_path / "file" / "run")


def test_a_crash_while_writing_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(storage, "_swap_in", fail)
    with pytest.raises(InputError, match="disk full"):
        save_run(make_record(), tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("file", FILES)
def test_altered_and_truncated_files_are_named(saved: Path, file: str) -> None:
    content = (saved / file).read_bytes()
    for broken in (content[: len(content) // 2], content.replace(b"1", b"2", 1), b""):
        (saved / file).write_bytes(broken)
        with pytest.raises(InputError, match=rf"{file}: expected the file as it was written"):
            load_run(saved)
    (saved / file).unlink()
    with pytest.raises(InputError, match=rf"{file}: expected a file of a saved run"):
        load_run(saved)


@pytest.mark.parametrize(
    ("manifest", "message"),
    [
        ("{", "cut short or altered"),
        ("[]", "got another file"),
        ('{"format": "photo album"}', "got another file"),
        ('{"format": "vedette-run", "format_version": 99}', "format version 3; got 99"),
        ('{"format": "vedette-run", "format_version": 3}', "fields files and run"),
        ('{"format": "vedette-run", "format_version": 3, "run": {}, "files": {"../x": ""}}', "plain file names"),
        (
            '{"format": "vedette-run", "format_version": 3, "run": {}, "files": {}}',
            "expected a file decisions.json|scans",
        ),
    ],
)
def test_a_broken_manifest_is_named(saved: Path, manifest: str, message: str) -> None:
    (saved / "manifest.json").write_text(manifest)
    with pytest.raises(InputError, match=message):
        load_run(saved)


def test_what_is_no_run_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"manifest\.json: expected a file of a saved run"):
        load_run(tmp_path / "nowhere")


def rewrite(saved: Path, file: str, old: str, new: str) -> None:
    """Alter a file and make the manifest agree with it, as a careful hand would."""
    text = (saved / file).read_text().replace(old, new, 1)
    (saved / file).write_text(text)
    manifest = json.loads((saved / "manifest.json").read_text())
    manifest["files"][file] = storage.hashlib.sha256(text.encode()).hexdigest()
    (saved / "manifest.json").write_text(json.dumps(manifest))


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("tracks.csv", "existence", "exists", "expected a column existence"),
        ("truth.csv", "-55.0", "west", "column state_0: expected numbers"),
        ("truth.csv", "\n1,", "\n1.5,", "column step: expected whole numbers"),
        ("truth.csv", "\n1,", "\n40,", "expected rows in order"),
        ("sensors.csv", "\n1,1.0,0,-745.0,830.0,0.0,nan", "", "rows as long as"),
        ("scans.csv", "\n1,1.0,3", "\n1,1.0,3,3", "rows as long as"),
        ("decisions.json", '"chosen"', '"choice"', "do not fit together"),
        ("decisions.json", '"sensors": [', '"sensors": [7, ', "reward table"),
    ],
)
def test_files_that_do_not_fit_together_are_named(saved: Path, file: str, old: str, new: str, message: str) -> None:
    rewrite(saved, file, old, new)
    with pytest.raises(InputError, match=message):
        load_run(saved)


def test_a_row_that_is_missing_is_named(saved: Path) -> None:
    last = (saved / "sensors.csv").read_text().splitlines()[-1]
    rewrite(saved, "sensors.csv", f"{last}\n", "")
    with pytest.raises(InputError, match="do not fit together"):
        load_run(saved)


def contradictions() -> dict[str, RunRecord]:
    record = make_record()
    plan = replace(record.decisions[0].plan, chosen=(0, 99))
    return {
        "scan times": replace(record, times=record.times + 0.5),
        "record.estimates": replace(record, estimates=record.estimates[1:]),
        "record.timings": replace(record, timings={"filter": np.zeros(3)}),
        "record.poses": replace(record, poses=record.poses[1:]),
        "record.health.cap_met": replace(record, health=replace(record.health, cap_met=record.health.cap_met[1:])),
        "record.ospa": replace(record, ospa=record.ospa[:, :2]),
        "plan.chosen": replace(record, decisions=(replace(record.decisions[0], plan=plan),)),
        "record.decisions: expected finite": replace(
            record, decisions=(replace(record.decisions[0], time=float("nan")),)
        ),
    }


@pytest.mark.parametrize("message", contradictions())
def test_a_record_that_contradicts_itself_is_not_saved(tmp_path: Path, message: str) -> None:
    with pytest.raises(InputError, match=message):
        save_run(contradictions()[message], tmp_path / "run")
    assert list(tmp_path.iterdir()) == []
