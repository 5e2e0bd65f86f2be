"""Oracles: plain NumPy, by brute force, sharing nothing with the library. Small problems only.

Plain data throughout: a label is a tuple (birth step, site); a mixture is a list of (weight, mean, cov) with weights
that sum to one; a GLMB is a list of (weight, {label: mixture}); an LMB is a dict {label: (existence, mixture)}.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Label: TypeAlias = tuple[int, int]
Mixture: TypeAlias = list[tuple[float, Floats, Floats]]
Glmb: TypeAlias = list[tuple[float, dict[Label, Mixture]]]
Lmb: TypeAlias = dict[Label, tuple[float, Mixture]]
