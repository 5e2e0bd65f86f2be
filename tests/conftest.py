"""Settings that hold for every test."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import matplotlib
import pytest
from hypothesis import HealthCheck, settings

from empty_figures import print_nothing, print_svg
from reports.browser import Browser, chromium

matplotlib.use("Agg")

# The same examples every time: a failure is the change's doing, never the dice's. No deadline: a first call compiles.
settings.register_profile(
    "vedette", derandomize=True, deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("vedette")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A browser, for tests that are left out where there is none."""
    program = chromium()
    assert program is not None
    with Browser(program) as running:
        yield running


@pytest.fixture
def quick_figures() -> Iterator[None]:
    """Write files of figures without their contents, for tests of commands whose figures other tests draw."""
    with pytest.MonkeyPatch.context() as patch:
        print_nothing(patch)
        yield


@pytest.fixture
def svg_figures() -> Iterator[None]:
    """Draw figures as SVG alone, for tests of what is drawn: the other formats take most of the time, and draw that."""
    with pytest.MonkeyPatch.context() as patch:
        print_svg(patch)
        yield


def pytest_addoption(parser: pytest.Parser) -> None:
    """How long the fuzzers of `tests/fuzz` go on, and from where, and how many faults `tests/cli` injects."""
    group = parser.getgroup("fuzz")
    group.addoption("--fuzz-seconds", type=float, help="seconds for each fuzzer (default: a fixed number of cases)")
    group.addoption("--fuzz-seed", type=int, default=0, help="seed of the cases (default: 0)")
    group.addoption("--fuzz-case", type=int, help="try only the case of this number")
    group.addoption("--fault-rounds", type=int, default=2, help="rounds of injected faults for each command")


def pytest_sessionfinish() -> None:
    """Give back what commands have frozen in this process, as some libraries complain of what is left of them."""
    gc.unfreeze()
