"""The results folder while it is written: what it keeps, and what it refuses."""

from __future__ import annotations

import json
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from campaigns.filled import add, fill, make_campaign
from vedette.campaigns import manifest as manifests
from vedette.campaigns import store as stores
from vedette.campaigns.cells import resolve
from vedette.campaigns.results import open_results
from vedette.campaigns.rows import row_of
from vedette.campaigns.spec import spec_from_data
from vedette.campaigns.store import Store
from vedette.errors import InputError


@pytest.fixture(scope="module")
def campaign():
    return make_campaign()


@pytest.fixture
def filled(tmp_path, campaign):
    return fill(tmp_path / "results", campaign, leave_out=2)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_folder_is_made_with_its_manifest_before_the_first_run(tmp_path, campaign):
    folder = tmp_path / "deep" / "results"
    with Store.open(folder, campaign) as store:
        assert store.finished() == set()
        manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["digest"] == campaign.digest()
    assert [cell["name"] for cell in manifest["cells"]] == [cell.name for cell in campaign.cells]
    assert manifest["spec"]["planners"] == ["jdm", "random"]
    assert set(manifest["sessions"][0]["versions"]) == {"python", "vedette", "numpy", "scipy", "numba", "llvmlite"}
    assert set(manifest["sessions"][0]["machine"]) == {"platform", "architecture", "processors"}


def test_a_closed_folder_is_two_files_and_an_empty_lock(filled):
    assert sorted(path.name for path in filled.iterdir()) == ["campaign.lock", "campaign.sqlite", "manifest.json"]
    assert (filled / "campaign.lock").stat().st_size == 0


def test_runs_are_kept_over_sessions(filled, campaign):
    with Store.open(filled, campaign) as store:
        assert store.session == 2
        assert store.version_changes == ()
        missing = {(cell.name, run) for cell, run in campaign.tasks} - store.finished()
        assert missing == {("random-rate-5.0", 2), ("random-rate-10.0", 2)}
        for cell, run in missing:
            add(store, cell, run)
        assert len(store.finished()) == len(campaign.tasks)
    results = open_results(filled)
    assert [results.run("jdm-rate-5.0", 0).session, results.run("random-rate-5.0", 2).session] == [1, 2]


def test_a_finished_run_is_not_added_again(filled, campaign):
    with Store.open(filled, campaign) as store:
        with pytest.raises(InputError, match=r"campaign.sqlite: cell jdm-rate-5\.0, run 0: expected another run"):
            add(store, "jdm-rate-5.0", 0)
        add(store, "random-rate-5.0", 2)


@pytest.mark.parametrize(
    ("cell", "run", "message"),
    [
        ("idm", 0, r"cell: expected one of jdm-rate-5\.0"),
        ("jdm-rate-5.0", 3, "run: expected a number from 0 to 2; got 3"),
        ("jdm-rate-5.0", -1, "run: expected"),
    ],
)
def test_runs_of_no_cell_are_refused(filled, campaign, cell, run, message):
    with Store.open(filled, campaign) as store, pytest.raises(InputError, match=message):
        store.add(row_of(cell, run, b"", b""))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": "another"}, "name is 'trial' there and 'another' here"),
        ({"seed": 8}, "seed is 7 there and 8 here"),
        ({"planners": ["jdm"]}, "axes.planner is .* there"),
        ({"compare": "sensors.*.clutter.rate"}, "compare is 'planner' there"),
        ({"set": {"control.num_samples": 7}}, r"spec.set.control.num_samples is None there and 7 here"),
        ({"grid": {"sensors.*.clutter.rate": [5.0, 11.0]}}, r"clutter.rate\[1\] is 10.0 there and 11.0 here"),
    ],
)
def test_a_folder_of_another_campaign_is_kept_as_it_is(filled, change, message):
    before = contents(filled)
    with pytest.raises(InputError, match=message):
        Store.open(filled, make_campaign(**change))
    assert contents(filled) == before


def test_a_scenario_that_changed_since_is_named_by_its_line(tmp_path):
    from vedette.scenarios import list_builtin

    text = list_builtin()["paper-a"].read_text(encoding="utf-8")
    file = tmp_path / "mine.yaml"

    def made():
        return resolve(spec_from_data({"name": "own", "scenarios": ["mine.yaml"], "runs": 1}), tmp_path)

    file.write_text(text, encoding="utf-8")
    Store.open(tmp_path / "results", made()).close()
    file.write_text(text.replace("num_samples: 40", "num_samples: 41"), encoding="utf-8")
    with pytest.raises(InputError, match=r"cells\[0\].scenario, line \d+ is ' num_samples: 40' there and"):
        Store.open(tmp_path / "results", made())


def test_a_campaign_may_be_made_longer_and_never_shorter(filled, campaign):
    with Store.open(filled, campaign.with_runs(5)) as store:
        add(store, "jdm-rate-5.0", 4)
    assert open_results(filled).campaign.num_runs == 5
    with Store.open(filled, campaign) as store:
        assert ("jdm-rate-5.0", 4) in store.finished()
    assert open_results(filled).missing("jdm-rate-5.0") == (3,)


