"""Runs as bytes: nothing is lost, equal runs are equal bytes, and damage is named."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from campaigns.filled import make_run
from simulation.test_storage import assert_same
from vedette.campaigns.codec import decode, encode
from vedette.control.plan import Plan
from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.evaluation.metrics.serialization import decode_metrics, encode_metrics
from vedette.platforms import Actions
from vedette.simulation.arrow import read_table, write_table
from vedette.simulation.serialization import FORMAT_VERSION, decode_timings, encode_timings
from vedette.simulation.tables import LAYOUTS, OPTIONAL

NUMBERS = st.floats(width=64, allow_nan=True, allow_infinity=True)


@pytest.mark.parametrize("planner", ["jdm", "idm", "random", "constant"])
def test_a_run_is_decoded_bit_for_bit(planner):
    record, metrics = make_run(planner, 3)
    assert_same(decode(encode(record)), replace(record, timings={}))
    assert_same(decode(encode(record), encode_timings(record)), record)
    assert_same(decode_metrics(encode_metrics(metrics), 40), (metrics, {}))


@given(values=hnp.arrays(np.float64, (40, 3), elements=NUMBERS))
def test_every_number_is_decoded_as_it_was(values):
    record, metrics = make_run("random", 0)
    record, metrics = replace(record, ospa=values), replace(metrics, nees_mean=values[:, 0].copy())
    measured, _ = decode_metrics(encode_metrics(metrics), 40)
    assert decode(encode(record)).ospa.tobytes() == values.tobytes()
    assert measured is not None
    assert measured.nees_mean.tobytes() == metrics.nees_mean.tobytes()


def test_a_run_without_targets_estimates_and_timings_is_decoded():
    record, _ = make_run("constant", 0)
    nothing = Estimate.empty(4)
    truth = replace(record.truth, offsets=np.zeros(41, np.int64), ids=np.empty(0, np.int64), states=np.empty((0, 4)))
    record = replace(record, estimates=(nothing,) * 40, truth=truth, timings={})
    assert_same(decode(encode(record)), record)
    assert decode_timings(encode_timings(record), "x") == {}


def test_equal_runs_are_equal_bytes_and_their_timings_are_no_part_of_them():
    record, metrics = make_run("jdm", 0)
    payload = encode(record)
    assert encode(make_run("jdm", 0)[0]) == payload
    slower = replace(record, timings={"filter": np.full(40, 9.0)})
    assert encode(slower) == payload
    assert encode(decode(payload)) == payload
    assert encode(make_run("jdm", 1)[0]) != payload
    assert encode_metrics(metrics) == encode_metrics(make_run("jdm", 0)[1])


def test_arrow_alone_reads_a_payload():
    record, _ = make_run("jdm", 0)
    with zipfile.ZipFile(io.BytesIO(encode(record))) as archive:
        tables = {name: pa.ipc.open_file(archive.read(name)).read_all() for name in archive.namelist()[1:]}
        assert json.loads(archive.read("run.json"))["seed"] == 7
    np.testing.assert_array_equal(tables["scans.arrow"]["ospa_m"], record.ospa[:, 0])
    assert tables["tracks.arrow"].column_names[-1] == "cov_15"
    assert tables["decisions.arrow"]["planner"].to_pylist() == ["jdm"] * 3
    rewards = tables["rewards.arrow"].to_pandas()
    np.testing.assert_array_equal(
        rewards[rewards["decision"] == 1]["reward"], record.decisions[1].plan.tables[0].mean.ravel()
    )


def test_the_layout_of_this_version_is_as_written_here():
    """Where this fails, results of earlier versions no longer read: raise FORMAT_VERSION with the change."""
    assert FORMAT_VERSION == 7
    assert {
        name: " ".join((*layout.fixed, *(f"{start}*" for start in layout.more))) for name, layout in LAYOUTS.items()
    } == {
        "scans": "step time_s num_targets num_estimates ospa_m localisation_m cardinality_m "
        "fusion_num_sets fusion_num_lost_labels fusion_empty_intersection fusion_log_normaliser "
        "fusion_discarded_weight",
        "truth": "step time_s target state_* detection_factor*",
        "tracks": "step time_s birth_step birth_site existence mean_* cov_* class_* mode_*",
        "sensors": "step time_s sensor x_m y_m heading_rad log_likelihood num_hypotheses num_tracks "
        "truncation_error_bound dropped_existence num_clutter_floored num_duplicates num_inexact_clusters "
        "search_truncated limit_reached independence_error_bound num_missing_sets num_missing_labels "
        "bytes_sent pose_* off*",
        "decisions": "decision step time_s planner notes num_*",
        "actions": "decision step time_s sensor action chosen *",
        "rewards": "decision step time_s reward_table reward reward_se chosen action_*",
    }
    assert {
        name: " ".join((*layout.fixed, *(f"{start}*" for start in layout.more))) for name, layout in OPTIONAL.items()
    } == {
        "own_rewards": "decision step time_s reward_table sensor action reward reward_se chosen",
        "explanations": "decision step time_s reward reward_se baseline undetected_gain evaluations bound bound_kind "
        "num_targets_without_bound runner_up margin margin_se missing price* action_*",
        "target_gains": "decision step time_s birth_step birth_site existence_gain localisation_gain",
        "sensor_gains": "decision step time_s sensor gain reward_without_sensor",
        "undetected": "decision step time_s x_min_m x_max_m y_min_m y_max_m columns rows cell_*",
    }


def test_actions_of_several_kinds_and_notes_are_decoded():
    """Sensors with other columns than another, with none, and with names that tables have; counts that come and go."""
    record, _ = make_run("random", 0)
    kinds = (
        Actions.of(heading_deg=30.0, speed=-0.0),
        Actions((), np.empty((3, 0))),
        Actions(("step", "action_step"), np.arange(6.0).reshape(3, 2)),
        Actions(("dx", "heading_deg"), np.arange(6.0).reshape(3, 2)),
    )
    plans = [
        Plan("own", (kinds[0], kinds[1]), (0, 2), (), {"samples": 1}, ("rewards one by one", "² and more")),
        Plan("own", (kinds[2], kinds[3]), (2, 0), (), {"samples": 2, "others": 0}),
        Plan("own", (kinds[1], kinds[0]), (1, 0), (), {}),
    ]
    decisions = tuple(replace(each, plan=plan) for each, plan in zip(record.decisions, plans, strict=True))
    record = replace(record, decisions=decisions)
    crossed = replace(plans[1], actions=(kinds[3], Actions(("heading_deg", "dx"), kinds[3].values)))
    with pytest.raises(InputError, match=r"expected columns in one order.*; got dx, heading_deg and heading_deg, dx"):
        encode(replace(record, decisions=(replace(decisions[0], plan=crossed), *decisions[1:])))
    decisions = tuple(replace(each, plan=plan) for each, plan in zip(record.decisions, plans, strict=True))
    record = replace(record, decisions=decisions)
    again = decode(encode(record), encode_timings(record))
    assert_same(again, record)
    assert encode(again) == encode(record)
    two_lines = replace(plans[0], notes=("one\ntwo",))
    with pytest.raises(InputError, match=r"plan\.notes: expected notes of one line each"):
        encode(replace(record, decisions=(replace(record.decisions[0], plan=two_lines),)))


def test_what_cannot_be_encoded_is_named():
    record, _ = make_run("jdm", 0)
    with pytest.raises(InputError, match=r"record\.poses"):
        encode(replace(record, poses=record.poses[1:]))
    plan = record.decisions[0].plan
    turned = replace(plan, tables=(replace(plan.tables[0], sensors=(1, 0)),))
    with pytest.raises(InputError, match=r"plan\.tables: expected sensors in increasing order; got \(1, 0\)"):
        encode(replace(record, decisions=(replace(record.decisions[0], plan=turned),)))


def changed(payload: bytes, name: str, content: bytes | None) -> bytes:
    """The archive with another member in place of one; without it for None."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(payload)) as old, zipfile.ZipFile(out, "w") as new:
        for member in old.namelist():
            kept = old.read(member) if member != name else content
            if kept is not None:
                new.writestr(member, kept)
    return out.getvalue()


