"""What a wheel holds beside the sources: kernels that were compiled for it (`python dev.py release`), if there are any.

Hatchling calls this while it builds. Without `VEDETTE_COMPILED_KERNELS` the wheel is one of pure Python.
"""

from __future__ import annotations

import os
import platform
import sys
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CompiledKernels(BuildHookInterface):  # type: ignore[type-arg]
    """Puts a folder of compiled kernels into the package."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called before the files are gathered; machine code makes the wheel one of this Python and system."""
        folder = os.environ.get("VEDETTE_COMPILED_KERNELS")
        if folder and version == "standard":
            build_data["force_include"][folder] = "vedette/compiled-kernels"
            build_data["pure_python"] = False
            if sys.platform == "linux":
                # The code is linked where it is loaded: it runs on whatever system Numba's own wheels run.
                python = f"cp{sys.version_info[0]}{sys.version_info[1]}"
                build_data["tag"] = f"{python}-{python}-manylinux_2_28_{platform.machine()}"
            else:
                build_data["infer_tag"] = True
