"""Compiled kernels and model functions on disk, safe for any number of processes at once.

Numba stamps a cache entry with the source file of the function itself and so misses an edit in a file it imports; the
stamp used here covers the file and every `vedette.kernels` module it reaches. An entry is a pickle, so it is read only
where nobody else can have written it, see `vedette.kernels.base.private_files`.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import os
import pickle
import uuid
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numba
from numba.core import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.serialize import dumps

from vedette.kernels.base.private_files import fault_of_folder, make_private_folder, read_private, write_private

_PACKAGE_ROOT = Path(__file__).resolve().parents[2]
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
        make_private_folder(Path(self.get_cache_path()))

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
        locator.ensure_cache_path()
        return locator


class _EntryFile:
    """The entries of one function, each in a file of its own that is named by its key.

    Numba's own keeps an index of numbered files: of two processes that compile at once, one entry is lost or comes to
    stand under the other's key. Here every file is whole and says what it is; the last of equal writers wins.
    """

    def __init__(self, folder: Path, filename_base: str, source_stamp: str, source: Path) -> None:
        self._folder = folder
        self._source = source
        self._base = filename_base
        self._stamp = source_stamp

    def save(self, key: Any, data: Any) -> None:
        """Keep an entry. A disk that is full or not ours to write leaves it compiled in memory alone."""
        content = dumps(data)
        path = self._path(key)
        partial = path.with_name(f"{path.name}.{uuid.uuid4().hex[:16]}")
        with contextlib.suppress(OSError):
            try:
                write_private(partial, self._mark(key, content) + content)
                partial.replace(path)
            finally:
                partial.unlink(missing_ok=True)

    def load(self, key: Any) -> Any:
        """The entry; None where there is none, one of other sources, a damaged one, or one that others can write."""
        held = read_private(self._path(key), self._source)
        if held is None:
            return None
        content = held[_MARK_LENGTH:]
        if held[:_MARK_LENGTH] != self._mark(key, content):
            return None
        try:
            return pickle.loads(content)
        except ImportError:  # compiled when its file was a module of another name
            return None

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
        self.folder = Path(self._cache_path).resolve()
        self.source = Path(function.__code__.co_filename).resolve()
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = _EntryFile(self.folder, self._impl.filename_base, stamp, self.source)


def attach_cache(dispatcher: Any) -> None:
    """Cache on disk where that is possible and safe; elsewhere a function is compiled each time, in memory.

    A function typed at a prompt has no file. Warns once of a folder that others can write.
    """
    try:
        found = _Cache(dispatcher.py_func)
        fault = fault_of_folder(found.folder, found.source)
    except (RuntimeError, OSError):
        return
    if fault is None:
        dispatcher._cache = found
    else:
        _warn_of(fault)


@cache  # once a process, not once a function
def _warn_of(fault: str) -> None:
    warnings.warn(
        f"compiled kernels on disk are not used: {fault}, and they are code; all are compiled anew, for minutes. "
        "Make the folder your own (chown, chmod go-w), or set VEDETTE_CACHE_DIR to one that is",
        RuntimeWarning,
        stacklevel=2,
    )


def is_cold() -> bool:
    """Whether the kernels of this checkout will now be compiled, and kept (model functions do not count)."""
    folder = _checkout_directory()
    if config.DISABLE_JIT or any(folder.glob("kernels_*/*.nbc")):
        return False
    return not folder.is_dir() or fault_of_folder(folder.resolve(), Path(__file__).resolve()) is None
