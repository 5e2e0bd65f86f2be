"""Association marginals of a user's own: the sum over all joint choices, one after the other."""

from __future__ import annotations

import math

import numpy as np

from vedette.filters import CustomMarginals
from vedette.kernels.base.types import Floats, Ints
from vedette.models import model_function


@model_function("association_marginals")
def enumerated(offsets: Ints, columns: Ints, log_weights: Floats, params: Floats, out: Floats) -> float:
    num_rows, total = len(offsets) - 1, 0.0
    choice = offsets[:num_rows].copy()
    out[:] = 0.0
    while True:
        weight, possible = 1.0, True
        for i in range(num_rows):
            weight *= math.exp(log_weights[choice[i]])
            for k in range(i):
                if columns[choice[i]] >= 0 and columns[choice[i]] == columns[choice[k]]:
                    possible = False
        if possible:
            total += weight
            for i in range(num_rows):
                out[choice[i]] += weight
        row = num_rows - 1
        while row >= 0 and choice[row] == offsets[row + 1] - 1:
            choice[row] = offsets[row]
            row -= 1
        if row < 0:
            break
        choice[row] += 1
    for option in range(len(out)):
        out[option] = math.log(out[option] / total) if out[option] > 0.0 else -math.inf
    return math.log(total)


exact = CustomMarginals(enumerated)
no_marginals = np.zeros(3)
