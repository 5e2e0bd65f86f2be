from __future__ import annotations

import json
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import feather

from evaluation.synthetic import make_record
from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.simulation import storage
from vedette.simulation.arrow import Columns, read_table, write_table
from vedette.simulation.records import RunRecord
from vedette.simulation.serialization import encode_run
from vedette.simulation.storage import load_run, read_manifest, save_run
from vedette.simulation.tables import LAYOUTS, TIMINGS

FILES = tuple(f"{name}.arrow" for name in (*LAYOUTS, "timings"))


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


@pytest.mark.parametrize("planner", ["jdm", "idm", "random", "constant"])
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
    rewards = feather.read_table(tmp_path / "run" / "rewards.arrow")
    assert rewards.num_rows == np.isfinite(mean).sum()
    assert set(rewards["action_0"].to_pylist()) == {decision.plan.chosen[0]}


def test_runs_without_any_target_estimate_or_scan_read_back(tmp_path: Path) -> None:
    record = make_record("constant")
    nothing = Estimate(np.empty((0, 2), np.int64), np.empty((0, 4)), np.empty((0, 4, 4)), np.empty(0))
    truth = replace(record.truth, offsets=np.zeros(41, np.int64), ids=np.empty(0, np.int64), states=np.empty((0, 4)))
    record = replace(record, estimates=(nothing,) * 40, truth=truth)
    assert_same(load_run(save_run(record, tmp_path / "run")), record)


def test_the_same_run_gives_the_same_bytes(tmp_path: Path) -> None:
    first, again = (save_run(make_record(), tmp_path / name) for name in ("first", "again"))
    for file in (*FILES, "manifest.json"):
        assert (first / file).read_bytes() == (again / file).read_bytes()


def first_scan(record: RunRecord) -> RunRecord:
    """The record of a run of a single scan."""
    health = record.health.first(1)
    timings = {stage: seconds[:1] for stage, seconds in record.timings.items()}
    return replace(
        record,
        times=record.times[:1],
        truth=record.truth.first(1),
        poses=record.poses[:1],
        off=record.off[:1],
        estimates=record.estimates[:1],
        decisions=(),
        ospa=record.ospa[:1],
        health=health,
        timings=timings,
    )


def test_runs_of_one_scan_that_stopped_or_have_wider_poses_read_back(tmp_path: Path) -> None:
    whole = make_record()
    wide = np.concatenate([whole.poses, np.ones((40, 2, 2))], axis=2)
    decisions = tuple(replace(each, poses=wide[each.step - 1]) for each in whole.decisions)
    cases = {
        "one scan": first_scan(whole),
        "stopped": replace(first_scan(whole), stopped="synthetic: stopped at step 2: the filter: ²"),
        "no times": replace(whole, timings={}),
        "wide": replace(whole, poses=wide, decisions=decisions),
        "off": replace(whole, off=np.random.default_rng(5).random((40, 2)) < 0.3),
    }
    for name, record in cases.items():
        assert_same(load_run(save_run(record, tmp_path / name)), record)


