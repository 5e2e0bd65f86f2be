"""Sections of a scenario in a few words: `limited range, probability 0.9, range 5000 m`."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

from vedette.scenarios.sections.base import Section

_LABELS = {
    "max_range": "range",
    "relative": "relative to the present heading",
    "sigma_v": "process noise",
    "sigma_turn_rate_deg": "turn rate noise",
}
_LISTED = 4  # values that are printed one by one


def describe_settings(section: Section, replaced: Mapping[str, tuple[str, object]] | None = None) -> str:
    """Return a section's kind and its plain values with their units.

    replaced: other names and values of some of its fields.
    """
    kind = getattr(section, "kind", None)
    values = plain_values(section, replaced)
    return ", ".join(values if kind is None else [name_in_words(kind), *values])


def plain_values(section: Section, replaced: Mapping[str, tuple[str, object]] | None = None) -> list[str]:
    """Return each plain value of a section in words, without the kind; disabled and empty ones are left out."""
    texts = list[str]()
    for name, field in type(section).model_fields.items():
        name, value = (replaced or {}).get(name, (name, getattr(section, name)))
        if name == "kind" or value is None or value is False or value == () or isinstance(value, Section | dict):
            continue
        unit = (field.description or "").rpartition("[")[2].rstrip("].")
        texts.append(_value_in_words(name, value, "" if unit in ("-", "") else f" {unit}"))
    return texts


def _value_in_words(name: str, value: object, unit: str) -> str:
    """Return one value with its name and unit; the unit begins with a space."""
    label = _LABELS.get(name, name_in_words(name.removesuffix("_deg")))
    if value is True:
        return label
    if isinstance(value, tuple) and len(value) > _LISTED:
        numbers = [each for each in value if isinstance(each, int | float)]
        ends = (
            f" from {short_value(min(numbers))} to {short_value(max(numbers))}{unit}"
            if len(numbers) == len(value)
            else ""
        )
        return f"{len(value)} {label}{ends}"
    if name.startswith("num_"):
        return f"{short_value(value)} {label.removeprefix('num ')}"
    if name.startswith("max_") and isinstance(value, int):
        return f"at most {short_value(value)} {label.removeprefix('max ')}"
    return f"{label} {short_value(value)}{unit}"


def name_in_words(name: str) -> str:
    """Return a name of the file as words."""
    return name.replace("_", " ")


def short_value(value: object) -> str:
    """Return a value without needless digits."""
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, tuple):
        return ", ".join(short_value(item) for item in value)
    return name_in_words(str(value))


def scans_in_words(steps: Sequence[int], num_steps: int) -> str:
    """Return which scans these are, of `num_steps`: `every scan but the last (99)`, `scans 10, 20, 30`."""
    first, last, num = steps[0], steps[-1], len(steps)
    gaps = {later - earlier for earlier, later in pairwise(steps)}
    if num > 1 and gaps == {1} and first == 1 and last >= num_steps - 1:
        return f"every scan ({num})" if last == num_steps else f"every scan but the last ({num})"
    if num <= _LISTED:
        return ("scan " if num == 1 else "scans ") + ", ".join(map(str, steps))
    if len(gaps) == 1:
        return f"every {_ordinal(gaps.pop())}scan from {first} to {last} ({num})"
    return f"{num} scans from {first} to {last}"


def _ordinal(gap: int) -> str:
    """Return "" for 1, else the number with its ending and a space: `5th `."""
    ending = "th" if gap % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(gap % 10, "th")
    return "" if gap == 1 else f"{gap}{ending} "
