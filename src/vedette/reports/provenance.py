"""Provenance of a campaign: a table of its sessions, its specification as TOML, and the citation."""

import json
from collections.abc import Mapping
from typing import Any

from vedette.reports.tables import Table


def spec_toml(spec: Mapping[str, Any]) -> str:
    """Return plain data as TOML text, tables after values. Entries that are None or empty are left out."""
    return "\n".join(_lines(spec, ())).strip() + "\n"


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    entries = {key: value for key, value in table.items() if value not in (None, [], (), {})}
    lines = [f"{_key(key)} = {_value(value)}" for key, value in entries.items() if not _is_table(value)]
    for key, value in entries.items():
        name = ".".join(_key(part) for part in (*path, key))
        if isinstance(value, Mapping):
            lines += ["", f"[{name}]", *_lines(value, (*path, key))]
        elif _is_table(value):
            for item in value:
                lines += ["", f"[[{name}]]", *_lines(item, (*path, key))]
    return lines


def _is_table(value: Any) -> bool:
    return isinstance(value, Mapping) or (
        isinstance(value, list | tuple) and bool(value) and all(isinstance(item, Mapping) for item in value)
    )


def _key(key: str) -> str:
    bare = key != "" and all(char.isascii() and (char.isalnum() or char in "-_") for char in key)
    return key if bare else _text(key)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return _text(str(value))


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")  # JSON strings are valid TOML


def last_version_and_date(manifest: Mapping[str, Any]) -> tuple[str, str]:
    """Return the version of this program and the date of the last session of a campaign."""
    last = manifest["sessions"][-1]
    return str(last["versions"]["vedette"]), str(last["started"])[:10]


def citation(version: str, year: str = "") -> str:
    """Return BibTeX entries of this program, with version and year, and of the paper whose methods it implements."""
    dated = f"  year = {{{year}}},\n" if year else ""
    return f"""@software{{vedette,
  title = {{Vedette}},
  author = {{{{The Vedette developers}}}},
  version = {{{version}}},
{dated}}}
@inproceedings{{jiang2016multi,
  title = {{Multi-Sensor Control for Multi-Target Tracking Using {{Cauchy-Schwarz}} Divergence}},
  author = {{Jiang, Meng and Yi, Wei and Kong, Lingjiang}},
  booktitle = {{19th International Conference on Information Fusion}},
  year = {{2016}},
}}"""


def versions_table(manifest: Mapping[str, Any]) -> Table:
    """Return start, versions and machine of each session of a campaign, one column per session.

    Consecutive sessions that differ only in their start share a column.
    """
    columns: list[tuple[list[str], dict[str, str]]] = []
    for session in manifest.get("sessions", ()):
        parts = {**session.get("versions", {}), **session.get("machine", {})}
        facts = {name: str(value) for name, value in parts.items()}
        if not columns or columns[-1][1] != facts:
            columns.append(([], facts))
        columns[-1][0].append(str(session.get("started", "")))
    names = list(dict.fromkeys(name for _, facts in columns for name in facts))
    rows = [("started", *(starts[0] if len(starts) == 1 else f"{starts[0]} to {starts[-1]}" for starts, _ in columns))]
    rows += [(name, *(facts.get(name, "\N{EN DASH}") for _, facts in columns)) for name in names]
    caption = f"Made {manifest.get('created', '')}; digest of specification and scenarios {manifest.get('digest', '')}."
    return Table(caption, ("", *_headings([len(starts) for starts, _ in columns])), tuple(rows), is_words=True)


def _headings(lengths: list[int]) -> list[str]:
    headings, first = [], 1
    for length in lengths:
        headings.append(f"Session {first}" if length == 1 else f"Sessions {first} to {first + length - 1}")
        first += length
    return headings
