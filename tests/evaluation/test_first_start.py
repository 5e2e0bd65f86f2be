"""The first start, of scenarios of every kind: whatever cannot be compiled ahead is not spoken of."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from vedette.campaigns import load_spec, resolve
from vedette.evaluation import precompile as precompiling
from vedette.evaluation.precompile import precompile
from vedette.scenarios import load_scenario


def test_a_scenario_without_birth_sites_is_compiled_without_a_message(capfd: pytest.CaptureFixture[str]) -> None:
    scenario = load_scenario("shore-radar")  # what `vedette init` writes; its births come from measurements
    assert scenario.model.birth.sites == ()
    precompile(scenario)
    assert capfd.readouterr() == ("", "")


def test_the_joint_planners_of_a_campaign_are_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    done = list[str]()
    monkeypatch.setattr(precompiling, "_compile_planning", lambda _, name: done.append(name))
    monkeypatch.setattr(precompiling, "end_with_parent", lambda: None)
    monkeypatch.setattr(precompiling, "_compile_tracker", lambda _: done.append("tracker"))
    monkeypatch.setattr(precompiling, "get_context", lambda _: SimpleNamespace(Process=Here))
    campaign = resolve(load_spec("paper-a"))
    precompile(campaign.cells[0].scenario, [cell.planner for cell in campaign.cells])
    assert done == ["jdm", "tracker", "expected_loss"]
    done.clear()
    precompile(load_scenario("paper-a"), ["random", "nearest"])
    assert done == ["jdm", "tracker"]


class Here:
    """A process that runs in this one."""

    def __init__(self, target: Callable[..., None], args: tuple[Any, ...], daemon: bool) -> None:
        self._call = lambda: target(*args)

    def start(self) -> None:
        self._call()

    def join(self) -> None:
        pass
