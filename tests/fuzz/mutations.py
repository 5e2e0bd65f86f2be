"""Valid texts and data, spoilt at random."""

from __future__ import annotations

import copy
import re
from typing import Any

import numpy as np

TOKENS = [
    *('"\\UFFFFFFFF"', '"\\U00110000"', '"\\ud800": 1', '"\\udfff"', '"\\u0000"', '"\\x1b[31m"'),
    *("[" * 60, "[" * 3000, "{a: " * 60, "[[" * 200 + "]]" * 200, "a." * 500),
    *("&a [*a]", "*a", "&a", "<<: *a", "!!python/object:os.system", "!!float", "!<tag:x>"),
    *("%YAML 1.1\n---\n", "---\n", "...\n", ".inf", "-.inf", ".nan", "inf", "nan"),
    *("1e400", "-1e400", "5e-324", "1e308", "1e-308", "9" * 400, "0x" + "F" * 400, "0" * 5000, "1_0"),
    *("2024-02-30", "2024-02-29T12:00:00Z", "99:99:99", "²", "٣", "é" * 300, "x" * 10_000),
    *("\ufeff", "\u2028", "\u202e", "\x00", "\x7f", "\x85", "\t", "\r", "\n", " "),
    *("#", ":", ",", "-", "?", "|", ">", "'", '"', "true", "null", "~"),
    *("0", "-0.0", "-1", "1e18", "18446744073709551616"),
]

_MANY = {f"unknown {number}": number for number in range(300)}

JUNK: list[Any] = [
    *(None, True, False, 0, 1, -1, 2, 3, 7, 3.5, -0.0, 0.5, 1.0 - 1e-16, 1e-300, 1e-320, 5e-324, 1e-12),
    *(1e6, 1e18, 1e300, 1e308, 1.7e308, -1e300, 2**31, 2**63, -(2**63) - 1, 10**30, 10**400),
    *(float("inf"), float("-inf"), float("nan"), "", " ", "0", "x", "x" * 10_000, "x" * 100_000, "²", "\ud800"),
    *("\x00", "[/bold]x", "\x1b[31m", "\x1b[2J", "\u202eabc", "a\nb", "a\x00b", "<script>", "{{7*7}}", "1e999", "null"),
    *(
        "every",
        "none",
        "reference",
        "2024-01-01T00:00:00Z",
        "jdm",
        "stationary",
        "planner",
        "paper-a",
        "sensors.*.clutter.rate",
    ),
    *("data.csv", ".", "..", "/", "~", "../../etc/passwd", "/dev/zero", "os:system"),
    *([], [[]], [1, "a"], [1, 2, 3], ["jdm"], [0.0] * 2, [1e300] * 2, [1.0] * 4, [[1.0, 0.0], [0.0, 1.0]]),
    *([1] * 1000, [0.1] * 1000, {}, {"kind": []}, {"kind": "x" * 5000}, {"": {}}, {"": None}, {"x" * 10_000: 1}, _MANY),
    *({"kind": "custom"}, {"kind": "custom", "function": "os:system"}),
    {"kind": "custom", "function": "own.py:motion", "components": ["px", "py", "vx", "vy"]},
]


def pick(rng: np.random.Generator, values: Any) -> Any:
    """One of a sequence."""
    return values[int(rng.integers(len(values)))]


def spoil_text(rng: np.random.Generator, text: str) -> bytes:
    """A text with letters, words or lines changed, as bytes that need be no text any more."""
    for _ in range(int(rng.integers(1, 4))):
        text = pick(rng, (_put, _cut, _swap_words, _repeat_line, _replace_word))(rng, text)
    raw = text.encode("utf-8", "surrogatepass")
    how = rng.random()
    if how < 0.08:
        return b"\xef\xbb\xbf" + raw
    if how < 0.12:
        return text.encode("latin-1", "replace")
    if how < 0.15:
        return text.encode("utf-16", "surrogatepass")
    return spoil_bytes(rng, raw) if how < 0.35 else raw


def spoil_bytes(rng: np.random.Generator, raw: bytes) -> bytes:
    """Bytes cut short, with some flipped, put in, taken out, added at the end or written over."""
    for _ in range(int(rng.integers(1, 4))):
        place, how = int(rng.integers(len(raw) + 1)), rng.random()
        if how < 0.5 and raw:
            edited = bytearray(raw)
            for each in rng.integers(0, len(raw), int(rng.integers(1, 6))):
                edited[each] ^= int(rng.integers(1, 256))
            raw = bytes(edited)
        elif how < 0.65:
            raw = raw[:place] + rng.bytes(int(rng.integers(1, 9))) + raw[place:]
        elif how < 0.8:
            raw = raw[:place] + raw[place + int(rng.integers(1, 50)) :]
        elif how < 0.9:
            raw = raw[:place]
        else:
            raw = raw + rng.bytes(int(rng.integers(1, 100))) if how < 0.97 else rng.bytes(int(rng.integers(100)))
    return raw


