"""Vedette: where should a network of mobile sensors go next, so that together they track best?"""

from types import ModuleType

__version__ = "0.1.0"
# Imported when they are first asked for: what comes with one may take a second, or an extra.
_ROOMS = (
    "calibration",
    "campaigns",
    "control",
    "densities",
    "divergence",
    "errors",
    "evaluation",
    "filters",
    "fusion",
    "gym",
    "live",
    "models",
    "platforms",
    "recorded",
    "reports",
    "scenarios",
    "simulation",
    "stonesoup",
    "tracking",
)


def __getattr__(name: str) -> ModuleType:
    if name not in _ROOMS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return import_module(f"{__name__}.{name}")


def __dir__() -> list[str]:
    return sorted([*_ROOMS, "__version__"])
