"""Densities in files: NumPy's .npz, every bit of every array kept."""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from vedette.densities.glmb import GLMB
from vedette.densities.lmb import LMB
from vedette.densities.poisson import Poisson
from vedette.densities.tracks import TrackTable
from vedette.errors import InputError, VedetteError

FORMAT_NAME = "vedette-density"
FORMAT_VERSION = 1

_TRACK_FIELDS = ("labels", "offsets", "log_weights", "means", "covs")
_OWN_FIELDS: dict[str, tuple[str, ...]] = {
    "glmb": ("hyp_offsets", "hyp_tracks", "hyp_log_weights"),
    "lmb": ("existence_logit",),
    "poisson": ("log_weights", "means", "covs"),
}


def save_density(path: str | os.PathLike[str], density: GLMB | LMB | Poisson) -> None:
    """Write a density to `path`. The file appears whole or not at all; equal densities give equal bytes.

    Raises `InputError` for a path that cannot be written.
    """
    kinds = {GLMB: "glmb", LMB: "lmb", Poisson: "poisson"}
    if type(density) not in kinds:
        raise InputError(f"density: expected a GLMB, an LMB or a Poisson; got {type(density).__name__}")
    kind = kinds[type(density)]
    arrays: dict[str, Any] = {"format": FORMAT_NAME, "version": FORMAT_VERSION, "kind": kind}
    if not isinstance(density, Poisson):
        arrays |= {f"tracks.{name}": getattr(density.tracks, name) for name in _TRACK_FIELDS}
    arrays |= {name: getattr(density, name) for name in _OWN_FIELDS[kind]}
    target = Path(path)
    try:
        _write_whole(target, arrays)
    except OSError as fault:
        raise InputError(f"{target}: expected a file that can be written; {fault}") from fault


def _write_whole(target: Path, arrays: dict[str, Any]) -> None:
    handle, temporary = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, **arrays)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).replace(target)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise


def load_density(path: str | os.PathLike[str]) -> GLMB | LMB | Poisson:
    """Read a density that `save_density` wrote.

    Raises `InputError` for a file that is missing, damaged, of another origin or a later version, or that holds no
    valid density.
    """
    source = Path(path)
    try:
        # Opened here: np.load leaves a damaged archive open.
        with source.open("rb") as file, np.load(file, allow_pickle=False) as content:
            arrays = {name: content[name] for name in content.files}
    except Exception as fault:  # a damaged file can raise nearly anything in the readers of zip and npy
        raise InputError(f"{source}: expected a density file; {fault}") from fault
    kind = _kind_of(source, arrays)
    try:
        density = _build(kind, arrays)
        density.validate()
    except KeyError as fault:
        raise InputError(f"{source}: expected an array {fault.args[0]!r}; got none") from fault
    except VedetteError as fault:
        raise InputError(f"{source}: expected a valid density; {fault}") from fault
    return density


def _kind_of(source: Path, arrays: dict[str, Any]) -> str:
    if str(arrays.get("format")) != FORMAT_NAME:
        raise InputError(f"{source}: expected a file of format {FORMAT_NAME}; got one of another origin")
    if str(arrays.get("version")) != str(FORMAT_VERSION):
        raise InputError(f"{source}: expected format version {FORMAT_VERSION}; got {arrays.get('version')}")
    kind = str(arrays.get("kind"))
    if kind not in _OWN_FIELDS:
        raise InputError(f"{source}: expected a kind of density among {', '.join(_OWN_FIELDS)}; got {kind!r}")
    return kind


def _build(kind: str, arrays: dict[str, Any]) -> GLMB | LMB | Poisson:
    own = [arrays[name] for name in _OWN_FIELDS[kind]]
    if kind == "poisson":
        return Poisson(*own)
    tracks = TrackTable(*(arrays[f"tracks.{name}"] for name in _TRACK_FIELDS))
    return GLMB(tracks, *own) if kind == "glmb" else LMB(tracks, *own)


__all__ = ["FORMAT_NAME", "FORMAT_VERSION", "load_density", "save_density"]
