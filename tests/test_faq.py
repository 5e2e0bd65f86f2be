"""The commands of the page of questions, run in its order as a reader of a clone would."""

from __future__ import annotations

import contextlib
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scripts import ROOT
from vedette.cli import app
from vedette.scenarios import json_schema
from waiting import PATIENCE

PAGE = (ROOT / "docs" / "faq.md").read_text("utf-8")
COMMANDS = re.findall(r"^vedette .*$", PAGE, re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where all commands were run: the first one as a program, and the others in this process."""
    place = tmp_path_factory.mktemp("clone")
    shutil.copytree(ROOT / "examples", place / "examples")
    first, *others = (command.split()[1:] for command in COMMANDS)
    program = [str(Path(sys.executable).with_name("vedette")), *first]
    done = subprocess.run(program, cwd=place, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    with contextlib.chdir(place):
        for words in others:
            result = CliRunner().invoke(app, words)
            assert result.exit_code == 0, " ".join(words) + "\n" + result.output
    return place


def test_the_commands_do_what_the_answers_say(folder: Path) -> None:
    assert len(COMMANDS) == 7
    assert list((folder / "tracked" / "tracks").glob("*.csv"))
    assert list(folder.rglob("my-run/**/*.html"))


def test_there_are_twenty_questions_and_their_defaults_are_so() -> None:
    assert len(re.findall(r"^\*\*[^*]+[.?]\*\*", PAGE, re.MULTILINE)) >= 20
    defaults = {name: field.get("default") for name, field in json_schema()["properties"].items()}
    assert defaults["filter"]["kind"] == "factored_glmb"
    assert defaults["fusion"]["kind"] == "sequential"
