"""The scans of a run that is over, drawn once more: a record keeps what was estimated, not what was measured."""

from __future__ import annotations

from collections.abc import Sequence

from vedette.errors import InputError
from vedette.models import SensorModel
from vedette.simulation.experiment import Experiment
from vedette.simulation.loop import SCANS, sensor_streams
from vedette.simulation.records import RunRecord
from vedette.simulation.scans import Scan, simulate_scans


def scans_of(record: RunRecord, experiment: Experiment) -> tuple[tuple[Scan, ...], ...]:
    """Every scan of every sensor of a run, exactly as the loop simulated it, with the ids of the targets behind it.

    Seed, run number, truth and poses fix all measurements: each sensor has its own stream of random numbers, and draws
    from it scan after scan.

    Args:
        record: of a run of this experiment, whatever the planner.
        experiment: gives the sensors' models.

    Returns:
        For each scan, one `Scan` a sensor; its origins are ids of `record.truth`, or `CLUTTER`.

    Raises:
        InputError: another number of sensors in the record than in the experiment.
        VedetteError: what the models raise.
    """
    return scans_of_sensors(record, experiment.tracker.sensors)


def scans_of_sensors(record: RunRecord, sensors: Sequence[SensorModel]) -> tuple[tuple[Scan, ...], ...]:
    """As `scans_of`, by the sensors' models alone."""
    if record.num_sensors != len(sensors):
        raise InputError(f"record: expected {len(sensors)} sensors; got {record.num_sensors}")
    streams = sensor_streams(record.seed, record.run, SCANS, record.num_sensors)
    return tuple(
        simulate_scans(states, record.poses[step], sensors, ids=ids, rngs=streams)
        for step, (ids, states) in enumerate(record.truth.at(scan) for scan in range(record.num_scans))
    )
