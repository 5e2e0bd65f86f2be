"""Results folders, saved runs and densities edited at random: each is read as it was, or refused by name.

Reading changes nothing, runs nothing that a file names, and raises nothing but the library's own errors.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from campaigns.filled import make_campaign
from densities.examples import random_glmb, random_lmb, random_poisson
from evaluation.synthetic import make_record
from fuzz import edits, store_edits
from fuzz.mutations import spoil_bytes
from vedette.campaigns.cells import Campaign
from vedette.campaigns.codec import encode
from vedette.campaigns.results import CampaignResults, open_results
from vedette.campaigns.rows import row_of
from vedette.campaigns.store import Store
from vedette.cli import app
from vedette.densities.files import load_density, save_density
from vedette.errors import VedetteError
from vedette.evaluation.metrics.run import measure
from vedette.evaluation.metrics.serialization import encode_metrics
from vedette.reports import write_figures, write_report
from vedette.simulation.serialization import encode_timings
from vedette.simulation.storage import load_run, read_manifest, save_run

pytestmark = pytest.mark.fuzz

Cases = Callable[[Callable[[np.random.Generator], object], int], None]
SCANS = 25
REPORT_EVERY = 12  # cases; a report takes a second
RUN_CODE = "motion:\n  kind: custom\n  function: {file}:boom\n  components: [px, py, vx, vy]\n"


@dataclass(frozen=True)
class Originals:
    """What the edits start from; never written to.

    Attributes:
        place: has `results`, `run` and densities (`*.npz`).
        checksums: of each run of the results.
        mark: is there once code that a file names was run.
    """

    place: Path
    campaign: Campaign
    checksums: dict[tuple[str, int], str]
    mark: Path


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> Originals:
    place = tmp_path_factory.mktemp("originals")
    fields = {"time.num_steps": SCANS, "control.decision_steps": [10, 20], "ospa.last_scan": SCANS}
    campaign = make_campaign(grid={}, runs=2, set=fields)
    with Store.open(place / "results", campaign) as store:
        for cell, run in campaign.tasks:
            record = replace(make_record(cell.planner, run, num_scans=SCANS), scenario="paper-a")
            metrics = encode_metrics(measure(record, cutoff=100.0, order=1.0, window=10))
            store.add(row_of(cell.name, run, encode(record), encode_timings(record), metrics))
    save_run(make_record(num_scans=SCANS), place / "run", scenario_text="name: synthetic\n")
    rng = np.random.default_rng(0)
    save_density(place / "glmb.npz", random_glmb(rng, 3, 5, 2))
    save_density(place / "lmb.npz", random_lmb(rng, 3))
    save_density(place / "poisson.npz", random_poisson(rng, 3))
    checksums = {(run.cell, run.record.run): run.checksum for run in open_results(place / "results").runs()}
    (place / "evil.py").write_text(f"open({str(place / 'mark')!r}, 'w')\n\n\ndef boom():\n    return None\n")
    return Originals(place, campaign, checksums, place / "mark")


@pytest.fixture
def copies(tmp_path: Path) -> Callable[[Path], Path]:
    """Makes the copy that a case edits, in place of the one of the case before."""
    target = tmp_path / "copy"

    def copy(source: Path) -> Path:
        shutil.rmtree(target, ignore_errors=True)
        target.mkdir()
        (shutil.copytree if source.is_dir() else shutil.copy)(source, target / source.name)
        return target / source.name

    return copy


def contents(folder: Path) -> dict[str, tuple[str, int]]:
    """Every file with its checksum and the time of its last change."""
    return {
        str(path.relative_to(folder)): (hashlib.sha256(path.read_bytes()).hexdigest(), path.stat().st_mtime_ns)
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@contextmanager
def refused(place: Path) -> Iterator[None]:
    """A named error in words is an outcome like another; it names the file or folder, or the field."""
    try:
        yield
    except VedetteError as error:
        text = str(error)
        assert "expected" in text or "got" in text, text
        assert len(text) < 10_000, f"{len(text)} letters: {text[:300]}"
        assert place.parent.name in text or place.name in text, text


@pytest.mark.usefixtures("svg_figures")
def test_results_folders(originals: Originals, copies: Callable[[Path], Path], try_cases: Cases) -> None:
    def check(rng: np.random.Generator) -> None:
        folder = copies(originals.place / "results")
        signed = _edit_results(folder, originals, rng)
        before = contents(folder)
        with refused(folder):
            _read_all(open_results(folder), None if signed else originals)
        _call("results", folder)
        if not rng.integers(REPORT_EVERY):
            _report(folder, folder.parent / "made")
        assert contents(folder) == before, "reading changed the folder"
        _go_on(folder, originals)
        assert not originals.mark.exists(), "code that a file names was run"

    try_cases(check, 60)


def _edit_results(folder: Path, originals: Originals, rng: np.random.Generator) -> bool:
    """Whether the checksums were made to fit."""
    sign, what = bool(rng.integers(2)), rng.integers(7)
    if what == 0:
        _name_code(folder, originals.place / "evil.py", rng)
        return True
    if what in (1, 2, 3):
        store_edits.edit_manifest(folder, rng, sign=sign)
        return sign
    if what == 4:
        store_edits.edit_database(folder, rng)
        return False
    store_edits.edit_run(folder, rng, sign=sign)
    return sign


def _name_code(folder: Path, file: Path, rng: np.random.Generator) -> None:
    """A manifest whose scenarios name code in some of their sections."""
    manifest = json.loads((folder / "manifest.json").read_bytes())
    reference = f"{{kind: custom, function: '{file}:boom'}}"
    for cell in manifest["cells"]:
        section = ["detection", "noise", "clutter", "measurement"][rng.integers(4)]
        lines = []
        for line in cell["scenario"].splitlines():
            indent = line[: len(line) - len(line.lstrip())]
            lines.append(f"{indent}{section}: {reference}" if line.strip().startswith(f"{section}: {{") else line)
        cell["scenario"] = "\n".join(lines)
    (folder / "manifest.json").write_text(json.dumps(manifest))
    store_edits.sign_manifest(folder)


def _read_all(results: CampaignResults, originals: Originals | None) -> None:
    """Every run and table; with the originals, each run is as it was."""
    for cell in results.campaign.cells:
        results.finished(cell.name)
        assert len(results.missing(cell.name)) <= results.campaign.num_runs
    for run in results.runs():
        encoded = encode(run.record)
        checksum = hashlib.sha256(f"{run.cell}\n{run.record.run}\n".encode() + encoded).hexdigest()
        if originals is not None:
            assert checksum == originals.checksums[run.cell, run.record.run], "another run, and nothing says so"
    results.comparisons()
    results.tables()


def _call(*arguments: Any) -> None:
    """A command ends in words, whatever there is to read."""
    result = CliRunner().invoke(app, [str(each) for each in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code in (0, 1), result.output


def _report(folder: Path, made: Path) -> None:
    shutil.rmtree(made, ignore_errors=True)
    made.mkdir()
    with refused(folder):
        results = open_results(folder)
        write_report(results, made / "report.html")
        write_figures(results, made / "figures")


def _go_on(folder: Path, originals: Originals) -> None:
    """The campaign goes on with the folder, or refuses it and leaves it as it is."""
    before, opened = contents(folder), False
    with refused(folder), Store.open(folder, originals.campaign) as store:
        opened = True
        if not store.damaged():
            assert store.finished() <= set(originals.checksums)
    assert opened or contents(folder) == before, "a folder that was refused was changed"


def test_saved_runs(originals: Originals, copies: Callable[[Path], Path], try_cases: Cases) -> None:
    same = make_record(num_scans=SCANS)

    def check(rng: np.random.Generator) -> None:
        folder = copies(originals.place / "run")
        signed = _edit_saved(folder, rng)
        before = contents(folder)
        with refused(folder):
            read_manifest(folder)
        with refused(folder):
            record = load_run(folder)
            again = save_run(record, folder.parent / "again")
            if not signed:
                whole = save_run(same, folder.parent / "same")
                assert {path.name: path.read_bytes() for path in again.glob("*.arrow")} == {
                    path.name: path.read_bytes() for path in whole.glob("*.arrow")
                }
        assert contents(folder) == before

    try_cases(check, 100)


def _edit_saved(folder: Path, rng: np.random.Generator) -> bool:
    manifest = json.loads((folder / "manifest.json").read_bytes())
    name = ["manifest.json", *manifest["files"]][rng.integers(len(manifest["files"]) + 1)]
    path = folder / name
    if not rng.integers(8):
        path.unlink()
        if rng.integers(2):
            path.symlink_to(["/dev/zero", "/etc/passwd", str(folder), name][rng.integers(4)])
        return False
    old = path.read_bytes()
    if name.endswith(".json"):
        new = edits.edit_json(old, rng)
    elif name.endswith(".arrow"):
        new = edits.edit_arrow(old, rng)
    else:
        new = spoil_bytes(rng, old)
    path.write_bytes(new)
    if name == "manifest.json":
        return True  # the facts of a run stand nowhere else
    if rng.integers(2):
        manifest["files"][name] = hashlib.sha256(new).hexdigest()
        (folder / "manifest.json").write_text(json.dumps(manifest))
        return True
    return False


def test_densities(originals: Originals, copies: Callable[[Path], Path], try_cases: Cases) -> None:
    files = sorted(originals.place.glob("*.npz"))

    def check(rng: np.random.Generator) -> None:
        path = copies(files[rng.integers(len(files))])
        path.write_bytes(edits.edit_npz(path.read_bytes(), rng))
        with refused(path):
            density = load_density(path)
            density.validate()
            save_density(path.with_name("again.npz"), density)

    try_cases(check, 300)
