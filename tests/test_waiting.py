"""No test depends on how busy the machine is."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from waiting import PATIENCE

TESTS = Path(__file__).resolve().parent
SHORT = re.compile(r"(?:timeout\s*=\s*|\.wait\(|\.join\()(\d[\d.]*)")
TIMED = re.compile(r"assert\b.*(?:monotonic|perf_counter|process_time)\(|assert (?:seconds|elapsed)\b")


def hurried(text: str) -> list[str]:
    """Lines that give a process less than half of `PATIENCE`, or assert how long something took."""
    lines = text.splitlines()
    short = [line for line in lines if any(float(found) < 0.5 * PATIENCE for found in SHORT.findall(line))]
    return [line.strip() for line in short if "assert not" not in line] + [line for line in lines if TIMED.search(line)]


@pytest.mark.parametrize(
    "line", ["process.communicate(timeout=60)", "process.wait(10.0)", "assert time.monotonic() - start < 30.0"]
)
def test_a_test_in_a_hurry_is_found(line: str) -> None:
    assert hurried(line)


def test_no_test_is_in_a_hurry() -> None:
    files = [path for path in TESTS.rglob("*.py") if path.name not in ("test_waiting.py", "waiting.py")]
    assert len(files) > 50
    assert {path.name: found for path in files if (found := hurried(path.read_text("utf-8")))} == {}
