"""Folders of compiled kernels: in the user's cache, and next to the package if installed with it."""

import hashlib
import os
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path

from vedette.kernels.base.private_files import folder_fault
from vedette.kernels.base.sources import PACKAGE_ROOT, kernel_files, source_stamp

# Created by `python dev.py release`; not the name of a module.
INSTALLED = PACKAGE_ROOT / "compiled-kernels"

# Processor levels of installed kernels, best first: LLVM's name, and the features that the code may use and the
# processor must have. The third level of the x86-64 psABI, and any processor of the architecture.
LEVELS = {
    "x86-64-v3": frozenset(
        (
            *("avx", "avx2", "bmi", "bmi2", "crc32", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sahf"),
            *("sse3", "sse4.1", "sse4.2", "ssse3", "xsave"),
        )
    ),
    "generic": frozenset[str](),
}


def supports_level(level: str, features: str) -> bool:
    """Return True if a processor can run code for a level of `LEVELS`. Features as LLVM writes them, `+avx,-fma`."""
    return LEVELS[level] <= {feature[1:] for feature in features.split(",") if feature.startswith("+")}


def cache_directory() -> Path:
    """Return the folder of compiled kernels: `$VEDETTE_CACHE_DIR`, or `vedette` in the user's cache directory."""
    override = os.environ.get("VEDETTE_CACHE_DIR")
    if override:
        return Path(override)
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".cache"
    return Path(base) / "vedette"


@cache
def compiler() -> str:
    """Return the version of the compiler. Code of other versions is not used."""
    checks = os.environ.get("NUMBA_BOUNDSCHECK", "0") not in ("", "0")
    return f"{version('numba')} {version('llvmlite')} {checks}"


@cache
def folder_name(path: Path) -> str:
    """Return the folder name for a kernel module's code. Code of other sources or compilers is in other folders.

    It does not depend on the location of the sources, so that all environments of a user share compiled kernels.
    """
    parts = path.relative_to(PACKAGE_ROOT).with_suffix("").parts
    digest = hashlib.sha256(f"{compiler()} {source_stamp(path)}".encode()).hexdigest()
    return f"{'_'.join(parts)}.{digest[:16]}"


def is_cold() -> bool:
    """Return True if no kernel has been compiled from these sources, and compiled kernels can be cached."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return False
    own, suffix = cache_directory(), f".py{sys.version_info[0]}{sys.version_info[1]}."
    for file in kernel_files():
        for folder in (own / folder_name(file), INSTALLED / folder_name(file)):
            if any(suffix in entry.name for entry in folder.glob("*.nbc")):
                return False
    return not own.is_dir() or folder_fault(own.resolve(), PACKAGE_ROOT / "__init__.py") is None
