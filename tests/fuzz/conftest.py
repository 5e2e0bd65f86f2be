"""How fuzzers are run: a fixed number of cases in the check, as many as a budget of seconds allows when asked for."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable, Iterator

import numpy as np
import pytest

MOST_FAULTS = 20  # different ones; a fuzzer that has found so many has told enough


def _numbers(config: pytest.Config, short: int) -> Iterator[int]:
    """Numbers of the cases to try."""
    only, seconds = config.getoption("--fuzz-case"), config.getoption("--fuzz-seconds")
    if only is not None:
        yield only
        return
    end = time.monotonic() + (seconds or 0.0)
    number = 0
    while time.monotonic() < end if seconds else number < short:
        yield number
        number += 1


def _place(fault: BaseException) -> tuple[str, str]:
    """What makes two faults the same: the kind, and where it was raised; of the first in a chain."""
    while fault.__cause__ is not None:
        fault = fault.__cause__
    frame = traceback.extract_tb(fault.__traceback__)[-1]
    return type(fault).__name__, f"{frame.filename}:{frame.lineno}"


@pytest.fixture
def try_cases(request: pytest.FixtureRequest) -> Callable[[Callable[[np.random.Generator], object], int], None]:
    """`try_cases(check, short)` calls `check(rng)` for every case, `short` of them unless a budget is given.

    A case is fixed by the seed and its number. One that raises is a fault: every different one is kept and told at the
    end, with the options that repeat it.
    """
    seed = request.config.getoption("--fuzz-seed")

    def run(check: Callable[[np.random.Generator], object], short: int) -> None:
        faults: dict[tuple[str, str], Exception] = {}
        tried = 0
        for number in _numbers(request.config, short):
            tried += 1
            try:
                check(np.random.default_rng([seed, number]))
            except Exception as fault:
                fault.add_note(f"repeat with --fuzz-seed {seed} --fuzz-case {number}")
                if faults.setdefault(_place(fault), fault) is fault:
                    traceback.print_exception(fault, file=sys.stdout)  # at once: a long run may be stopped
                if len(faults) == MOST_FAULTS:
                    break
        print(f"\n{request.node.name}: {tried} cases, {len(faults)} different faults")
        if faults:
            raise ExceptionGroup(f"{request.node.name}: {tried} cases", list(faults.values()))

    return run
