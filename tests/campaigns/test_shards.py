"""Shares of a campaign, and what they leave made one: the rows of a single process, whatever happened to the shares."""

from __future__ import annotations

import hashlib
import itertools
import math
import signal
import sqlite3
from collections import Counter
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from campaigns.adding import started
from campaigns.examples import small_campaign
from campaigns.filled import fill, make_campaign
from campaigns.stubs import stub_campaign, stub_perform
from vedette.campaigns import Campaign, Shard, engine, merge, open_results, parse_shard, run_campaign
from vedette.campaigns.shards import owner, ranges, slurm_script
from vedette.errors import InputError


def rows(folder: Path) -> str:
    """SHA-256 of the rows of a results folder in their order, but for the seconds that things took."""
    digest = hashlib.sha256()
    with closing(sqlite3.connect(folder / "campaign.sqlite")) as database:
        columns = "cell, run, payload, payload_sha256, metrics, metrics_sha256"
        for row in database.execute(f"SELECT {columns} FROM runs ORDER BY cell, run"):
            digest.update(repr(row).encode())
    return digest.hexdigest()


def tables(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in (folder / "tables").iterdir() if file.name != "timings.parquet"}


def in_shards(campaign: Campaign, folder: Path, count: int) -> list[Path]:
    shares = [replace(campaign, shard=Shard(number, count)) for number in range(1, count + 1)]
    for share in shares:
        run_campaign(share, folder / share.shard.folder)
    return [folder / share.shard.folder for share in shares]


@pytest.fixture
def stub(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "perform", stub_perform)


@pytest.mark.parametrize("num_cells", [1, 2, 3, 10, 12])
@pytest.mark.parametrize("count", [1, 2, 5, 12, 1000])
@pytest.mark.parametrize("num_runs", [1, 7, 60])
def test_shares_are_disjoint_hold_every_run_and_are_balanced(num_cells: int, count: int, num_runs: int) -> None:
    found = [
        [(cell, run) for cell in range(num_cells) for run in Shard(number, count).runs(cell, num_cells, num_runs)]
        for number in range(1, count + 1)
    ]
    assert sorted(itertools.chain(*found)) == [(cell, run) for cell in range(num_cells) for run in range(num_runs)]
    assert all(
        owner(run, cell, num_cells, count) == number for number, runs in enumerate(found, start=1) for cell, run in runs
    )
    sizes = [len(runs) for runs in found]
    assert max(sizes) - min(sizes) <= 1
    for cell in range(num_cells):
        of_cell = [Counter(each for each, _ in runs)[cell] for runs in found]
        assert max(of_cell) <= math.ceil(num_runs / count)
        assert min(of_cell) >= num_runs // count
    for number in range(1, min(count, 5) + 1):  # a longer campaign leaves every run where it was
        shard = Shard(number, count)
        assert list(shard.runs(0, num_cells, num_runs)) == [
            run for run in shard.runs(0, num_cells, 3 * num_runs) if run < num_runs
        ]


@pytest.mark.parametrize("text", ["0/3", "4/3", "3", "a/3", "1/", "-1/3", "1/0", "1/9999999", "1.0/3"])
def test_a_share_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="shard: expected"):
        parse_shard(text)


def test_shares_of_real_runs_make_the_folder_of_a_single_process(tmp_path: Path) -> None:
    campaign = small_campaign(runs=4)
    run_campaign(campaign, tmp_path / "alone")
    shares = in_shards(campaign, tmp_path / "shards", 3)
    merged = merge([tmp_path / "shards"], tmp_path / "merged")
    assert (merged.num_added, merged.missing, merged.count) == (8, (), 3)
    assert rows(tmp_path / "merged") == rows(tmp_path / "alone")
    assert tables(tmp_path / "merged") == tables(tmp_path / "alone")
    one, other = (open_results(tmp_path / name) for name in ("merged", "alone"))
    assert [run.checksum for run in one.runs()] == [run.checksum for run in other.runs()]
    assert {run.session for run in one.runs()} <= set(range(1, len(one.manifest["sessions"]) + 1))
    again = merge(shares[::-1], tmp_path / "merged")
    assert (again.num_added, again.missing) == (0, ())
    assert rows(tmp_path / "merged") == rows(tmp_path / "alone")
    assert run_campaign(campaign, tmp_path / "merged").num_existing == 8


