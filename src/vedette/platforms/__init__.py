"""Platforms: the actions of a sensor, as rows of named numbers, and the poses that follow."""

from vedette.platforms.base import Actions, Options, Platform, options_at
from vedette.platforms.by_compass import ByCompass
from vedette.platforms.camera import MountedPlatform, Pointing
from vedette.platforms.compass import Compass, PlaneCompass
from vedette.platforms.courses import PAPER_HEADINGS_DEG, GridPlatform, HeadingPlatform, Stationary, Waypoints
from vedette.platforms.fleet import Fleet
from vedette.platforms.operated import Operated
from vedette.platforms.sequences import Sequences
from vedette.platforms.wrapper import Patrolling

__all__ = [
    "PAPER_HEADINGS_DEG",
    "Actions",
    "ByCompass",
    "Compass",
    "Fleet",
    "GridPlatform",
    "HeadingPlatform",
    "MountedPlatform",
    "Operated",
    "Options",
    "Patrolling",
    "PlaneCompass",
    "Platform",
    "Pointing",
    "Sequences",
    "Stationary",
    "Waypoints",
    "options_at",
]
