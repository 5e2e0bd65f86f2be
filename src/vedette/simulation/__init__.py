"""Simulation: true targets, scans, the loop of a run, and its record."""

from vedette.control import RequiresTruth
from vedette.kernels.gaussian.scans import CLUTTER
from vedette.simulation.born_targets import PoissonTargets, UniformTargets
from vedette.simulation.experiment import Experiment
from vedette.simulation.loop import ScanOutcome, SimulationRun, simulate
from vedette.simulation.oracle import OraclePlanner, Schedule
from vedette.simulation.records import Decision, RunRecord
from vedette.simulation.scans import Scan, simulate_scan, simulate_scans
from vedette.simulation.storage import load_run, save_run
from vedette.simulation.true_sensors import TrueSensor
from vedette.simulation.true_targets import TrueTargetsPlanner
from vedette.simulation.truth import ScriptedTargets, TargetSource, Truth

__all__ = [
    "CLUTTER",
    "Decision",
    "Experiment",
    "OraclePlanner",
    "PoissonTargets",
    "RequiresTruth",
    "RunRecord",
    "Scan",
    "ScanOutcome",
    "Schedule",
    "ScriptedTargets",
    "SimulationRun",
    "TargetSource",
    "TrueSensor",
    "TrueTargetsPlanner",
    "Truth",
    "UniformTargets",
    "load_run",
    "save_run",
    "simulate",
    "simulate_scan",
    "simulate_scans",
]
