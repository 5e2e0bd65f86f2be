"""Inspection of densities and estimates: their targets one by one, in words, and as columns."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from vedette.errors import InputError
from vedette.internal.text import pluralise
from vedette.kernels.base.types import CLIMB, HEIGHT, PLANE, VY, Floats, Ints

_MOST_SHOWN = 3
_LARGE = 1e7  # m, from which on a position is shown in powers of ten
_CORNERS, _FAINTEST = 73, 0.15
# Columns of the components of a state.
_COLUMNS = {"px": "x_m", "py": "y_m", "vx": "vx_mps", "vy": "vy_mps", HEIGHT: "z_m", CLIMB: "vz_mps"}


class Target(NamedTuple):
    """One possible target."""

    label: tuple[int, int] | None  # birth step and birth index; None in a density without labels
    existence: float  # existence probability
    mean: Floats  # (state_dim,) of its state, if it exists
    cov: Floats  # (state_dim, state_dim)
    mode_probs: Floats  # (up to num_modes,) of each mode of motion; empty without modes and without labels


class Hypothesis(NamedTuple):
    """One possible set of targets, each with its density."""

    weight: float  # its probability
    labels: tuple[tuple[int, int], ...]  # in increasing order
    tracks: Ints  # (num_targets,) for each label, the row of the density's track table
    measurements: tuple[int | None, ...] | None  # per label, row of the last scan, None if missed; None: not known


class Targets(NamedTuple):
    """Targets, or components of an intensity, one per row."""

    labels: Ints | None  # (num, 2)
    weights: Floats  # (num,) probability of existence, or expected number
    means: Floats  # (num, state_dim)
    covs: Floats  # (num, state_dim, state_dim)
    mode_probs: Floats | None = None  # (num, up to num_modes) of each mode of motion; None: no modes
    measurements: Ints | None = None  # (num,) likeliest measurement of the last scan, -1: missed; None: not known

    def each(self) -> Iterator[Target]:
        """Iterate over the targets."""
        labels = [None] * len(self.weights) if self.labels is None else map(tuple, self.labels.tolist())
        modes = np.empty((len(self.weights), 0)) if self.mode_probs is None else self.mode_probs
        return map(Target, labels, self.weights.tolist(), self.means, self.covs, modes)

    def in_words(self) -> str:
        """Return the likeliest few in words: label, probability (or expected number), position and its std."""
        first = np.argsort(-self.weights, kind="stable")[:_MOST_SHOWN]
        parts = []
        for target in self._at(first).each():
            with np.errstate(invalid="ignore"):
                stds = np.sqrt(np.diagonal(target.cov))
            name = "" if target.label is None else f"{target.label[0]}.{target.label[1]}: "
            parts.append(f"{name}{target.existence:.3g} at {_place(target.mean)} ± {_place(stds)} m")
        more = len(self.weights) - len(first)
        return "; ".join(parts + ([f"{more} more"] if more else []))

    def columns(self, weight: str) -> dict[str, list[Any]]:
        """Return the columns of `MultiTarget.to_table`."""
        names = {} if self.labels is None else {"label": [f"{step}.{index}" for step, index in self.labels.tolist()]}
        taken = {} if self.measurements is None else {"measurement": indices_or_none(self.measurements)}
        return {**names, weight: self.weights.tolist(), **taken, **state_columns(self.means, self.covs)}

    def draw(self, axes: Any) -> None:
        """Draw position ellipses of two standard deviations into axes of Matplotlib. Improbable targets are faint."""
        if self.means.shape[1] < 2:
            raise InputError(
                f"plot: expected states that begin with x and y; got {pluralise(self.means.shape[1], 'number')}"
            )
        turn = np.linspace(0.0, 2.0 * np.pi, _CORNERS)
        circle = np.array([np.cos(turn), np.sin(turn)])
        for target in self.each():
            widths, directions = np.linalg.eigh(target.cov[:2, :2])
            edge = target.mean[:2, None] + 2.0 * directions @ (np.sqrt(np.maximum(widths, 0.0))[:, None] * circle)
            shade = min(1.0, max(_FAINTEST, target.existence))
            (line,) = axes.plot(*edge, alpha=shade, linestyle="-")
            axes.plot(*target.mean[:2], marker="+", color=line.get_color(), alpha=shade)
            if target.label is not None:
                name = f"{target.label[0]}.{target.label[1]}"
                axes.annotate(name, target.mean[:2], (3, 3), textcoords="offset points", alpha=shade)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set(xlabel="x (m)", ylabel="y (m)")

    def _at(self, places: Ints) -> "Targets":
        labels = None if self.labels is None else self.labels[places]
        return Targets(labels, self.weights[places], self.means[places], self.covs[places])


def indices_or_none(measurements: Ints) -> list[int | None]:
    """Return the indices, with None in place of -1."""
    return [None if index < 0 else index for index in measurements.tolist()]


def state_columns(means: Floats, covs: Floats, components: Sequence[str] = ()) -> dict[str, list[float]]:
    """Return the columns `x_m`, `y_m`, `vx_mps`, `vy_mps`, `z_m`, `vz_mps` of states and their stds `std_...`.

    Args:
        means: (num, state_dim).
        covs: (num, state_dim, state_dim).
        components: of the motion. (): position and, with four components or more, velocity.
    """
    names = components or PLANE[: len(PLANE) if means.shape[1] > VY else 2]
    columns = {_COLUMNS[name]: j for j, name in enumerate(names) if name in _COLUMNS}
    with np.errstate(invalid="ignore"):
        stds = np.sqrt(np.diagonal(covs, axis1=1, axis2=2))
    return {f"{of}{name}": x[:, j].tolist() for of, x in (("", means), ("std_", stds)) for name, j in columns.items()}


def _place(state: Floats) -> str:
    parts = [f"{x:.1f}" if abs(x) < _LARGE else f"{x:.3g}" for x in state[:2].tolist()]
    return f"({', '.join(parts)})"
