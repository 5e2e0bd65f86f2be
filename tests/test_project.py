"""The promises of the project about itself: set-up, locks, documentation, package."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

import vedette
from scripts import load
from vedette.kernels.base.compile import JIT_ENABLED, kernel
from waiting import PATIENCE, heed_interrupts, wait_until

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
README = (ROOT / "README.md").read_text("utf-8")
LOCKS = sorted((ROOT / "requirements").glob("*.txt"))


def pins(lock: Path) -> dict[str, set[str]]:
    """Locked name -> versions, with what they are for where Pythons or platforms have different ones."""
    found: dict[str, set[str]] = {}
    for name, pin in re.findall(r"^([a-z0-9.-]+)==([^\\]+) \\", lock.read_text("utf-8"), re.MULTILINE):
        found.setdefault(name, set()).add(pin)
    return found


def canonical(requirement: str) -> str:
    """Name of a requirement as a lock writes it."""
    matched = re.match(r"[A-Za-z0-9._-]+", requirement)
    assert matched is not None
    return re.sub(r"[-_.]+", "-", matched[0]).lower()


def direct_dependencies() -> list[str]:
    extras = PROJECT["project"]["optional-dependencies"].values()
    groups = PROJECT["dependency-groups"].values()
    listed = [*PROJECT["project"]["dependencies"], *(entry for group in (*extras, *groups) for entry in group)]
    return [canonical(entry) for entry in listed if isinstance(entry, str) and not entry.startswith("vedette[")]


@kernel
def _last(values: np.ndarray, index: int) -> float:
    return float(values[index])


@pytest.mark.lanes
def test_the_lane_is_the_one_that_was_asked_for() -> None:
    assert (os.environ.get("NUMBA_DISABLE_JIT") == "1") is not JIT_ENABLED
    assert _last(np.arange(3.0), 2) == 2.0
    if not JIT_ENABLED or os.environ.get("NUMBA_BOUNDSCHECK") == "1":
        with pytest.raises(IndexError):
            _last(np.arange(3.0), 3)


@pytest.mark.parametrize("lock", LOCKS, ids=lambda path: path.name)
def test_locks_name_no_place_and_hash_every_file(lock: Path) -> None:
    text = lock.read_text("utf-8")
    assert not re.search(r"https?:|file:|--index|--extra-index|--find-links|--trusted", text)
    blocks = re.split(r"\n(?=[a-z])", text.split("\n", 1)[1])
    assert len(blocks) == sum(map(len, pins(lock).values())) > 20
    assert all("--hash=sha256:" in block for block in blocks)


def test_the_check_runs_on_what_a_user_gets() -> None:
    runtime, check = (pins(ROOT / "requirements" / f"{name}.txt") for name in ("runtime", "check"))
    assert runtime.items() <= check.items()


def test_every_direct_dependency_is_locked_and_has_its_reason() -> None:
    locked = pins(ROOT / "requirements" / "check.txt")
    reasons = (ROOT / "docs/decisions/0001-dependencies.md").read_text("utf-8").lower()
    for name in direct_dependencies():
        assert name in locked
        assert name.removesuffix("-python").replace("-", ".") in reasons or name in reasons.replace("_", "-")


def test_supported_pythons_agree() -> None:
    dev = load("dev.py")
    assert PROJECT["project"]["requires-python"] == ">={}.{},<{}.{}".format(
        *dev.OLDEST, dev.NEWEST[0], dev.NEWEST[1] + 1
    )
    classifiers = [entry for entry in PROJECT["project"]["classifiers"] if re.search(r":: 3\.\d+$", entry)]
    assert len(classifiers) == dev.NEWEST[1] - dev.OLDEST[1] + 1


def test_an_unsupported_python_is_told_so_before_anything_else() -> None:
    code = (
        "import sys; sys.version_info = (3, 8, 1); sys.argv = ['dev.py'];"
        f"exec(compile(open({str(ROOT / 'dev.py')!r}).read(), 'dev.py', 'exec'))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 1
    assert "needs Python 3.11 to 3.15; this is Python 3.8" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["--help"], 0, "reproduce"),
        ([], 2, "usage"),
        (["chekc"], 2, "unknown command 'chekc'"),
        (["docs", "--opne"], 2, "expected a port, --open or nothing; got --opne"),
    ],
)
def test_the_set_up_script_explains_itself(arguments: list[str], status: int, message: str) -> None:
    command = [sys.executable, str(ROOT / "dev.py"), *arguments]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == status
    assert message in result.stdout + result.stderr


def test_an_environment_is_made_again_only_when_its_lock_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dev = load("dev.py")
    done: list[str] = []
    (tmp_path / "requirements").mkdir()
    for name in ("requirements/runtime.txt", "requirements/check.txt", "pyproject.toml", "python"):
        (tmp_path / name).write_text(name)
    places = {"ROOT": tmp_path, "VENV": tmp_path, "PYTHON": tmp_path / "python", "STAMP": tmp_path / "installed.txt"}
    for name, path in places.items():
        monkeypatch.setattr(dev, name, path)
    monkeypatch.setattr(dev, "make_venv", lambda: done.append("new"))
    monkeypatch.setattr(dev, "install", lambda extent, dependencies: done.append(f"{extent} {dependencies}"))

    def steps(extent: str) -> list[str]:
        done.clear()
        dev.set_up(extent)
        return list(done)

    assert steps("runtime") == ["new", "runtime True"]
    assert steps("runtime") == []
    assert steps("check") == ["check True"]
    assert steps("runtime") == []
    (tmp_path / "pyproject.toml").write_text("another script")
    assert steps("runtime") == ["runtime False"]
    assert steps("check") == []
    (tmp_path / "requirements/check.txt").write_text("another version")
    assert steps("runtime") == []
    assert steps("check") == ["new", "check True"]


def test_the_documentation_is_served(monkeypatch: pytest.MonkeyPatch) -> None:
    dev = load("dev.py")
    called: list[list[str]] = []
    monkeypatch.setattr(dev, "set_up", lambda extent: called.append([extent]))
    monkeypatch.setattr(dev, "attend", lambda command, folder: called.append(command[1:]))
    dev.main(["docs", "8123", "--open"])
    assert called == [["check"], [str(ROOT / "tools" / "docs.py"), "serve", "8123", "--open"]]


def test_a_failed_step_of_the_set_up_shows_what_it_said() -> None:
    dev = load("dev.py")
    with pytest.raises(dev.SetupError, match=r"(?s)no such thing.*failed\. Try another\."):
        dev.call([sys.executable, "-c", "print('no such thing'); raise SystemExit(3)"], "Try another.")


def test_the_check_names_its_stages_and_refuses_others() -> None:
    check = load("tools/check.py")
    documented = set(re.findall(r"`([a-z-]+)`", (ROOT / "CONTRIBUTING.md").read_text("utf-8")))
    assert set(check.STAGES) <= documented
    assert check.main(["--list"]) == 0
    assert check.main(["everything"]) == 2


def test_more_of_a_phrase_than_allowed_fails_the_prose_check(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    prose = load("tools/prose.py")
    monkeypatch.setattr(sys, "argv", ["prose.py"])
    assert prose.main() == 0
    source = tmp_path / "some.py"
    source.write_text('"""Whether it is told what is so."""\n\n# but for this `of which`\n', "utf-8")
    assert prose.places(source) == ["is told", "Whether it is told what is so.", "but for"]
    page = tmp_path / "page.md"
    page.write_text("```\nnobody\n```\nNobody reads `but for`.\n", "utf-8")
    assert prose.places(page) == ["Nobody"]
    monkeypatch.setattr(prose, "ROOT", tmp_path)
    monkeypatch.setattr(prose, "files", lambda: [page])
    monkeypatch.setattr(prose, "guides", lambda: [])
    assert prose.main() == 1
    assert capsys.readouterr().out.endswith("page.md: expected at most 0 phrases; got 1\n")


def test_a_failed_stage_fails_the_check_and_the_rest_is_run(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    check = load("tools/check.py")
    stages = {
        name: check.Stage("a trial", [sys.executable, "-c", f"print('ran {name}'); raise SystemExit({status})"])
        for name, status in {"first": 0, "second": 5, "third": 0}.items()
    }
    monkeypatch.setattr(check, "STAGES", stages)
    assert check.main([]) == 1
    output = capfd.readouterr().out
    assert all(f"ran {name}" in output for name in stages)
    assert output.splitlines()[-1].endswith("FAILED: second")
    figures = [line.split() for line in output.splitlines()[-4:-1]]
    assert {name: verdict for name, verdict, *_ in figures} == {
        "first": "passed",
        "second": "FAILED",
        "third": "passed",
    }
    assert all(line[3] == line[5] == "s" and line[2].isdigit() and line[4].isdigit() for line in figures)
    assert check.main(["first", "third"]) == 0


def test_stages_side_by_side_keep_their_outputs_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    check = load("tools/check.py")
    # Each waits for the other, so that neither ends before both have begun.
    script = (
        "import pathlib, sys, time; mine, other = map(pathlib.Path, sys.argv[1:]); print(mine.name, 1, flush=True)\n"
        "mine.touch()\nwhile not other.exists(): time.sleep(0.01)\nprint(mine.name, 2, file=sys.stderr)"
    )
    places = [str(tmp_path / name) for name in ("left", "right")]
    orders = {"left": places, "right": places[::-1]}
    stages = {name: check.Stage("a trial", [sys.executable, "-c", script, *order]) for name, order in orders.items()}
    monkeypatch.setattr(check, "STAGES", stages)
    monkeypatch.setattr(check, "LOGS", tmp_path / "logs")
    assert check.main([]) == 0
    shown = capfd.readouterr().out
    assert all(f"== {name}: a trial\n{name} 1\n{name} 2\n== {name}: passed" in shown for name in stages)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_an_interrupted_check_leaves_no_stage_behind(tmp_path: Path) -> None:
    wait = f"import pathlib, time; pathlib.Path({str(tmp_path)!r}, NAME).touch(); time.sleep({PATIENCE})"
    program = (
        "import check, pathlib, sys\n"
        f"command = lambda name: [sys.executable, '-c', {wait!r}.replace('NAME', repr(name))]\n"
        "check.STAGES = {name: check.Stage('a trial', command(name)) for name in ('one', 'two', 'three')}\n"
        f"check.LOGS, check.GRACE = pathlib.Path({str(tmp_path / 'logs')!r}), 0.5\n"
        "sys.exit(check.main([]))"
    )
    check = subprocess.Popen(
        [sys.executable, "-c", program],
        cwd=ROOT / "tools",
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=heed_interrupts,
    )
    try:
        wait_until(lambda: all((tmp_path / name).exists() for name in ("one", "two")), "two stages")
        check.send_signal(signal.SIGINT)  # to the check alone: its stages are ended by it
        shown, _ = check.communicate(timeout=PATIENCE)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(check.pid, signal.SIGKILL)
            pytest.fail("a stage was left behind")
    assert check.returncode == 130
    assert shown.count("FAILED with status -15") == 2
    assert not (tmp_path / "three").exists()


def test_links_between_the_files_of_the_project_lead_somewhere() -> None:
    for page in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md"):
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", (ROOT / page).read_text("utf-8")):
            assert (ROOT / target).exists(), f"{page}: {target}"


def test_the_example_of_the_readme_has_strict_types(tmp_path: Path) -> None:
    (block,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    example = tmp_path / "example.py"
    example.write_text(block, "utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file", str(ROOT / "pyproject.toml"), str(example)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_the_first_screen_of_the_readme_says_how_to_start() -> None:
    first = "\n".join(README.splitlines()[:45])
    assert "dev.py reproduce" in first
    assert "vedette init" in first


def test_the_readme_can_be_read_where_there_is_no_repository() -> None:
    portable = load("tools/readme.py").portable
    alone = portable(README, None)
    assert re.findall(r"\]\((?!https?:|#)[^)]*\)", alone) == []
    assert "examples/own_sensor.py" in alone
    assert "*Left: four targets, " in alone
    linked = portable(README, "https://example.org/vedette/")
    assert "(https://example.org/vedette/raw/main/docs/images/reproduction.png)" in linked
    assert "(https://example.org/vedette/blob/main/LICENSE)" in linked


def test_how_to_cite_says_this_version_and_the_paper() -> None:
    citation = YAML(typ="safe").load(ROOT / "CITATION.cff")
    assert citation["cff-version"] == "1.2.0"
    assert citation["version"] == vedette.__version__
    assert citation["license"] == PROJECT["project"]["license"]
    (paper,) = citation["references"]
    assert " ".join(paper["title"].split()) in " ".join(README.split())


def test_the_changelog_begins_with_what_is_unreleased_and_then_this_version() -> None:
    headings = re.findall(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
    assert headings[0] == "[Unreleased]"
    assert re.fullmatch(re.escape(f"[{vedette.__version__}]") + r" - (\d{4}-\d\d-\d\d|YYYY-MM-DD)", headings[1])


def build(folder: Path, kind: str, target: Path, **environment: str) -> Path:
    """The one file that hatchling builds of the project in a folder."""
    command = [sys.executable, "-m", "hatchling", "build", "--target", kind, "--directory", str(target)]
    subprocess.run(command, cwd=folder, check=True, capture_output=True, env={**os.environ, **environment})
    (built,) = target.iterdir()
    return built


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that the source distribution unpacks to."""
    place = tmp_path_factory.mktemp("source")
    with tarfile.open(build(ROOT, "sdist", place / "built")) as archive:
        archive.extractall(place, filter="data")
    return place / f"vedette-{vedette.__version__}"


