"""Of what sources a kernel is compiled: the file it stands in and every kernel module that this one reaches by imports.

Numba stamps what it keeps with the source file of the function itself and so misses an edit in a file it imports.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

PACKAGE_ROOT = Path(__file__).parents[2].resolve()


@cache
def _modules() -> dict[str, Path]:
    """The files of all kernel modules, by the names that imports give them."""
    files = (PACKAGE_ROOT / "kernels").rglob("*.py")
    return {".".join(("vedette", *file.relative_to(PACKAGE_ROOT).with_suffix("").parts)): file for file in files}


# Found by a pattern: to parse all kernels took longer than all else that a start does.
_IMPORT = re.compile(r"^[ \t]*from (vedette\.kernels[\w.]*) import (\([^)]*\)|.*)$", re.MULTILINE)


@cache
def _content(path: Path) -> bytes:
    return path.read_bytes()


@cache
def package_file(name: str) -> Path | None:
    """The file of this package that a code object names; None for one from elsewhere."""
    path = Path(name).resolve()
    return path if path.is_relative_to(PACKAGE_ROOT) else None


def note_source(function: Callable[..., Any]) -> None:
    """Read the file of a kernel when it is imported: it may be edited before anything is compiled."""
    path = package_file(function.__code__.co_filename)
    if path is not None:
        _content(path)


@cache
def _kernel_imports(path: Path) -> frozenset[Path]:
    """Kernel modules that a file names in its imports; one too many would do no harm."""
    found: set[Path] = set()
    for module, names in _IMPORT.findall(_content(path).decode()):
        named = (module, *(f"{module}.{name}" for name in re.findall(r"\w+", names)))
        found.update(_modules()[name] for name in named if name in _modules())
    return frozenset(found)


# They decide what becomes of every function, also of those that import no kernel.
_ALL = frozenset(PACKAGE_ROOT / "kernels/base" / name for name in ("compile.py", "dispatchers.py", "libraries.py"))

# They decide how code is kept and called, not what is compiled.
_APART = frozenset(
    PACKAGE_ROOT / "kernels/base" / name
    for name in (
        "bundle_types.py",
        "disk_cache.py",
        "interrupts.py",
        "cache_paths.py",
        "private_files.py",
        "sources.py",
        "compile_progress.py",
    )
)


@cache
def source_closure(path: Path) -> frozenset[Path]:
    """The file and every kernel module that it reaches by imports, as far as they decide what is compiled."""
    pending = [path, *_ALL]
    found = set(pending)
    while pending:
        new = _kernel_imports(pending.pop()) - found - _APART
        found |= new
        pending.extend(new)
    return frozenset(found)


@cache
def source_stamp(path: Path) -> str:
    """A digest of all that `source_closure` names."""
    digest = hashlib.sha256()
    for file in sorted(source_closure(path)):
        digest.update(_content(file))
    return digest.hexdigest()


def kernel_files() -> tuple[Path, ...]:
    """All kernel modules."""
    return tuple(_modules().values())