def test_a_share_says_what_is_missing_of_it_and_goes_on_as_no_other(tmp_path: Path, stub: None) -> None:
    campaign = replace(stub_campaign(runs=10), shard=Shard(2, 3))
    folder = tmp_path / "2-of-3"
    assert run_campaign(campaign, folder).num_completed == campaign.total == 7
    opened = open_results(folder)
    assert opened.campaign.shard == Shard(2, 3)
    assert all(opened.missing(cell.name) == () for cell in campaign.cells)
    assert not (folder / "tables").exists()
    for other in (Shard(1, 3), Shard(2, 4), Shard()):
        with pytest.raises(InputError, match=r"it is of another, .*: shard is '2/3' there"):
            run_campaign(replace(campaign, shard=other), folder)
    longer = run_campaign(campaign.with_runs(20), folder)
    assert (longer.num_existing, longer.num_existing + longer.num_completed) == (7, campaign.with_runs(20).total)


def test_missing_shares_are_named_and_added_later(tmp_path: Path, stub: None) -> None:
    campaign = stub_campaign(runs=10)
    shares = in_shards(campaign, tmp_path / "shards", 5)
    merged = merge([shares[0], shares[3]], tmp_path / "merged")
    assert (merged.num_added, merged.missing, merged.num_missing) == (8, (2, 3, 5), 12)
    assert ranges(merged.missing) == "2-3,5"
    assert not (tmp_path / "merged" / "tables").exists()
    merged = merge(shares[1:], tmp_path / "merged")
    assert (merged.num_added, merged.missing) == (12, ())
    run_campaign(campaign, tmp_path / "alone")
    assert rows(tmp_path / "merged") == rows(tmp_path / "alone")
    assert tables(tmp_path / "merged") == tables(tmp_path / "alone")


def test_shares_of_another_cut_overlap_and_are_taken_once(tmp_path: Path, stub: None) -> None:
    campaign = stub_campaign(runs=6)
    shares = [*in_shards(campaign, tmp_path / "two", 2), *in_shards(campaign, tmp_path / "three", 3)]
    assert merge(shares, tmp_path / "merged").num_added == 12
    run_campaign(campaign, tmp_path / "alone")
    assert rows(tmp_path / "merged") == rows(tmp_path / "alone")


def test_a_run_with_other_bytes_is_refused_and_nothing_is_taken(tmp_path: Path, stub: None) -> None:
    campaign = make_campaign(runs=3)
    fill(tmp_path / "real", campaign)
    first, second = in_shards(campaign, tmp_path / "shards", 2)
    with pytest.raises(InputError, match=r"real.*: cell .*, run \d: expected the bytes that another folder has"):
        merge([first, tmp_path / "real", second], tmp_path / "other")
    merge([first], tmp_path / "merged")
    before = rows(tmp_path / "merged")
    with pytest.raises(InputError, match=r"real.*: cell .*, run \d: expected the bytes that another folder has"):
        merge([second, tmp_path / "real"], tmp_path / "merged")
    assert rows(tmp_path / "merged") == before


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"seed": 8}, "seed is 8 there and 7 here"),
        ({"planners": ["jdm", "idm"]}, "axes.planner"),
        ({"set": {"ospa.cutoff": 50.0}}, "spec.set.ospa.cutoff is 50"),
    ],
)
def test_shares_of_another_campaign_are_refused(changes: dict[str, object], told: str, tmp_path: Path) -> None:
    fill(tmp_path / "one", make_campaign())
    fill(tmp_path / "other", make_campaign(**changes))
    with pytest.raises(InputError, match="other: expected a folder of this campaign") as error:
        merge([tmp_path / "one", tmp_path / "other"], tmp_path / "merged")
    assert told in str(error.value)
    assert f"(here: {tmp_path / 'one'} and those" in str(error.value)
    assert not (tmp_path / "merged").exists()