@pytest.fixture(scope="module")
def wheel(unpacked: Path, tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    """Built from the unpacked source distribution, as an installer does."""
    return zipfile.ZipFile(build(unpacked, "wheel", tmp_path_factory.mktemp("wheel")))


@pytest.fixture
def wheel_files(wheel: zipfile.ZipFile) -> list[str]:
    return wheel.namelist()


def test_the_source_distribution_holds_all_that_the_project_needs(unpacked: Path) -> None:
    held = {path.relative_to(unpacked).as_posix() for path in unpacked.rglob("*") if path.is_file()}
    folders = (".ci", "benchmarks", "docs", "examples", "requirements", "src", "tests", "tools")
    expected = {path for folder in folders for path in (ROOT / folder).rglob("*") if path.is_file()}
    expected |= {
        ROOT / name for name in ("dev.py", "mkdocs.yml", "pyproject.toml", "LICENSE", "CITATION.cff", ".gitignore")
    }
    expected |= {ROOT / f"{name}.md" for name in ("README", "CHANGELOG", "CONTRIBUTING", "SECURITY")}
    names = {path.relative_to(ROOT).as_posix() for path in expected if not {"__pycache__"} & set(path.parts)}
    assert {name for name in names if not name.endswith((".pyc", ".swp"))} - held == set()
    assert all((unpacked / target).exists() for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", README))


def test_the_package_carries_a_readme_that_stands_alone(wheel: zipfile.ZipFile) -> None:
    (name,) = (name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
    metadata = wheel.read(name).decode()
    assert "# Vedette\n" in metadata
    assert "](docs/" not in metadata


def test_the_package_holds_the_whole_library_its_types_data_and_licence(wheel_files: list[str]) -> None:
    tracked = [path.relative_to(ROOT / "src").as_posix() for path in (ROOT / "src").rglob("*") if path.is_file()]
    expected = {path for path in tracked if "__pycache__" not in path and not Path(path).name.startswith(".")}
    assert "vedette/py.typed" in expected
    assert expected <= set(wheel_files)
    assert any(path.endswith("licenses/LICENSE") for path in wheel_files)
    assert not [path for path in wheel_files if path.startswith(("tests/", "tools/"))]


def test_a_wheel_with_kernels_is_one_of_this_python_and_system(unpacked: Path, tmp_path: Path) -> None:
    (tmp_path / "kernels" / "base.0").mkdir(parents=True)
    (tmp_path / "kernels" / "base.0" / "entry.nbc").write_bytes(b"code")
    file = build(unpacked, "wheel", tmp_path / "built", VEDETTE_COMPILED_KERNELS=str(tmp_path / "kernels"))
    tag = f"cp{sys.version_info[0]}{sys.version_info[1]}"
    assert file.name.startswith(f"vedette-{vedette.__version__}-{tag}-{tag}-")
    if sys.platform == "linux":
        assert "-manylinux_" in file.name  # what a registry takes
    assert zipfile.ZipFile(file).read("vedette/compiled-kernels/base.0/entry.nbc") == b"code"


def test_a_release_whose_kernels_or_figures_are_not_there_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    release = load("tools/release.py")
    printed: list[str] = []
    monkeypatch.setattr(release, "call", lambda *_: "".join(printed))
    tried = release.CleanEnvironment(tmp_path / "a.whl", "[report]", tmp_path)
    with pytest.raises(release.ReleaseError, match=r"expected a figure run.figures.tracks\.png; there is none"):
        tried.first_figure("paper-a", compiles=False)
    (tried.folder / release.FIRST_FIGURE).parent.mkdir(parents=True)
    (tried.folder / release.FIRST_FIGURE).touch()
    assert "first figure of paper-a after" in tried.first_figure("paper-a", compiles=False)
    with pytest.raises(release.ReleaseError, match="expected kernels to be compiled"):
        tried.first_figure("paper-a", compiles=True)
    printed.append("compiling kernels for this machine: once")
    with pytest.raises(release.ReleaseError, match="expected kernels of the wheel"):
        tried.first_figure("paper-a", compiles=False)


def test_a_failed_step_of_a_release_shows_what_it_said(tmp_path: Path) -> None:
    release = load("tools/release.py")
    with pytest.raises(release.ReleaseError, match=r"(?s)no such thing.*exit status 3"):
        release.call([sys.executable, "-c", "print('no such thing'); raise SystemExit(3)"], tmp_path, os.environ)
