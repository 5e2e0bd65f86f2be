"""Compiled kernels and model functions on disk, safe for any number of processes at once.

What is kept is found by the sources it was compiled of (`vedette.kernels.base.sources`). An entry is a pickle, so it is
read only where nobody else can have written it, see `vedette.kernels.base.private_files`.
"""

from __future__ import annotations

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
    """Numba cache locator for functions defined inside this package (the protocol of `numba.core.caching`)."""

    def __init__(self, function: Callable[..., Any], path: Path) -> None:
        self._path = path
        self._py_file = str(path)  # Numba's warnings about code that cannot be cached name it
        self._line = function.__code__.co_firstlineno

    def ensure_cache_path(self) -> None:
        """Where none can be made, what is installed can still be read."""
        with contextlib.suppress(OSError):
            make_private_folder(Path(self.get_cache_path()))

    def get_cache_path(self) -> str:
        return str(cache_directory() / folder_name(self._path))

    def get_source_stamp(self) -> str:
        return folder_name(self._path)

    def get_disambiguator(self) -> str:
        return str(self._line)

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> _PackageLocator | None:
        path = package_file(file)
        return None if path is None else cls(function, path)


class _Place:
    """A folder that holds entries of one function, for this machine or for all of a level of `LEVELS`."""

    def __init__(self, folder: Path, level: str | None = None) -> None:
        self.folder = folder
        self._level = level

    def serves(self, key: Any) -> bool:
        """Whether the machine that this key is of can run what is here."""
        _, (_, _, features), _ = key
        return self._level is None or supports_level(self._level, features)

    def key(self, key: Any) -> Any:
        """The key here of what has this key on this machine."""
        if self._level is None:
            return key
        signature, (triple, _, _), code = key
        return signature, (triple, self._level, ""), code

    def is_safe(self, source: Path) -> bool:
        """Whether it is there and nobody else can write to it; warns once of one that others can write."""
        try:
            fault = _fault_of(self.folder.resolve(), source)
        except (OSError, RuntimeError):
            return False
        if fault is not None:
            _warn_of(fault)
        return fault is None


class _EntryFile:
    """The entries of one function, each in a file of its own that is named by its key.

    Numba's own keeps an index of numbered files: of two processes that compile at once, one entry is lost or comes to
    stand under the other's key. Here every file is whole and says what it is; the last of equal writers wins.
    """

    def __init__(self, places: list[_Place], filename_base: str, source_stamp: str, source: Path) -> None:
        self._places = places
        self._source = source
        self._base = filename_base
        self._stamp = source_stamp

    def save(self, key: Any, data: Any) -> None:
        """Keep an entry. A disk that is full or not ours to write leaves it compiled in memory alone."""
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
        """The entry; None where there is none, one of other sources, a damaged one, or one that others can write."""
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
        except ImportError:  # compiled when its file was a module of another name
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
        """As Numba's, without the bytecode of this package's functions: their sources are in the stamp.

        Python's bytecode is another one without docstrings (`PYTHONOPTIMIZE=2`), the compiled code is the same.
        """
        signature, target, (code, closure) = super()._index_key(sig, codegen)
        return signature, target, ("" if isinstance(self._impl.locator, _PackageLocator) else code, closure)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """As Numba's, but all of its own functions are loaded only where one is compiled: half a second."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


class LazyCache:
    """What a dispatcher keeps its code in, set up when it first looks there: most kernels are only called by others.

    Nothing is kept where that is impossible or not safe: a function typed at a prompt has no file. Warns once of a
    folder that others can write.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @cached_property
    def own(self) -> Any:
        """The cache of the function."""
        try:
            return _Cache(self._function)
        except (RuntimeError, OSError):
            return NullCache()

    @property
    def cache_path(self) -> Any:
        """Where it keeps things."""
        return self.own.cache_path

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """What was compiled for these types, or None: then it is compiled now."""
        found = self.own.load_overload(signature, target_context)
        if found is None:
            compile_progress.compilation_begins(self._function)
            with interrupts_wait():  # what Numba compiles with, which would stay half there
                cpu_target.typing_context.refresh()
                target_context.refresh()
        return found

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep what was compiled."""
        compile_progress.compilation_ends()
        self.own.save_overload(signature, data)


# A process finds out once a file, not once a function.
_fault_of = cache(folder_fault)


@cache  # once a process, not once a function
def _warn_of(fault: str) -> None:
    warnings.warn(
        f"compiled kernels on disk are not used: {fault}, and they are code; all are compiled anew, for minutes. "
        "Make the folder your own (chown, chmod go-w), or set VEDETTE_CACHE_DIR to one that is",
        RuntimeWarning,
        stacklevel=2,
    )
