"""Compiled kernels and model functions on disk, safe for any number of processes at once.

Numba stamps a cache entry with the source file of the function itself and so misses an edit in a file it imports; the
stamp used here covers the file and every `vedette.kernels` module it reaches. An entry is a pickle, so it is read only
where nobody else can have written it, see `vedette.kernels.base.private_files`.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import re
import uuid
import warnings
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from typing import Any, ClassVar

import numba
from numba.core import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache, NullCache
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


@cache
def _modules() -> dict[str, Path]:
    """The files of all kernel modules, by the names that imports give them."""
    files = (_PACKAGE_ROOT / "kernels").rglob("*.py")
    return {".".join(("vedette", *file.relative_to(_PACKAGE_ROOT).with_suffix("").parts)): file for file in files}


# Found by a pattern: to parse all kernels took longer than all else that a start does.
_IMPORT = re.compile(r"^[ \t]*from (vedette\.kernels[\w.]*) import (\([^)]*\)|.*)$", re.MULTILINE)


@cache
def _content(path: Path) -> bytes:
    return path.read_bytes()


@cache
def _kernel_imports(path: Path) -> frozenset[Path]:
    """Kernel modules that a file names in its imports; one too many would do no harm."""
    found: set[Path] = set()
    for module, names in _IMPORT.findall(_content(path).decode()):
        named = (module, *(f"{module}.{name}" for name in re.findall(r"\w+", names)))
        found.update(_modules()[name] for name in named if name in _modules())
    return frozenset(found)


# They decide how code is kept and called, not what is compiled.
_APART = frozenset(
    _PACKAGE_ROOT / "kernels/base" / name for name in ("bundle_types.py", "disk_cache.py", "private_files.py")
)


@cache
def _source_closure(path: Path) -> frozenset[Path]:
    """The file and every kernel module that it reaches by imports, as far as they decide what is compiled."""
    found, pending = {path}, [path]
    while pending:
        new = _kernel_imports(pending.pop()) - found - _APART
        found |= new
        pending.extend(new)
    return frozenset(found)


def _compiler() -> str:
    return f"{numba.__version__} {bool(config.BOUNDSCHECK)}"


@cache
def _source_stamp(path: Path) -> str:
    digest = hashlib.sha256(_compiler().encode())
    for file in sorted(_source_closure(path)):
        digest.update(_content(file))
    return digest.hexdigest()


@cache
def _stamp_of_file(name: str) -> str:
    """The stamp of a file of this package, taken when it is imported: it may be edited before anything is compiled."""
    path = Path(name).resolve()
    return _source_stamp(path) if path.is_relative_to(_PACKAGE_ROOT) else ""


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
        if not isinstance(self._impl.locator, _PackageLocator):
            stamp = f"{_compiler()} {stamp}"
        self._cache_file = _EntryFile(self.folder, self._impl.filename_base, stamp, self.source)


class OnDemand:
    """What a dispatcher keeps its code in, set up when it first looks there: most kernels are only called by others.

    Nothing is kept where that is impossible or not safe: a function typed at a prompt has no file. Warns once of a
    folder that others can write.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        _stamp_of_file(function.__code__.co_filename)

    @cached_property
    def own(self) -> Any:
        """The cache of the function."""
        try:
            found = _Cache(self._function)
            fault = _fault_of(found.folder, found.source)
        except (RuntimeError, OSError):
            return NullCache()
        if fault is None:
            return found
        _warn_of(fault)
        return NullCache()

    @property
    def cache_path(self) -> Any:
        """Where it keeps things."""
        return self.own.cache_path

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """What was compiled for these types, or None."""
        return self.own.load_overload(signature, target_context)

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep what was compiled."""
        self.own.save_overload(signature, data)


# A process finds out once a file, not once a function.
_fault_of = cache(fault_of_folder)


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
