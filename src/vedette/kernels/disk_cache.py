"""Compiled kernels and model functions on disk, safe for any number of processes at once.

Numba stamps a cache entry with the source file of the function itself and so misses an edit in a file it imports; the
stamp used here covers the file and every `vedette.kernels` module it reaches.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import os
import pickle
import uuid
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numba
from numba.core import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.serialize import dumps

_PACKAGE_ROOT = Path(__file__).resolve().parents[1]
_MARK_LENGTH = hashlib.sha256().digest_size


def cache_directory() -> Path:
    """Directory of the compiled kernels: `$VEDETTE_CACHE_DIR`, or `vedette` in the user's cache directory."""
    override = os.environ.get("VEDETTE_CACHE_DIR")
    if override:
        return Path(override)
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".cache"
    return Path(base) / "vedette"


def _checkout_directory() -> Path:
    # Two checkouts (or versions) side by side must not overwrite each other's entries.
    return cache_directory() / hashlib.sha256(str(_PACKAGE_ROOT).encode()).hexdigest()[:12]


def _kernel_imports(source: str) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("vedette.kernels"):
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return names


@cache
def _source_closure(path: Path) -> frozenset[Path]:
    """The file and every kernel module that it reaches by imports."""
    found, pending = {path}, [path]
    while pending:
        for name in _kernel_imports(pending.pop().read_text(encoding="utf-8")):
            candidate = _PACKAGE_ROOT.joinpath(*name.split(".")[1:]).with_suffix(".py")
            if candidate.is_file() and candidate not in found:
                found.add(candidate)
                pending.append(candidate)
    return frozenset(found)


@cache
def _source_stamp(path: Path) -> str:
    digest = hashlib.sha256(f"{numba.__version__} {bool(config.BOUNDSCHECK)}".encode())
    for file in sorted(_source_closure(path)):
        digest.update(file.read_bytes())
    return digest.hexdigest()


class _PackageLocator:
    """Numba cache locator for functions defined inside this package (the protocol of `numba.core.caching`)."""

    def __init__(self, function: Callable[..., Any], path: Path) -> None:
        self._path = path
        self._py_file = str(path)  # Numba's warnings about code that cannot be cached name it
        self._line = function.__code__.co_firstlineno

    def ensure_cache_path(self) -> None:
        Path(self.get_cache_path()).mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        relative = self._path.relative_to(_PACKAGE_ROOT).with_suffix("")
        return str(_checkout_directory() / "_".join(relative.parts))

    def get_source_stamp(self) -> str:
        return _source_stamp(self._path)

    def get_disambiguator(self) -> str:
        return str(self._line)

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> _PackageLocator | None:
        path = Path(file).resolve()
        if not path.is_relative_to(_PACKAGE_ROOT):
            return None
        locator = cls(function, path)
        try:
            locator.ensure_cache_path()
        except OSError:
            return None
        return locator


class _EntryFile:
    """The entries of one function, each in a file of its own that is named by its key.

    Numba's own keeps an index of numbered files: of two processes that compile at once, one entry is lost or comes to
    stand under the other's key. Here every file is whole and says what it is; the last of equal writers wins.
    """

    def __init__(self, folder: str, filename_base: str, source_stamp: str) -> None:
        self._folder = Path(folder)
        self._base = filename_base
        self._stamp = source_stamp

    def save(self, key: Any, data: Any) -> None:
        """Keep an entry. A disk that is full or not ours to write leaves it compiled in memory alone."""
        content = dumps(data)
        path = self._path(key)
        partial = path.with_name(f"{path.name}.{uuid.uuid4().hex[:16]}")
        with contextlib.suppress(OSError):
            try:
                partial.write_bytes(self._mark(key, content) + content)
                partial.replace(path)
            finally:
                partial.unlink(missing_ok=True)

    def load(self, key: Any) -> Any:
        """The entry; None where there is none, or only one of other sources, or the file is damaged."""
        try:
            held = self._path(key).read_bytes()
        except OSError:
            return None
        content = held[_MARK_LENGTH:]
        return pickle.loads(content) if held[:_MARK_LENGTH] == self._mark(key, content) else None

    def flush(self) -> None:
        for path in self._folder.glob(f"{self._base}.*.nbc"):
            path.unlink(missing_ok=True)

    def _mark(self, key: Any, content: bytes) -> bytes:
        return hashlib.sha256(f"{self._stamp} {key!r} ".encode() + content).digest()

    def _path(self, key: Any) -> Path:
        digest = hashlib.sha256(repr(key).encode()).hexdigest()[:16]
        return self._folder / f"{self._base}.{digest}.nbc"


class _CacheImpl(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes: ClassVar[list[Any]] = [_PackageLocator, *CompileResultCacheImpl._locator_classes]


class _Cache(FunctionCache):  # type: ignore[misc]
    _impl_class = _CacheImpl

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = _EntryFile(self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp())


def attach_cache(dispatcher: Any) -> None:
    """Cache on disk where that is possible; a function typed at a prompt has no file and is compiled each time."""
    try:
        dispatcher._cache = _Cache(dispatcher.py_func)
    except (RuntimeError, OSError):
        return


def is_cold() -> bool:
    """Whether no kernel of this checkout has been compiled on this machine yet (model functions do not count)."""
    return not config.DISABLE_JIT and not any(_checkout_directory().glob("kernels_*/*.nbc"))
