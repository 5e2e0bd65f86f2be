"""The example in docs/control.md runs as it stands."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

PAGE = Path(__file__).resolve().parents[2] / "docs" / "control.md"


def test_the_page_on_control_runs() -> None:
    names: dict[str, Any] = {"__name__": "example"}
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL):
        exec(compile(block, str(PAGE), "exec"), names)
    names["plan"].validate()
    assert names["table"].mean.shape == (13, 5)
    assert 0 < np.isfinite(names["partial"].mean).sum() < names["partial"].mean.size