def test_files_are_open_and_described(saved: Path) -> None:
    assert sorted(path.name for path in saved.iterdir()) == sorted([*FILES, "manifest.json", "scenario.yaml"])
    record = make_record()
    scans, sensors = (feather.read_table(saved / f"{name}.arrow") for name in ("scans", "sensors"))
    np.testing.assert_array_equal(scans["ospa_m"], record.ospa[:, 0])
    assert scans.column_names[:5] == ["step", "time_s", "num_targets", "num_estimates", "ospa_m"]
    assert sensors.column_names[:8] == [
        *("step", "time_s", "sensor", "x_m", "y_m", "heading_rad", "log_likelihood", "num_hypotheses")
    ]
    actions = feather.read_table(saved / "actions.arrow").to_pylist()
    chosen = [row["heading_deg"] for row in actions if row["chosen"] and row["decision"] == 0]
    np.testing.assert_array_equal(chosen, np.ravel(record.decisions[0].plan.chosen_actions))
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
    with pytest.raises(InputError, match="expected a folder that may be written to"):
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
    for broken in (content[: len(content) // 2], content[:-1] + bytes([content[-1] ^ 1]), b""):
        (saved / file).write_bytes(broken)
        with pytest.raises(InputError, match=rf"{file}: expected the file as it was written"):
            load_run(saved)
    (saved / file).unlink()
    with pytest.raises(InputError, match=rf"{file}: no such file; expected a file of a saved run"):
        load_run(saved)


@pytest.mark.parametrize(
    ("manifest", "message"),
    [
        ("{", "cut short or altered"),
        ("[]", "got another file"),
        ('{"format": "photo album"}', "got another file"),
        ('{"format": "vedette-run", "format_version": 99}', "format 7; got 99, written by a later version"),
        (
            '{"format": "vedette-run", "format_version": 3, "versions": {"vedette": "0.1"}}',
            "expected format 7; got 3, written by an earlier version of this program: run it again, or read it with "
            "vedette 0.1",
        ),
        ('{"format": "vedette-run", "format_version": 7}', "fields files and run"),
        ('{"format": "vedette-run", "format_version": 7, "run": {}, "files": {"../x": ""}}', "plain file names"),
        ('{"format": "vedette-run", "format_version": 7, "run": {}, "files": {}}', "expected a file timings"),
    ],
)
def test_a_broken_manifest_is_named(saved: Path, manifest: str, message: str) -> None:
    (saved / "manifest.json").write_text(manifest)
    with pytest.raises(InputError, match=message):
        load_run(saved)


def test_invalid_runs_are_reported(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"manifest\.json: no such file; expected a file of a saved run"):
        load_run(tmp_path / "nowhere")


def rewrite(saved: Path, name: str, content: bytes) -> None:
    """Alter a file and make the manifest agree with it, as a careful hand would."""
    (saved / f"{name}.arrow").write_bytes(content)
    manifest = json.loads((saved / "manifest.json").read_text())
    manifest["files"][f"{name}.arrow"] = storage.hashlib.sha256(content).hexdigest()
    (saved / "manifest.json").write_text(json.dumps(manifest))


def table(saved: Path, name: str) -> Columns:
    layout = LAYOUTS.get(name, TIMINGS)
    return read_table((saved / f"{name}.arrow").read_bytes(), layout, name)


def as_file(columns: Any, **options: Any) -> bytes:
    out = pa.BufferOutputStream()
    whole = pa.table(columns)
    with pa.ipc.new_file(out, whole.schema, options=pa.ipc.IpcWriteOptions(**options)) as writer:
        writer.write_table(whole)
    return bytes(out.getvalue().to_pybytes())


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("tracks", {"existence": None}, r"tracks\.arrow: expected a column existence; got "),
        ("truth", {"state_1": None}, "expected columns state_0 to state_2; got "),
        (
            "truth",
            {"state_0": ["west"]},
            r"truth\.arrow, column 'state_0': expected numbers; got the type 'string'",
        ),
        ("truth", {"step": [1.5]}, r"column 'step': expected whole numbers; got the type 'double'"),
        ("truth", {"step": [41]}, "step: expected rows in order, of steps 1 to 40"),
        (
            "truth",
            {"colour": [40]},
            r"truth\.arrow: expected no other column than step, time_s, target; got 'colour'",
        ),
        ("scans", {"ospa_m": pa.nulls(40, pa.float64())}, r"column 'ospa_m': expected numbers; got nothing"),
        ("decisions", {"step": [-3]}, "record.decisions: expected a step of 1 to 40; got -3"),
        ("decisions", {"step": [77]}, "do not fit together"),
        ("decisions", {"decision": [1]}, "decisions, column decision: expected them numbered from 0"),
        ("actions", {"chosen": [True]}, "do not fit together: too many values to unpack"),
        ("actions", {"sensor": [2**62]}, "column sensor: expected rows"),
        ("rewards", {"action_1": [13]}, "do not fit together: invalid entry in coordinates array"),
        ("rewards", {"action_0": pa.nulls(507, pa.int64())}, "rewards: expected each combination of actions once"),
        (
            "timings",
            {"filter_s": [0]},
            r"timings\.arrow, column 'filter_s': expected numbers; got the type 'int64'",
        ),
    ],
)
def test_files_that_do_not_fit_together_are_named(saved: Path, name: str, change: dict[str, Any], message: str) -> None:
    columns: dict[str, Any] = dict(table(saved, name))
    num = len(next(iter(columns.values())))
    for column, values in change.items():
        full = values if isinstance(values, pa.Array) else [values[0]] * num if values else None
        columns[column] = full
    rewrite(saved, name, as_file({each: values for each, values in columns.items() if values is not None}))
    with pytest.raises(InputError, match=message):
        load_run(saved)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "it does not begin as one"),
        (b"ARROW1\0\0\xff\xff", "it is cut short"),
        (as_file({"step": np.zeros(10)}, compression="zstd"), "expected rows that are not compressed"),
        (as_file({"step": np.zeros(10_000_000)}, compression="lz4"), "expected rows that are not compressed"),
        (as_file({"step": pa.array(["a", "b"]).dictionary_encode()}), "expected a schema and one batch of rows"),
        (as_file(pa.concat_tables([pa.table({"step": [1]})] * 2)), "expected a schema and one batch of rows"),
    ],
)
def test_what_is_no_table_of_a_run_is_never_unpacked(saved: Path, content: bytes, message: str) -> None:
    rewrite(saved, "truth", content)
    with pytest.raises(InputError, match=rf"truth\.arrow: expected a table as an Arrow file; it is damaged: {message}"):
        load_run(saved)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("sensors", "sensors: expected a row of every sensor for each of 40 scans; got 79"),
        ("actions", "actions, column action: expected those of a sensor numbered from 0"),
    ],
)
def test_a_row_that_is_missing_is_named(saved: Path, name: str, message: str) -> None:
    rows: Any = table(saved, name)
    rewrite(saved, name, write_table({each: values[1:] for each, values in rows.items()}, LAYOUTS[name]))
    with pytest.raises(InputError, match=message):
        load_run(saved)