def test_a_folder_of_something_else_is_not_touched(tmp_path, campaign):
    (tmp_path / "thesis.txt").write_text("years of work")
    with pytest.raises(InputError, match="holds something else"):
        Store.open(tmp_path, campaign)
    (tmp_path / "thesis.txt").rename(tmp_path / "manifest.json")
    with pytest.raises(InputError, match=r"manifest\.json: expected the manifest of a results folder"):
        Store.open(tmp_path, campaign)
    assert contents(tmp_path) == {"manifest.json": b"years of work"}
    with pytest.raises(InputError, match="expected a folder for results; got a file"):
        Store.open(tmp_path / "manifest.json", campaign)
    with pytest.raises(InputError, match="expected a place for a results folder"):
        Store.open(tmp_path / "manifest.json" / "results", campaign)


def test_runs_without_their_manifest_are_not_touched(filled, campaign):
    (filled / "manifest.json").unlink()
    before = contents(filled)
    with pytest.raises(InputError, match=r"expected manifest\.json beside campaign\.sqlite"):
        Store.open(filled, campaign)
    assert contents(filled) == before


def test_what_a_start_killed_early_leaves_is_gone_on_with(tmp_path, campaign):
    folder = tmp_path / "results"
    folder.mkdir()
    (folder / "campaign.lock").touch()
    (folder / "campaign.lock-journal").touch()
    (folder / f".manifest.json.{'0123' * 8}").write_text("{")
    Store.open(folder, campaign).close()
    assert {path.name for path in folder.iterdir()} == {"campaign.lock", "campaign.sqlite", "manifest.json"}
    (folder / "campaign.sqlite").unlink()
    fill(folder, campaign)
    assert len(list(open_results(folder).runs())) == len(campaign.tasks)


def test_damaged_runs_are_refused_and_leave_the_manifest_alone(filled, campaign):
    database = filled / "campaign.sqlite"
    whole, manifest = database.read_bytes(), (filled / "manifest.json").read_bytes()
    for broken in (b"not a database, but long enough to be read as one" * 100, whole[:100], whole[:5000]):
        database.write_bytes(broken)
        with pytest.raises(InputError, match=r"campaign\.sqlite"):
            Store.open(filled, campaign)
        assert (filled / "manifest.json").read_bytes() == manifest


def test_runs_of_another_campaign_beside_the_manifest_are_refused(filled, tmp_path, campaign):
    other = fill(tmp_path / "other", make_campaign(seed=8), leave_out=11)
    shutil.copy(other / "campaign.sqlite", filled / "campaign.sqlite")
    for attempt in (lambda: Store.open(filled, campaign), lambda: open_results(filled)):
        with pytest.raises(InputError, match="another campaign's"):
            attempt()


def test_one_writer_at_a_time(filled, campaign):
    with Store.open(filled, campaign) as store:
        with pytest.raises(InputError, match="another process is writing this campaign"):
            Store.open(filled, campaign)
        add(store, "random-rate-5.0", 2)
    Store.open(filled, campaign).close()


def test_other_versions_are_kept_apart_by_session(filled, campaign, monkeypatch):
    session = manifests.new_session()
    session["versions"]["numpy"] = "1.0"
    monkeypatch.setattr(stores, "new_session", lambda: session)
    with Store.open(filled, campaign) as store:
        (change,) = store.version_changes
    assert change.startswith("numpy was ")
    assert change.endswith(" in session 1 and is 1.0 now")
    assert len(open_results(filled).manifest["sessions"]) == 2


def test_a_manifest_that_cannot_be_written_is_named(filled, campaign, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("vedette.internal.files.write_whole", fail)
    with pytest.raises(InputError, match=r"manifest\.json: expected a file that can be written; .*No space"):
        Store.open(filled, campaign)
    monkeypatch.undo()
    Store.open(filled, campaign).close()


def test_words_of_the_file_that_are_no_utf8_are_a_fault_of_the_file(filled, campaign):
    """SQLite quotes them when it says what is wrong, and Python cannot read what it says."""
    file = filled / "campaign.sqlite"
    whole = file.read_bytes()
    assert b"contents TEXT NOT NULL" in whole
    file.write_bytes(whole.replace(b"contents TEXT NOT NULL", b"contents TEXT NOT NU\xffL"))
    for read in (open_results, lambda folder: Store.open(folder, campaign)):
        with pytest.raises(InputError, match=r"campaign\.sqlite: expected the runs of a campaign as they were written"):
            read(filled)


@pytest.mark.parametrize(
    "values", ["'a', 0, 1, CAST(x'ff' AS TEXT)", "'a', 'b', 1, 'c'", "x'00', 0, 1, 'c'", "'a', 0, 1, x'00'"]
)
def test_failures_that_are_none_are_a_fault_of_the_file(filled, values):
    with closing(sqlite3.connect(filled / "campaign.sqlite")) as database, database:
        database.execute(f"INSERT INTO failures VALUES ({values})")
    with pytest.raises(InputError, match=r"campaign\.sqlite: expected") as caught:
        open_results(filled).failures()
    assert str(caught.value).isprintable()
