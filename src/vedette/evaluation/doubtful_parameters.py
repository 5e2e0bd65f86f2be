"""Sensor parameters that a sensors file does not give, or that tests of fit find wrong."""

from __future__ import annotations

from vedette.calibration import Parameter, Problem
from vedette.evaluation.fit import Fit
from vedette.scenarios.from_recording import RecordingScenario


def doubtful_parameters(problem: Problem, recorded: RecordingScenario, fit: Fit) -> list[Parameter]:
    """Return the parameters of a calibration problem that are assumed, and those that findings of fit name.

    Args:
        problem: from `vedette.scenarios.calibration.build_problem`.
        recorded: the recording. Its assumptions tell whether clutter was given. Biases of 0 count as not given.
        fit: of a run with the present parameters.
    """
    tests, names = {(each.sensor, each.test) for each in fit.findings}, recorded.scenario.model.sensor_names

    def is_doubtful(each: Parameter) -> bool:
        if each.kind == "bias" and (each.start == 0.0 or ("", "agreement") in tests):
            return True
        is_assumed = each.kind == "clutter" and "clutter" in recorded.assumed
        return is_assumed or (names[each.sensor], each.kind) in tests

    return [each for each in problem.parameters if is_doubtful(each)]
