"""Density files in NumPy's .npz format, with every array stored exactly."""

import os
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from vedette.densities.factored import FactoredGLMB
from vedette.densities.glmb import GLMB
from vedette.densities.labelled import LMB, LabelledDensity
from vedette.densities.multi_bernoulli import MultiBernoulli
from vedette.densities.tracks import TrackTable
from vedette.densities.undetected import LearntRate, UndetectedIntensity, UndetectedTargets
from vedette.densities.unlabelled import IidCluster, Poisson
from vedette.errors import InputError, VedetteError
from vedette.internal.files import write_file
from vedette.internal.reading import error_summary, read_arrays, read_file, unreadable
from vedette.internal.text import shown
from vedette.models import CellGrid, Region

FORMAT_NAME = "vedette-density"
FORMAT_VERSION = 1

Density: TypeAlias = LabelledDensity | Poisson | IidCluster | MultiBernoulli
_KINDS: dict[str, type[Density]] = {
    "glmb": GLMB,
    "lmb": LMB,
    "factored_glmb": FactoredGLMB,
    "poisson": Poisson,
    "iid_cluster": IidCluster,
    "multi_bernoulli": MultiBernoulli,
}
_UNDETECTED = "undetected"


def save_density(path: str | os.PathLike[str], density: Density) -> None:
    """Write a density to `path`. The file appears whole or not at all. Equal densities give equal bytes.

    Raises `InputError` for a path that cannot be written.
    """
    kind = next((name for name, container in _KINDS.items() if type(density) is container), None)
    if kind is None:
        raise InputError(f"density: expected a multi-target density; got {type(density).__name__}")
    arrays: dict[str, Any] = {"format": FORMAT_NAME, "version": FORMAT_VERSION, "kind": kind}
    arrays |= _arrays(density)
    write_file(Path(path), lambda file: np.savez(file, **arrays))


def load_density(path: str | os.PathLike[str]) -> Density:
    """Read a density that `save_density` wrote.

    Raises `InputError` for a file that is missing, damaged, of another origin or a later version, or without a valid
    density. Compressed arrays are refused, so that the content of a file is never larger than the file.
    """
    source = Path(path)
    try:
        arrays = read_arrays(read_file(source))
    except OSError as fault:
        raise unreadable(source, "a density file", fault) from fault
    except ValueError as fault:
        raise InputError(f"{source}: expected a density file; it is damaged or another: {fault}") from fault
    kind = _kind_of(source, arrays)
    try:
        return _KINDS[kind](**_fields(_KINDS[kind], arrays))  # which validates
    except KeyError as fault:
        raise InputError(f"{source}: expected an array {fault.args[0]!r}; got none") from fault
    except VedetteError as fault:
        raise InputError(f"{source}: expected a valid density; {fault}") from fault


def _kind_of(source: Path, arrays: Mapping[str, Any]) -> str:
    if str(arrays.get("format")) != FORMAT_NAME:
        raise InputError(f"{source}: expected a file of format {FORMAT_NAME}; got one of another origin")
    if str(arrays.get("version")) != str(FORMAT_VERSION):
        raise InputError(
            f"{source}: expected format version {FORMAT_VERSION}; got {error_summary(arrays.get('version'))}"
        )
    kind = str(arrays.get("kind"))
    if kind not in _KINDS:
        raise InputError(f"{source}: expected a kind of density among {', '.join(_KINDS)}; got {shown(kind)}")
    return kind


def _arrays(container: Any, prefix: str = "") -> dict[str, Any]:
    """Return the arrays of a container by their names in a file, without sources that there are not."""
    arrays: dict[str, Any] = {}
    for field in fields(container):
        name, value = f"{prefix}{field.name}", getattr(container, field.name)
        if field.name == "tracks":
            arrays |= _arrays(value, "tracks.")
        elif isinstance(value, UndetectedTargets):
            arrays |= _arrays_of_undetected(value)
        elif value is not None:
            arrays[name] = value
    return arrays


def _fields(container: type[Any], arrays: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return the fields of a container by name, from the arrays of a file."""
    own: dict[str, Any] = {}
    for name in (field.name for field in fields(container)):
        if name == "tracks":
            own[name] = TrackTable(**_fields(TrackTable, arrays, "tracks."))
        elif name == "undetected":
            own[name] = _undetected_of(arrays) if f"{_UNDETECTED}.next_label" in arrays else None
        else:
            own[name] = arrays.get(f"{prefix}{name}") if name == "sources" else arrays[f"{prefix}{name}"]
    return own


def _arrays_of_undetected(undetected: UndetectedTargets) -> dict[str, Any]:
    parts = _arrays(undetected.intensity)
    parts["next_label"] = np.array(undetected.next_label)
    if undetected.cells is not None:
        grid = undetected.cells.grid
        parts |= {"expected": undetected.cells.expected, "region": grid.region.bounds}
        parts["cells"] = np.array([grid.columns, grid.rows])
    if (learnt := undetected.birth_rate) is not None:
        parts |= {f"birth_rate.{field.name}": getattr(learnt, field.name) for field in fields(LearntRate)}
    return {f"{_UNDETECTED}.{name}": part for name, part in parts.items()}


def _undetected_of(arrays: Mapping[str, Any]) -> UndetectedTargets:
    own = {name.removeprefix(f"{_UNDETECTED}."): part for name, part in arrays.items() if _UNDETECTED in name}
    cells = learnt = None
    if "birth_rate.rate" in own:
        numbers = [own[f"birth_rate.{field.name}"] for field in fields(LearntRate)]
        learnt = LearntRate(*(part.item() if part.ndim == 0 else part for part in numbers))
    if "cells" in own:
        x_min, x_max, y_min, y_max = own["region"].tolist()
        grid = CellGrid(Region(x_min, x_max, y_min, y_max), *own["cells"].tolist())
        cells = UndetectedIntensity(grid, own["expected"])
    step, index = own["next_label"].tolist()
    return UndetectedTargets(Poisson(**_fields(Poisson, own)), (step, index), cells, learnt)
