"""A built-in scenario that takes about a second."""

from __future__ import annotations

from vedette.scenarios import list_builtin


def short_paper_e() -> str:
    """Return the text of paper-e with ten scans and one decision of two samples."""
    text = list_builtin()["paper-e"].read_text(encoding="utf-8")
    for old, new in (
        ("num_steps: 40", "num_steps: 10"),
        ("decision_steps: [10, 20, 30]", "decision_steps: [8]"),
        ("num_samples: 40", "num_samples: 2"),
        ("first_scan: 11, last_scan: 40", "first_scan: 9, last_scan: 10"),
    ):
        text = text.replace(old, new)
    return text
