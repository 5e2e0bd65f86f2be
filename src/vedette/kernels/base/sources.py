"""Sources of a compiled kernel: its file and every module of kernels or models that this reaches by imports.

Numba stamps cache entries only with the source file of the function itself, and so misses edits in imported files.
"""

import hashlib
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

PACKAGE_ROOT = Path(__file__).parents[2].resolve()


@cache
def kernel_files() -> tuple[Path, ...]:
    """Return the files of all kernel modules."""
    return tuple((PACKAGE_ROOT / "kernels").rglob("*.py"))


@cache
def _modules() -> dict[str, Path]:
    """Return the files of all modules with compiled functions, by their import names."""
    files = (*kernel_files(), *(PACKAGE_ROOT / "models").rglob("*.py"))
    return {".".join(("vedette", *file.relative_to(PACKAGE_ROOT).with_suffix("").parts)): file for file in files}


# Found by a pattern, as parsing all kernels took longer than the rest of a start.
_IMPORT = re.compile(r"^[ \t]*from (vedette\.(?:kernels|models)[\w.]*) import (\([^)]*\)|.*)$", re.MULTILINE)


@cache
def _content(path: Path) -> bytes:
    return path.read_bytes()


@cache
def package_file(name: str) -> Path | None:
    """Return the file of this package that a code object names, or None for one from elsewhere."""
    path = Path(name).resolve()
    return path if path.is_relative_to(PACKAGE_ROOT) else None


def note_source(function: Callable[..., Any]) -> None:
    """Read the file of a kernel at import, as it may be edited before it is compiled."""
    path = package_file(function.__code__.co_filename)
    if path is not None:
        _content(path)


@cache
def _kernel_imports(path: Path) -> frozenset[Path]:
    """Return the modules of kernels and models that a file imports. Extra ones would be harmless."""
    found: set[Path] = set()
    for module, names in _IMPORT.findall(_content(path).decode()):
        named = (module, *(f"{module}.{name}" for name in re.findall(r"\w+", names)))
        found.update(_modules()[name] for name in named if name in _modules())
    return frozenset(found)


# They affect the code of every function, also in modules that import no kernel.
_ALL = frozenset(PACKAGE_ROOT / "kernels/base" / name for name in ("compile.py", "dispatchers.py", "libraries.py"))

# They affect caching and calls, not the compiled code.
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
    """Return the file and every module that it reaches by imports and that affects the compiled code."""
    pending = [path, *_ALL]
    found = set(pending)
    while pending:
        new = _kernel_imports(pending.pop()) - found - _APART
        found |= new
        pending.extend(new)
    return frozenset(found)


@cache
def source_stamp(path: Path) -> str:
    """Return a digest of the files of `source_closure`."""
    digest = hashlib.sha256()
    for file in sorted(source_closure(path)):
        digest.update(_content(file))
    return digest.hexdigest()
