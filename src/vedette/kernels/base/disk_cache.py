"""Disk cache of compiled kernels and model functions, safe for any number of processes at once.

Entries are found by the sources they were compiled from (`vedette.kernels.base.sources`). An entry is a pickle, so it
is read only if no other user can have written it, see `vedette.kernels.base.private_files`.
"""

import contextlib
import hashlib
import pickle
import uuid
import warnings
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from typing import Any, ClassVar

from numba.core.caching import CompileResultCacheImpl, FunctionCache, NullCache
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from vedette.kernels.base import compile_progress
from vedette.kernels.base.cache_paths import INSTALLED, LEVELS, cache_directory, compiler, folder_name, supports_level
from vedette.kernels.base.interrupts import interrupts_wait
from vedette.kernels.base.private_files import folder_fault, make_private_folder, read_private, write_private
from vedette.kernels.base.sources import package_file

_MARK_LENGTH = hashlib.sha256().digest_size


class _PackageLocator:
    """Numba cache locator for functions inside this package (the protocol of `numba.core.caching`)."""

    def __init__(self, function: Callable[..., Any], path: Path) -> None:
        self._path = path
        self._py_file = str(path)  # named in Numba's warnings about code that cannot be cached
        self._line = function.__code__.co_firstlineno

    def ensure_cache_path(self) -> None:
        """Create the folder if possible. Otherwise installed kernels can still be read."""
        with contextlib.suppress(OSError):
            make_private_folder(Path(self.get_cache_path()))

    def get_cache_path(self) -> str:
        return str(cache_directory() / folder_name(self._path))

    def get_source_stamp(self) -> str:
        return folder_name(self._path)

    def get_disambiguator(self) -> str:
        return str(self._line)

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> "_PackageLocator | None":
        path = package_file(file)
        return None if path is None else cls(function, path)


class _Place:
    """Folder with entries of one function, for this machine or for all machines of a level of `LEVELS`."""

    def __init__(self, folder: Path, level: str | None = None) -> None:
        self.folder = folder
        self._level = level

    def serves(self, key: Any) -> bool:
        """Return True if this machine can run the cached code stored under `key`."""
        _, (_, _, features), _ = key
        return self._level is None or supports_level(self._level, features)

    def key(self, key: Any) -> Any:
        """Return the key in this folder for a key of this machine."""
        if self._level is None:
            return key
        signature, (triple, _, _), code = key
        return signature, (triple, self._level, ""), code

    def is_safe(self, source: Path) -> bool:
        """Return True if the folder exists and no other user can write to it, and warn once if others can."""
        try:
            fault = _fault_of(self.folder.resolve(), source)
        except (OSError, RuntimeError):
            return False
        if fault is not None:
            _warn_of(fault)
        return fault is None


class _EntryFile:
    """Entries of one function, each in a file of its own that is named by its key.

    Numba's own class keeps an index of numbered files: if two processes compile at once, an entry is lost or stored
    under the other's key. Here every file is complete and identifies itself. The last of equal writers wins.
    """

    def __init__(self, places: list[_Place], filename_base: str, source_stamp: str, source: Path) -> None:
        self._places = places
        self._source = source
        self._base = filename_base
        self._stamp = source_stamp

    def save(self, key: Any, data: Any) -> None:
        """Store an entry. If the disk is full or not writable, the code stays in memory only."""
        own = self._places[0]
        if not own.is_safe(self._source):
            return
        content = dumps(data)
        path = self._path(own, key)
        partial = path.with_name(f"{path.name}.{uuid.uuid4().hex[:16]}")
        with contextlib.suppress(OSError):
            try:
                write_private(partial, self._mark(key, content) + content)
                partial.replace(path)
            finally:
                partial.unlink(missing_ok=True)

    def load(self, key: Any) -> Any:
        """Return the entry, or None if it is missing, damaged, of other sources, or writable by other users."""
        for place in self._places:
            if place.serves(key) and place.is_safe(self._source):
                found = self._load(self._path(place, key), place.key(key))
                if found is not None:
                    return found
        return None

    def _load(self, path: Path, key: Any) -> Any:
        held = read_private(path, self._source)
        if held is None:
            return None
        content = held[_MARK_LENGTH:]
        if held[:_MARK_LENGTH] != self._mark(key, content):
            return None
        try:
            return pickle.loads(content)
        except ImportError:  # compiled when its module had another name
            return None

    def flush(self) -> None:
        for path in self._places[0].folder.glob(f"{self._base}.*.nbc"):
            path.unlink(missing_ok=True)

    def _mark(self, key: Any, content: bytes) -> bytes:
        return hashlib.sha256(f"{self._stamp} {key!r} ".encode() + content).digest()

    def _path(self, place: _Place, key: Any) -> Path:
        digest = hashlib.sha256(repr(place.key(key)).encode()).hexdigest()[:16]
        return place.folder / f"{self._base}.{digest}.nbc"


class _CacheImpl(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes: ClassVar[list[Any]] = [_PackageLocator, *CompileResultCacheImpl._locator_classes]


class _Cache(FunctionCache):  # type: ignore[misc]
    _impl_class = _CacheImpl

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        places = [_Place(Path(self._cache_path))]
        stamp = self._impl.locator.get_source_stamp()
        if isinstance(self._impl.locator, _PackageLocator):
            installed = INSTALLED / places[0].folder.name
            places += [_Place(installed, level) for level in LEVELS]
        else:
            stamp = f"{compiler()} {stamp}"
        source = Path(function.__code__.co_filename).resolve()
        self._cache_file = _EntryFile(places, self._impl.filename_base, stamp, source)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """Return Numba's key, without the bytecode of this package's functions, as their sources are in the stamp.

        Python's bytecode differs without docstrings (`PYTHONOPTIMIZE=2`), but the compiled code is the same.
        """
        signature, target, (code, closure) = super()._index_key(sig, codegen)
        return signature, target, ("" if isinstance(self._impl.locator, _PackageLocator) else code, closure)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load like Numba, but without importing all of Numba's own functions, which takes half a second."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


class LazyCache:
    """Cache of a dispatcher, created at first use, as most kernels are only called by others.

    Nothing is cached if that is impossible or unsafe: a function typed at a prompt has no file. Warns once about a
    folder that other users can write.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @cached_property
    def own(self) -> Any:
        """Cache of the function."""
        try:
            return _Cache(self._function)
        except (RuntimeError, OSError):
            return NullCache()

    @property
    def cache_path(self) -> Any:
        """Folder of the cache."""
        return self.own.cache_path

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Return the cached code for these types, or None: then it is compiled now."""
        found = self.own.load_overload(signature, target_context)
        if found is None:
            compile_progress.compilation_begins(self._function)
            with interrupts_wait():  # an interrupted import would leave Numba's compiler incomplete
                cpu_target.typing_context.refresh()
                target_context.refresh()
        return found

    def save_overload(self, signature: Any, data: Any) -> None:
        """Store compiled code."""
        compile_progress.compilation_ends()
        self.own.save_overload(signature, data)


# Cached, as the check is needed once per file and not once per function.
_fault_of = cache(folder_fault)


@cache  # once per process, not once per function
def _warn_of(fault: str) -> None:
    warnings.warn(
        f"compiled kernels on disk are not used: {fault}, and they are code; all are compiled anew, for minutes. "
        "Make the folder your own (chown, chmod go-w), or set VEDETTE_CACHE_DIR to one that is",
        RuntimeWarning,
        stacklevel=2,
    )