def test_shares_of_another_scenario_or_version_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    campaign = make_campaign()
    fill(tmp_path / "one", campaign)
    with monkeypatch.context() as patch:
        patch.setattr("vedette.campaigns.cells.contents_of", lambda scenario: ["other bytes"])
        fill(tmp_path / "changed", campaign)
    with pytest.raises(InputError, match=r"changed: .*files that its scenarios name have other contents"):
        merge([tmp_path / "one", tmp_path / "changed"], tmp_path / "merged")
    with monkeypatch.context() as patch:
        patch.setattr("vedette.campaigns.manifest.versions", lambda *_: {"numpy": "0.1"})
        fill(tmp_path / "old", campaign)
    with pytest.raises(InputError, match=r"old: expected runs of the same versions .* there and .* here"):
        merge([tmp_path / "one", tmp_path / "old"], tmp_path / "merged")
    assert not (tmp_path / "merged").exists()


def test_a_damaged_run_and_a_folder_of_nothing_are_refused(tmp_path: Path) -> None:
    folder = fill(tmp_path / "one", make_campaign())
    with pytest.raises(InputError, match="nothing: expected the results folder of a shard"):
        merge([folder, tmp_path / "nothing"], tmp_path / "merged")
    with pytest.raises(InputError, match="it is one of them"):
        merge([folder], folder)
    with closing(sqlite3.connect(folder / "campaign.sqlite")) as database, database:
        database.execute("UPDATE runs SET metrics = x'00' WHERE run = 1")
    with pytest.raises(InputError, match=r"run 1: expected the run as it was written"):
        merge([folder], tmp_path / "merged")
    assert not (tmp_path / "merged").exists()


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs kill -9")
def test_shares_killed_at_every_tenth_row_go_on_to_the_same_rows(
    tmp_path: Path, stub: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign = stub_campaign(runs=45)
    run_campaign(campaign, tmp_path / "alone")
    with started("run_killed", str(tmp_path / "shards"), "45", "3", module="stubs") as process:
        output, errors = process.communicate()
    assert process.returncode == 0, errors
    kills = [int(line) for line in output.split()]
    # Of 30 runs each; where rows come several at a time, a kill comes late, and the last one not at all.
    assert [kills.count(done) for done in (10, 20)] == [3, 3]
    assert set(kills) <= {10, 20, 30}
    merged = merge([tmp_path / "shards"], tmp_path / "merged")
    assert (merged.num_added, merged.missing) == (90, ())
    assert rows(tmp_path / "merged") == rows(tmp_path / "alone")
    assert tables(tmp_path / "merged") == tables(tmp_path / "alone")


def test_a_share_killed_before_its_first_row_is_missing(tmp_path: Path, stub: None) -> None:
    first, second = in_shards(stub_campaign(runs=4), tmp_path / "shards", 2)
    (second / "campaign.sqlite").unlink()
    assert merge([first, second], tmp_path / "merged").missing == (2,)


@pytest.mark.parametrize(
    ("time", "said"), [("4h", "04:00:00"), ("90m", "01:30:00"), ("1d12h", "36:00:00"), ("1h5m", "01:05:00")]
)
def test_a_job_array_has_a_task_a_share(time: str, said: str) -> None:
    script = slurm_script("paper", 1000, time, "vedette campaign paper.toml", "vedette merge x")
    lines = script.splitlines()
    assert lines[0] == "#!/bin/bash"
    assert "#SBATCH --array=1-1000" in lines
    assert f"#SBATCH --time={said}" in lines
    assert lines[-1] == 'vedette campaign paper.toml --shard "$SLURM_ARRAY_TASK_ID/1000"'


@pytest.mark.parametrize("time", ["", "4", "h", "04:00:00", "0m", "4h; rm"])
def test_a_time_that_is_none_is_refused(time: str) -> None:
    with pytest.raises(InputError, match="time: expected days, hours or minutes"):
        slurm_script("paper", 10, time, "", "")
