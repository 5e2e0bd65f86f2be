"""Where compiled kernels lie: in the user's cache, and beside the package where they were installed with it."""

from __future__ import annotations

import hashlib
import os
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path

from vedette.kernels.base.private_files import folder_fault
from vedette.kernels.base.sources import PACKAGE_ROOT, kernel_files, source_stamp

# Made by `python dev.py release`; the name is that of no module.
INSTALLED = PACKAGE_ROOT / "compiled-kernels"

# The processors that what is installed was compiled for, best first: LLVM's name, and the features that code for it may
# use, all of which a processor must have that runs it. The third level of the x86-64 psABI, and any of a kind.
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
    """Whether a processor can run what was compiled for a level of `LEVELS`; features in LLVM's words, `+avx,-fma`."""
    return LEVELS[level] <= {feature[1:] for feature in features.split(",") if feature.startswith("+")}


def cache_directory() -> Path:
    """Directory of the compiled kernels: `$VEDETTE_CACHE_DIR`, or `vedette` in the user's cache directory."""
    override = os.environ.get("VEDETTE_CACHE_DIR")
    if override:
        return Path(override)
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".cache"
    return Path(base) / "vedette"


@cache
def compiler() -> str:
    """What compiles: code of another version of it is not taken."""
    checks = os.environ.get("NUMBA_BOUNDSCHECK", "0") not in ("", "0")
    return f"{version('numba')} {version('llvmlite')} {checks}"


@cache
def folder_name(path: Path) -> str:
    """Of the folder of a kernel module's code: those of other sources, or compilers, lie beside it.

    Nothing in it says where the sources lie, so that all environments of a user share what is compiled.
    """
    parts = path.relative_to(PACKAGE_ROOT).with_suffix("").parts
    digest = hashlib.sha256(f"{compiler()} {source_stamp(path)}".encode()).hexdigest()
    return f"{'_'.join(parts)}.{digest[:16]}"


def is_cold() -> bool:
    """Whether no kernel at all has been compiled from these sources, so that it will be now, and kept."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return False
    own, suffix = cache_directory(), f".py{sys.version_info[0]}{sys.version_info[1]}."
    for file in kernel_files():
        for folder in (own / folder_name(file), INSTALLED / folder_name(file)):
            if any(suffix in entry.name for entry in folder.glob("*.nbc")):
                return False
    return not own.is_dir() or folder_fault(own.resolve(), PACKAGE_ROOT / "__init__.py") is None
