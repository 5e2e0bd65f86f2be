"""The order in which a whole takes in the parts that it reaches."""

from __future__ import annotations

from typing import Any

import numpy as np

from vedette.kernels.base.libraries import PartLibrary, _all_of


class Part(PartLibrary):
    """A library that calls others, without code."""

    def __init__(self, called: list[Any]) -> None:
        self._linking_libraries = called


def test_each_part_comes_once_and_after_all_that_call_it() -> None:
    """What nothing asks for when it is taken in is left out by LLVM, and missing for what calls it later."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        parts: list[Part] = []
        for _ in range(12):
            parts.append(Part([parts[i] for i in rng.permutation(len(parts))[:3]]))
        roots = [parts[i] for i in rng.permutation(12)[:4]]
        found = _all_of(roots)
        assert len(set(found)) == len(found)
        assert set(roots) <= set(found)
        for part in found:
            assert all(found.index(part) < found.index(called) for called in part.called)
