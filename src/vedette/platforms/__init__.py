"""What a sensor may do, as rows of named numbers, and the poses that follow."""

from vedette.platforms.base import Actions, Options, Platform, options_at
from vedette.platforms.by_compass import ByCompass
from vedette.platforms.camera import Carried, Pointing
from vedette.platforms.compass import Compass, PlaneCompass
from vedette.platforms.courses import PAPER_HEADINGS_DEG, Courses
from vedette.platforms.fleet import Fleet
from vedette.platforms.operated import Operated
from vedette.platforms.patrolling import Patrolling
from vedette.platforms.sequences import Sequences
from vedette.platforms.steps import Steps, Still, Waypoints

__all__ = [
    "PAPER_HEADINGS_DEG",
    "Actions",
    "ByCompass",
    "Carried",
    "Compass",
    "Courses",
    "Fleet",
    "Operated",
    "Options",
    "Patrolling",
    "PlaneCompass",
    "Platform",
    "Pointing",
    "Sequences",
    "Steps",
    "Still",
    "Waypoints",
    "options_at",
]