def bad_payloads() -> dict[str, bytes]:
    payload = encode(make_run("jdm", 0)[0])
    with zipfile.ZipFile(io.BytesIO(payload)) as archive:
        content = archive.read("scans.arrow")
    scans = read_table(content, LAYOUTS["scans"], "scans")
    shorter = write_table({name: column[1:] for name, column in scans.items()}, LAYOUTS["scans"])
    return {
        "run: expected the bytes of a run": b"",
        "run: expected the bytes of a run; got others: ValueError: File is not a zip file": payload[
            : len(payload) // 2
        ],
        "run: expected a file tracks.arrow; got ": changed(payload, "tracks.arrow", None),
        "run: expected the bytes of a run; got others: KeyError": changed(payload, "run.json", None),
        "run: expected the bytes of a run; got others: TypeError": changed(payload, "run.json", b"[]"),
        "run: expected the files of a run; they do not fit": changed(payload, "run.json", b'{"scenario": "x"}'),
        "run/scans.arrow: expected a table as an Arrow file; it is damaged": changed(payload, "scans.arrow", b"no"),
        "run: sensors: expected a row of every sensor for each of 39 scans; got 80": changed(
            payload, "scans.arrow", shorter
        ),
    }


@pytest.mark.parametrize("message", bad_payloads())
def test_bytes_that_are_no_run_are_named(message):
    with pytest.raises(InputError, match=message):
        decode(bad_payloads()[message])


@pytest.mark.parametrize("content", [b"", b"seconds", encode_timings(make_run("jdm", 0)[0])[:-1]])
def test_bytes_that_are_no_timings_or_metrics_are_named(content):
    with pytest.raises(InputError, match="x: expected a table as an Arrow file; it is damaged"):
        decode_timings(content, "x")
    with pytest.raises(InputError, match="metrics: expected measures as an Arrow file; it is damaged"):
        decode_metrics(content, 40)