def test_bits_of_padding_are_no_part_of_a_file() -> None:
    """Arrow pads columns of truths and of nulls to whole bytes and words: with zeros, whatever the memory held."""
    record = make_record("idm")
    first = encode_run(record)
    junk = [np.full(100_000, 2**63 - 1) for _ in range(20)]
    del junk
    assert encode_run(make_record("idm")) == first
    assert encode_run(load_again(record)) == first


def load_again(record: RunRecord) -> RunRecord:
    from vedette.campaigns.codec import decode, encode

    return decode(encode(record))


def contradictions() -> dict[str, RunRecord]:
    record = make_record()
    plan = replace(record.decisions[0].plan, chosen=(0, 99))
    return {
        "scan times": replace(record, times=record.times + 0.5),
        "record.estimates": replace(record, estimates=record.estimates[1:]),
        "record.timings": replace(record, timings={"filter": np.zeros(3)}),
        "record.poses": replace(record, poses=record.poses[1:]),
        "record.health.limit_reached": replace(
            record, health=replace(record.health, limit_reached=record.health.limit_reached[1:])
        ),
        "record.ospa": replace(record, ospa=record.ospa[:, :2]),
        "plan.chosen": replace(record, decisions=(replace(record.decisions[0], plan=plan),)),
        "record.decisions: expected the time 10 s of step 10; got nan": replace(
            record, decisions=(replace(record.decisions[0], time=float("nan")),)
        ),
        "record.decisions: expected the poses of step 10": replace(
            record, decisions=(replace(record.decisions[0], poses=record.poses[30]),)
        ),
        "record.times: expected one scan or more": replace(
            record, times=record.times[:0], truth=record.truth.first(0), poses=record.poses[:0], estimates=()
        ),
    }


@pytest.mark.parametrize("message", contradictions())
def test_a_record_that_contradicts_itself_is_not_saved(tmp_path: Path, message: str) -> None:
    with pytest.raises(InputError, match=message):
        save_run(contradictions()[message], tmp_path / "run")
    assert list(tmp_path.iterdir()) == []
