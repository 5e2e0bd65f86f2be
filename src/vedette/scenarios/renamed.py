"""Former names in scenario files, sensors files and campaigns: the present name of each key, value and strategy.

This is the only table of renamed keys. Errors about unknown keys take their hints from it, and `vedette upgrade`
rewrites files by it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from vedette.scenarios.diagnostics import Path

# Section -> former key -> present key. Sections are paths with the present names; `*` is any key or item, and SENSOR an
# item of `sensors` or `sensor_defaults`.
_KEYS: dict[str, dict[str, str]] = {
    "SENSOR": {"moves_from": "stationary_until_first_decision", "truth": "true_parameters"},
    "SENSOR.scans": {"drop_out": "scan_loss_probability"},
    "SENSOR.scans.late": {"share": "probability", "up_to": "max_delay"},
    "SENSOR.platform": {"carrier": "platform", "stay": "allow_staying"},
    "SENSOR.platform.platform": {"stay": "allow_staying"},
    "SENSOR.noise": {"growth": "quadratic_growth"},
    "SENSOR.true_parameters.noise": {"growth": "quadratic_growth"},
    "SENSOR.detection": {"cut": "hard_limit"},
    "SENSOR.true_parameters.detection": {"cut": "hard_limit"},
    "SENSOR.true_parameters.first_detection": {"cut": "hard_limit"},
    "recording": {"gather": "scan_window"},
    "motion": {"acceleration": "noise_model"},
    "undetected": {"cell": "cell_size", "enters": "birth_density"},
    "fusion": {"by_views": "field_of_view_weighting"},
    "network": {"loss": "link_loss_probability", "hops": "max_hops"},
    "control": {"undetected_worth": "undetected_target_value"},
    "control.search": {"elite_share": "elite_fraction"},
    "planners.*.search": {"elite_share": "elite_fraction"},
    "ospa": {"from_step": "first_scan", "to_step": "last_scan"},
    "metrics.*": {"min_detection": "min_detection_probability", "from_step": "first_scan"},
}
# Strategies, in campaigns, runs and results.
STRATEGIES = {"assigned": "assigned_target", "fixed": "constant", "still": "stationary", "told": "true_targets"}
# Key, by its present path -> former value -> present value.
_VALUES: dict[str, dict[str, str | bool]] = {
    "SENSOR.stationary_until_first_decision": {"first_decision": True, "start": False},
    "SENSOR.platform.kind": {"still": "stationary", "courses": "heading", "steps": "grid_moves"},
    "SENSOR.platform.platform.kind": {"still": "stationary", "courses": "heading", "steps": "grid_moves"},
    "targets.kind": {"crowd": "uniform"},
    "motion.noise_model": {"held": "discrete_white", "continuous": "continuous_white"},
    "undetected.birth_density": {"anywhere": "uniform", "border": "boundary"},
    "control.search.order": {"printed": "sensor_order"},
    "planners.*.search.order": {"printed": "sensor_order"},
    "control.lookahead.rollout": {"kept": "repeat_last"},
    "planners.*.rollout": {"kept": "repeat_last"},
    "planners.*.kind": {"assigned": "assigned_target", "told": "true_targets"},
    "metrics.*.kind": {"tracked_share": "tracked_fraction"},
}


def _by_path(table: Mapping[str, Any]) -> list[tuple[tuple[str, ...], Any]]:
    """Return the entries of a table with their paths, each entry of SENSOR once for every place of sensors."""
    found = []
    for path, entry in table.items():
        for sensor in ("sensors.*", "sensor_defaults") if path.startswith("SENSOR") else ("",):
            found.append((tuple(path.replace("SENSOR", sensor).split(".")), entry))
    return found


_KEYS_BY_PATH, _VALUES_BY_PATH = _by_path(_KEYS), _by_path(_VALUES)


def _entry(table: list[tuple[tuple[str, ...], Any]], path: Path) -> dict[Any, Any]:
    for pattern, entry in table:
        if len(pattern) == len(path) and all(own in ("*", key) for own, key in zip(pattern, path, strict=True)):
            return dict(entry)
    return {}


def present_key(path: Path) -> str:
    """Return the present name of the last key of a path with otherwise present names; empty if it was not renamed."""
    return str(_entry(_KEYS_BY_PATH, path[:-1]).get(path[-1], "")) if path else ""


def present_value(path: Path, value: Any) -> Any:
    """Return the present form of a value at a path of present names; None if it was not renamed."""
    return _entry(_VALUES_BY_PATH, path).get(value) if isinstance(value, str) else None


def renamed_strategy(name: str) -> str:
    """Return the present name of a strategy in brackets, for the end of a message; empty if it was not renamed."""
    return f" (now {STRATEGIES[name]})" if name in STRATEGIES else ""


class Change(NamedTuple):
    """A renamed key, or the renamed value at a key.

    path: of the value in the data as it was. is_key: True for the key itself, the last of the path.
    """

    path: Path
    is_key: bool
    former: str
    present: str | bool


def changes(data: Any, at: Path = (), path: Path = ()) -> Iterator[Change]:
    """Yield the changes of data with former names, the innermost first.

    at: path of the data in a scenario, in present names. path: of the data in the file.
    """
    if isinstance(data, Mapping):
        for key, value in data.items():
            present = present_key((*at, key))
            yield from changes(value, (*at, present or key), (*path, key))
            if present:
                yield Change((*path, key), True, key, present)
    elif isinstance(data, Sequence) and not isinstance(data, str):
        for index, value in enumerate(data):
            yield from changes(value, (*at, index), (*path, index))
    elif (present := present_value(at, data)) is not None:
        yield Change(path, False, data, present)


def changed(data: Any, change: Change) -> Any:
    """Return the data with one change; mappings keep their order.

    Raises `KeyError` if the present key is there as well.
    """
    return _changed(data, change.path, change)


def _changed(data: Any, path: Path, change: Change) -> Any:
    if not path:
        return change.present
    first, rest = path[0], path[1:]
    if isinstance(data, Sequence):
        return [_changed(own, rest, change) if index == first else own for index, own in enumerate(data)]
    if rest or not change.is_key:
        return {key: _changed(own, rest, change) if key == first else own for key, own in data.items()}
    if change.present in data:
        raise KeyError(change.present)
    return {change.present if key == first else key: own for key, own in data.items()}
