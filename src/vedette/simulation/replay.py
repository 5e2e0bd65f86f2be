"""Scans of a finished run, drawn again, as a record contains estimates but no measurements."""

from collections.abc import Callable
from functools import partial

from vedette.errors import InputError
from vedette.simulation.experiment import Experiment
from vedette.simulation.loop import SCANS, scan_flags_of_run, sensor_streams
from vedette.simulation.records import RunRecord
from vedette.simulation.scans import Scan, active_scans, simulate_scans
from vedette.simulation.true_sensors import ErrorMemory, TrueSensor


def scans_of(record: RunRecord, experiment: Experiment) -> tuple[tuple[Scan | None, ...], ...]:
    """Return every scan of every sensor of a run, exactly as simulated, with the ids of the targets behind it.

    Seed, run number, truth and poses determine all measurements: each sensor draws from its own stream, scan by scan.

    Args:
        record: record of a run of this experiment, with any planner.
        experiment: gives the true sensors, and the steps at which they scan.

    Returns:
        For each scan one `Scan` per sensor, or None if it did not scan. Its origins are ids of `record.truth`, or
        `CLUTTER`.

    Raises:
        InputError: the record and the experiment have different numbers of sensors.
        VedetteError: as the models.
    """
    scans_at = scan_flags_of_run(
        experiment.scans_at, experiment.scan_loss_probability, len(experiment.times), record.seed, record.run
    )
    return scans_of_sensors(record, experiment.num_sensors, partial(experiment.sensors_at, scans_at=scans_at))


def scans_of_sensors(
    record: RunRecord, num_sensors: int, sensors_at: Callable[[int], tuple[TrueSensor | None, ...]]
) -> tuple[tuple[Scan | None, ...], ...]:
    """Do the same as `scans_of`, given only the true sensors at each step."""
    if record.num_sensors != num_sensors:
        raise InputError(f"record: expected {num_sensors} sensors; got {record.num_sensors}")
    streams, truth = sensor_streams(record.seed, record.run, SCANS, num_sensors), record.truth
    scans, memories = list[tuple[Scan | None, ...]](), [ErrorMemory() for _ in streams]
    for step in range(record.num_scans):
        (ids, states), factors, sensors = truth.at(step), truth.detection_factors_at(step), sensors_at(step + 1)
        drawn = simulate_scans(
            states,
            record.poses[step],
            sensors,
            ids=ids,
            detection_factors=factors,
            rngs=streams,
            memories=memories,
            time=float(record.times[step]),
        )
        scans.append(active_scans(drawn, record.off[step]))
    return tuple(scans)
