"""The world that the program does not get to see: truth, scans; the loop, and what a run leaves behind."""

from vedette.control import RequiresTruth
from vedette.kernels.gaussian.scans import CLUTTER
from vedette.simulation.born_targets import PoissonTargets
from vedette.simulation.crowds import CrowdTargets
from vedette.simulation.experiment import Experiment
from vedette.simulation.loop import Moment, World, simulate
from vedette.simulation.oracle import OraclePlanner, Timetable
from vedette.simulation.records import Decision, RunRecord
from vedette.simulation.scans import Scan, simulate_scan, simulate_scans
from vedette.simulation.storage import load_run, save_run
from vedette.simulation.true_sensors import TrueSensor
from vedette.simulation.true_targets import ToldPlanner
from vedette.simulation.truth import ScriptedTargets, TargetSource, Truth

__all__ = [
    "CLUTTER",
    "CrowdTargets",
    "Decision",
    "Experiment",
    "Moment",
    "OraclePlanner",
    "PoissonTargets",
    "RequiresTruth",
    "RunRecord",
    "Scan",
    "ScriptedTargets",
    "TargetSource",
    "Timetable",
    "ToldPlanner",
    "TrueSensor",
    "Truth",
    "World",
    "load_run",
    "save_run",
    "simulate",
    "simulate_scan",
    "simulate_scans",
]