def _put(rng: np.random.Generator, text: str) -> str:
    place = int(rng.integers(len(text) + 1))
    return text[:place] + pick(rng, TOKENS) + text[place:]


def _cut(rng: np.random.Generator, text: str) -> str:
    start = int(rng.integers(len(text) + 1))
    return text[:start] + text[start + int(rng.integers(1, 40)) :]


def _words(text: str) -> list[tuple[int, int]]:
    return [match.span() for match in re.finditer(r"[\w.+-]+", text)]


def _swap_words(rng: np.random.Generator, text: str) -> str:
    words = _words(text)
    if len(words) < 2:
        return text
    (a, b), (c, d) = sorted(words[int(i)] for i in rng.choice(len(words), 2, replace=False))
    return text[:a] + text[c:d] + text[b:c] + text[a:b] + text[d:]


def _replace_word(rng: np.random.Generator, text: str) -> str:
    words = _words(text)
    if not words:
        return text
    start, end = pick(rng, words)
    return text[:start] + pick(rng, TOKENS) + text[end:]


def _repeat_line(rng: np.random.Generator, text: str) -> str:
    lines = text.splitlines(keepends=True)
    if not lines:
        return text
    line = pick(rng, lines)
    lines.insert(int(rng.integers(len(lines) + 1)), line)
    return "".join(lines)


def places(data: Any) -> list[tuple[Any, Any]]:
    """Every collection in the data with each of its keys."""
    if not isinstance(data, dict | list):
        return []
    keys = list(data) if isinstance(data, dict) else list(range(len(data)))
    return [(data, key) for key in keys] + [place for key in keys for place in places(data[key])]


def spoil_data(rng: np.random.Generator, data: Any, most: int = 3) -> Any:
    """A copy of plain data with values replaced, nudged, exchanged, left out, renamed or added to."""
    data = copy.deepcopy(data)
    for _ in range(int(rng.integers(1, most + 1))):
        found = places(data)
        if not found:
            return data
        collection, key = pick(rng, found)
        how = rng.random()
        if how < 0.35:
            collection[key] = copy.deepcopy(pick(rng, JUNK))
        elif how < 0.65:
            collection[key] = nudged(rng, collection[key])
        elif how < 0.75:
            other, at = pick(rng, found)
            collection[key] = copy.deepcopy(other[at])
        elif how < 0.85:
            del collection[key]
        elif isinstance(collection, dict):
            collection[f"{key}{pick(rng, ['x', '', '.', chr(0xB2), ' '])}"] = copy.deepcopy(pick(rng, JUNK))
        else:
            collection.append(copy.deepcopy(pick(rng, [*JUNK, collection[key]])))
    return data


def nudged(rng: np.random.Generator, value: Any) -> Any:
    """A number a little or much larger or smaller, a text with something in it, a list of another length."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        factor = pick(rng, [0, -1, 1 / 3, 10, 1e-3, 1e3, 1e-9, 1e9, 1e-150, 1e150])
        return value * factor if isinstance(value, float) else int(min(abs(min(value, 10**18) * factor), 1e12))
    if isinstance(value, list) and value:
        return pick(rng, [value[:-1], value + value[-1:], value[::-1], value * 20])
    if isinstance(value, str) and value:
        place = int(rng.integers(len(value)))
        return value[:place] + str(pick(rng, JUNK))[:50] + value[place + int(rng.integers(3)) :]
    return [value]


def covariance(rng: np.random.Generator, dim: int) -> list[list[float]]:
    """Of any scale, and not always one: symmetric or not, definite or not."""
    root = rng.normal(size=(dim, dim)) * 10.0 ** rng.uniform(-3, 3, size=dim)
    cov = root.T @ root
    how = rng.random()
    if how < 0.3:
        place = tuple(rng.integers(dim, size=2))
        cov[place] = pick(rng, [0.0, -1.0, 1e300, 1e-300, cov[place] * (1.0 + 1e-8), cov[place] * 2.0])
    elif how < 0.5:
        cov -= np.eye(dim) * np.linalg.eigvalsh(cov)[0] * pick(rng, [1.0, 1.0 - 1e-9, 1.1])
    elif how < 0.6:
        cov = np.diag(np.diagonal(cov)) * pick(rng, [1e-320, 1e-100, 1e100, 1e290])
    elif how < 0.7:
        cov = np.ones((dim, dim))
    rows: list[list[float]] = cov.tolist()
    return rows
