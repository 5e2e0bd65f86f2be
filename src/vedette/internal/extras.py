"""Optional packages, and the message if one is missing.

Filters, fusion, decisions and scenarios need only `pip install vedette`. The other packages come with the extras of
pyproject.toml: `pip install 'vedette[report]'`.
"""

from importlib.util import find_spec

from vedette.errors import MissingPackageError

# Package -> the extra that installs it. Every extra includes the packages of `campaigns`.
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
    """Do nothing if all the packages (keys of `EXTRA_OF`) are installed.

    Raises `MissingPackageError` otherwise. The message says which packages `what` needs and how to install them.
    """
    if lacking := without(what, *packages):
        raise MissingPackageError(lacking)


def without(what: str, *packages: str) -> str:
    """Return a message if packages (keys of `EXTRA_OF`) that `what` needs are missing, else an empty text."""
    missing = [package for package in packages if not is_installed(package)]
    if not missing:
        return ""
    extras = {EXTRA_OF[package] for package in missing}
    names = ",".join(sorted(extras - {"campaigns"} or extras))
    which = "which is not installed" if len(missing) == 1 else "which are not installed"
    return f"{what} needs {' and '.join(missing)}, {which}: pip install 'vedette[{names}]'"


def is_installed(package: str) -> bool:
    """Return True if Python finds a package, without importing it."""
    try:
        return find_spec(package) is not None
    except (ImportError, ValueError):  # raised by a parent package or an import hook
        return False
