"""Runs as bytes: nothing is lost, equal runs are equal bytes, and damage is named."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from campaigns.filled import make_run
from simulation.test_storage import assert_same
from vedette.campaigns.codec import PAYLOAD_VERSION, decode, decode_timings, encode, encode_timings
from vedette.densities.estimates import Estimate
from vedette.errors import InputError
from vedette.simulation.columns import pack, unpack
from vedette.simulation.tabulation import TABLES

NUMBERS = st.floats(width=64, allow_nan=True, allow_infinity=True)


@pytest.mark.parametrize("planner", ["jdm", "idm", "random", "fixed"])
def test_a_run_is_decoded_bit_for_bit(planner):
    record, metrics = make_run(planner, 3)
    again, measured = decode(encode(record, metrics))
    assert_same(again, replace(record, timings={}))
    assert_same(measured, metrics)
    assert_same(decode_timings(encode_timings(record)), record.timings)


@given(values=hnp.arrays(np.float64, (40, 3), elements=NUMBERS))
def test_every_number_is_decoded_as_it_was(values):
    record, metrics = make_run("random", 0)
    record, metrics = replace(record, ospa=values), replace(metrics, nees_mean=values[:, 0].copy())
    again, measured = decode(encode(record, metrics))
    assert again.ospa.tobytes() == values.tobytes()
    assert measured.nees_mean.tobytes() == metrics.nees_mean.tobytes()


def test_a_run_without_targets_estimates_and_timings_is_decoded():
    record, metrics = make_run("fixed", 0)
    nothing = Estimate.empty(4)
    truth = replace(record.truth, offsets=np.zeros(41, np.int64), ids=np.empty(0, np.int64), states=np.empty((0, 4)))
    record = replace(record, estimates=(nothing,) * 40, truth=truth, timings={})
    assert_same(decode(encode(record, metrics))[0], record)
    assert decode_timings(encode_timings(record)) == {}


def test_equal_runs_are_equal_bytes_and_their_timings_are_no_part_of_them():
    record, metrics = make_run("jdm", 0)
    payload = encode(record, metrics)
    assert encode(*make_run("jdm", 0)) == payload
    slower = replace(record, timings={"filter": np.full(40, 9.0)})
    assert encode(slower, metrics) == payload
    assert encode(*decode(payload)) == payload
    assert encode(*make_run("jdm", 1)) != payload


def test_numpy_alone_reads_a_payload():
    record, metrics = make_run("jdm", 0)
    with np.load(io.BytesIO(encode(record, metrics)), allow_pickle=False) as archive:
        np.testing.assert_array_equal(archive["scans"]["ospa_m"], record.ospa[:, 0])
        np.testing.assert_array_equal(archive["metrics"]["gospa_m"], metrics.gospa_m)
        assert archive["tracks"]["mean"].shape[1] == 4
        assert json.loads(archive["run.json"])["seed"] == 7
        assert json.loads(archive["decisions.json"])[0]["planner"] == "jdm"


def test_the_layout_of_this_version_is_as_written_here():
    """Where this fails, results of earlier versions no longer read: raise PAYLOAD_VERSION with the change."""
    assert PAYLOAD_VERSION == 2
    layout = {name: " ".join(kinds) for name, kinds in TABLES.items()}
    assert layout == {
        "scans": "step time_s num_targets num_estimates ospa_m localisation_m cardinality_m "
        "fusion_num_sets fusion_num_lost_labels fusion_empty_intersection fusion_log_normaliser "
        "fusion_discarded_weight",
        "truth": "step time_s target state",
        "tracks": "step time_s birth_step birth_site existence mean cov",
        "sensors": "step time_s sensor x_m y_m heading_rad log_likelihood num_hypotheses num_tracks "
        "discarded_weight_bound dropped_existence num_clutter_raised num_duplicates num_inexact_clusters search_cut "
        "cap_met num_missing_sets num_missing_labels",
    }
    assert " ".join(make_run("jdm", 0)[1].columns()) == (
        "gospa_m gospa_localisation gospa_missed gospa_false num_missed num_false ospa2_m cardinality_error nees_mean "
        "nees_count position_nees_mean label_switches fragmentations"
    )


def test_what_cannot_be_encoded_is_named():
    record, metrics = make_run("jdm", 0)
    with pytest.raises(InputError, match="metrics: expected one entry for each of 40 scans; got 39"):
        encode(record, metrics.from_columns({name: column[1:] for name, column in metrics.columns().items()}))
    with pytest.raises(InputError, match=r"record\.poses"):
        encode(replace(record, poses=record.poses[1:]), metrics)


def changed(payload: bytes, name: str, content: bytes | None) -> bytes:
    """The archive with another member in place of one; without it for None."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(payload)) as old, zipfile.ZipFile(out, "w") as new:
        for member in old.namelist():
            kept = old.read(member) if member != name else content
            if kept is not None:
                new.writestr(member, kept)
    return out.getvalue()


def array(columns) -> bytes:
    out = io.BytesIO()
    np.save(out, pack(columns))
    return out.getvalue()


def bad_payloads() -> dict[str, bytes]:
    payload = encode(*make_run("jdm", 0))
    with zipfile.ZipFile(io.BytesIO(payload)) as archive:
        scans = unpack(np.load(io.BytesIO(archive.read("scans.npy"))))
        facts = json.loads(archive.read("run.json"))
    whole = {**scans, "time_s": np.arange(40)}
    return {
        "expected the bytes of a run": b"",
        "expected the bytes of a run; got others: ValueError: File is not a zip file": payload[: len(payload) // 2],
        "expected the bytes of a run; got others: KeyError": changed(payload, "tracks.npy", None),
        "payload version 2; got 9": changed(payload, "run.json", json.dumps({**facts, "payload_version": 9}).encode()),
        "expected a column time_s": changed(payload, "scans.npy", array({"step": scans["step"]})),
        "column time_s: expected numbers; got int64": changed(payload, "scans.npy", array(whole)),
        "truth: expected the scan times|expected rows in order": changed(
            payload, "scans.npy", array({name: column[1:] for name, column in scans.items()})
        ),
        "got others": changed(payload, "decisions.json", b"[{}]"),
        "columns: ": changed(payload, "metrics.npy", array({"gospa_m": np.zeros(40)})),
    }


@pytest.mark.parametrize("message", bad_payloads())
def test_bytes_that_are_no_run_are_named(message):
    with pytest.raises(InputError, match=message):
        decode(bad_payloads()[message])


@pytest.mark.parametrize("content", [b"", b"seconds", encode_timings(make_run("jdm", 0)[0])[:-1]])
def test_bytes_that_are_no_timings_are_named(content):
    with pytest.raises(InputError, match="timings: expected the bytes of an array"):
        decode_timings(content)
