"""The page of signatures has every model function and every protocol, as the source has them."""

from __future__ import annotations

import re

import pytest

from scripts import ROOT, load
from vedette.control import Constraint, PowerReward
from vedette.kernels.base.compile import SIGNATURES

PAGE = (ROOT / "docs" / "signatures.md").read_text("utf-8")
SEAMS = (ROOT / "docs" / "architecture.md").read_text("utf-8")


@pytest.fixture(scope="module")
def filled() -> str:
    text: str = load("tools/docs_signatures.py").fill(PAGE)
    return text


def test_every_model_function_has_a_row_with_its_arguments(filled: str) -> None:
    for kind, (arguments, _) in SIGNATURES.items():
        row = next(line for line in filled.splitlines() if line.startswith(f"| `{kind}` |"))
        assert f"| `{', '.join(arguments)}` |" in row
        explained = {argument.removeprefix("new_") for argument in arguments} - {"out"}
        assert all(f"`{argument}`" in PAGE for argument in explained)


def test_a_kind_without_a_row_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    tool = load("tools/docs_signatures.py")
    monkeypatch.delitem(tool.TAKEN_BY, "transition")
    with pytest.raises(ValueError, match="expected the kinds"):
        tool.model_functions()


def test_every_protocol_of_the_architecture_is_there(filled: str) -> None:
    table = SEAMS.partition("## Protocols")[2].partition("\n## ")[0]
    named = set(re.findall(r"`(?:\w+)\.([A-Z]\w+)`", table)) - {"CustomMarginals"}
    assert len(named) > 20
    assert {name for name in named if f"class {name}(Protocol):" not in filled} == set()


def test_members_are_those_of_the_source() -> None:
    tool = load("tools/docs_signatures.py")
    assert tool.members(PowerReward) == [
        "exponents: Exponents",
        "def combine(self, z: Floats) -> Floats: ...",
    ]
    assert tool.members(Constraint)[0].startswith("name: str")
