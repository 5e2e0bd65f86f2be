"""The spaces of observations."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

_FLAGS, _PROBABILITIES, _NOT_NEGATIVE = ("mask", "action_mask"), ("existence", "mode_probs"), ("time", "undetected")
_LARGEST = float(np.finfo(np.float32).max)  # Gymnasium's checks treat infinite bounds as missing


def space_of(shapes: Mapping[str, tuple[int, ...]]) -> spaces.Dict[NDArray[Any]]:
    """Return the space of observations with arrays of these shapes, by name."""
    return spaces.Dict({name: _array(name, shape) for name, shape in shapes.items()})


def _array(name: str, shape: tuple[int, ...]) -> spaces.Space[Any]:
    if name in _FLAGS:
        return spaces.MultiBinary(shape)
    low = 0.0 if name in (*_PROBABILITIES, *_NOT_NEGATIVE) else -_LARGEST
    high = 1.0 if name in _PROBABILITIES else _LARGEST
    return spaces.Box(low, high, shape, np.float32)
