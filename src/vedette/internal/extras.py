"""Packages that only some of the program needs, and what is said where one is missing.

Filters, fusion, decisions and scenarios do without them: `pip install vedette`. The others come with an extra, as
pyproject.toml has them: `pip install 'vedette[report]'`.
"""

from __future__ import annotations

from importlib.util import find_spec

from vedette.errors import MissingPackageError

# Package -> the extra that brings it. Every extra brings what `campaigns` does.
EXTRA_OF = {
    "pyarrow": "campaigns",
    "jinja2": "report",
    "matplotlib": "report",
    "distributed": "cluster",
    "xarray": "xarray",
    "asterix": "readers",
    "pyais": "readers",
    "rosbags": "readers",
    "mcap": "formats",
    "websockets": "live",
    "gymnasium": "gym",
    "pettingzoo": "gym",
    "stonesoup": "stonesoup",
}


def require_packages(what: str, *packages: str) -> None:
    """Nothing where all the packages (of `EXTRA_OF`) are installed.

    Raises `MissingPackageError` otherwise: that `what` needs those that are missing, and how they are installed.
    """
    if lacking := without(what, *packages):
        raise MissingPackageError(lacking)


def without(what: str, *packages: str) -> str:
    """That `what` needs the packages (of `EXTRA_OF`) that are missing, and how to install them; empty: none is."""
    missing = [package for package in packages if not _is_installed(package)]
    if not missing:
        return ""
    extras = {EXTRA_OF[package] for package in missing}
    names = ",".join(sorted(extras - {"campaigns"} or extras))
    which = "which is not installed" if len(missing) == 1 else "which are not installed"
    return f"{what} needs {' and '.join(missing)}, {which}: pip install 'vedette[{names}]'"


def _is_installed(package: str) -> bool:
    try:
        return find_spec(package) is not None
    except (ImportError, ValueError):  # something in between refuses it
        return False
