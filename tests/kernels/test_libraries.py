"""A whole takes in all the parts that it reaches, in whatever order it meets them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette.kernels.base import libraries
from vedette.kernels.base.compile import JIT_ENABLED, kernel


def _chain() -> Any:
    inner = kernel(lambda values: values[0] + 1.0)
    middle = kernel(lambda values: inner(values) * 2.0)
    return kernel(lambda values: middle(values) + 3.0)


@pytest.mark.skipif(not JIT_ENABLED, reason="nothing is linked")
@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_part_that_comes_before_its_caller_is_linked(order: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """LLVM leaves out what nothing asks for at its turn, though something that comes later does."""
    found = libraries._all_of

    def reordered(given: list[Any]) -> list[Any]:
        parts: list[Any] = []
        others: list[Any] = []
        for library in found(given):
            (parts if isinstance(library, libraries.PartLibrary) else others).append(library)
        return [*(parts[i] for i in order if i < len(parts)), *parts[len(order) :], *others]

    monkeypatch.setattr(libraries, "_all_of", reordered)
    assert _chain()(np.array([4.0])) == 13.0
