"""AIS messages of ships (NMEA 0183) as tables of positions."""

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from vedette.errors import InputError
from vedette.internal.extras import require_packages
from vedette.internal.text import pluralise

AIS_ENDINGS = (".nmea", ".ais")
_FIRST_TIME = 3e8  # s; lower numbers are not times since 1970 of an AIS message
_MILLISECONDS = 1e11  # greater times are milliseconds
_KNOT = 1852.0 / 3600.0  # m/s
_SIGNS = (b"!", b"VDM,", b"VDO,")  # marks of an AIS message, whose first letter may be damaged
_NO_SPEED, _NO_COURSE = 102.3, 360.0  # values in AIS for unknown speed and course


def read_ais(file: Path) -> tuple[dict[str, list[Any]], list[int], tuple[str, ...]]:
    """Return positions of ships: `time`, `id` (MMSI), `longitude`, `latitude`. `vx`, `vy` if every ship reports them.

    Times are those of the receiver: in tag blocks (`\\c:1452603741*..\\`), before the message (`2016-01-12T13:02:21Z
    !AIVDM,...`, or seconds since 1970), or after it (`...*5C,r003669930,1452603741`). For a message of several
    sentences the first time found. Messages without positions are skipped. Damaged lines (by their checksums),
    sentences of incomplete messages, and positions without a time are left out. Returns the columns, the line of each
    row, and a warning that counts the rows left out.

    Raises:
        MissingPackageError: pyais is not installed.
        InputError: no position with a time in the file.
    """
    require_packages(f"{file}, which is a file of AIS messages,", "pyais")
    rows, lines, lost, open_ones = list[tuple[Any, ...]](), list[int](), dict[str, list[int]](), _Open({}, [])
    with file.open("rb") as source:
        for number, line in enumerate(source, start=1):
            try:
                part = _part(line.strip(), number)
                position = None if part is None else _position(open_ones.joined(part))
            except ValueError as fault:
                lost.setdefault(str(fault), []).append(number)
            else:
                if position is not None:
                    rows.append(position)
                    lines.append(number)
    if incomplete := open_ones.left():
        lost["of messages that are not complete"] = incomplete
    if not rows and b"TTM," in file.read_bytes():
        table = "a .csv table with time, sensor, range_nmi and bearing_deg"
        raise InputError(f"{file}: expected AIS positions; got TTM sentences, tracks of a radar: write them as {table}")
    if not rows:
        expected = r"AIS positions with times: `\c:1452603741*54\!AIVDM,...`, `2016-01-12T13:02:21Z !AIVDM,...` or "
        raise InputError(f"{file}: expected {expected}`!AIVDM,...*5C,1452603741`; got {_lost_in_words(lost) or 'none'}")
    names = ("time", "id", "longitude", "latitude")
    columns: dict[str, list[Any]] = {name: [row[place] for row in rows] for place, name in enumerate(names)}
    if all(row[4] is not None for row in rows):
        columns |= {"vx": [row[4][0] for row in rows], "vy": [row[4][1] for row in rows]}
    return columns, lines, (f"left out: {_lost_in_words(lost)}",) if lost else ()


def _lost_in_words(lost: dict[str, list[int]]) -> str:
    return ", ".join(f"{pluralise(len(at), 'line')} {what} (first: row {at[0]})" for what, at in lost.items())


def _sentence(line: bytes) -> tuple[bytes, float | None]:
    """Return the sentence of a line, with its tag block if there is one, and the time before or after it."""
    if line.startswith(b"\\"):
        return line, None
    start, star = max(line.find(b"!"), 0), line.rfind(b"*")
    end = star + 3 if star >= 0 else len(line)
    times = [_clock(line[:start].strip(b" ,;\t[]()")), _clock(line[end:].rsplit(b",", 1)[-1].strip())]
    return line[start:end], next((time for time in times if time is not None), None)


def _clock(cell: bytes) -> float | None:
    """Return seconds since 1970 from an ISO 8601 time (default zone UTC) or a number, or None for anything else."""
    text = cell.decode("ascii", "replace")
    try:
        if text.replace(".", "", 1).isdigit():
            return float(text) if float(text) > _FIRST_TIME else None
        moment = datetime.fromisoformat(text)
    except ValueError:
        return None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


class _Part(NamedTuple):
    """A sentence of a message, the time in its line, and the number of that line."""

    sentence: Any
    time: float | None
    line: int


class _Open(NamedTuple):
    """Incomplete messages of several sentences, by the fields that their sentences share.

    lost: lines of messages that will not be completed.
    """

    waiting: dict[tuple[Any, ...], list[_Part]]
    lost: list[int]

    def joined(self, part: _Part) -> list[_Part]:
        """Return all parts of the message that this part completes, in order, empty if other parts are missing."""
        own = part.sentence
        if own.frag_cnt == 1:
            return [part]
        key = (own.seq_id, own.channel, own.talker_id, own.type, own.frag_cnt)
        parts = self.waiting.pop(key, [])
        if own.frag_num != len(parts) + 1:
            self.lost.extend(each.line for each in parts)
            parts = []
            if own.frag_num > 1:
                self.lost.append(part.line)
                return []
        parts.append(part)
        if len(parts) == own.frag_cnt:
            return parts
        self.waiting[key] = parts
        return []

    def left(self) -> list[int]:
        """Return the lines of messages that were not completed, in order."""
        return sorted([*self.lost, *(part.line for parts in self.waiting.values() for part in parts)])


def _part(line: bytes, number: int) -> _Part | None:
    """Return the AIS sentence of a line, or None for an empty or another line. Raises `ValueError` if damaged."""
    from pyais.exceptions import AISBaseException
    from pyais.messages import AISSentence, NMEASentenceFactory

    if not line or (line.startswith((b"$", b"#")) and not any(sign in line for sign in _SIGNS)):
        return None
    text, time = _sentence(line)
    try:
        sentence = NMEASentenceFactory.produce(text)
        block = sentence.tag_block
        if block is not None:
            block.init()
            stamp = block.receiver_timestamp
            time = None if stamp is None else float(stamp)
        if not sentence.is_valid or (block is not None and not block.is_valid):
            raise ValueError
    except (AISBaseException, TypeError, ValueError):
        raise ValueError("damaged") from None
    return _Part(sentence, time, number) if isinstance(sentence, AISSentence) else None


def _position(parts: list[_Part]) -> tuple[Any, ...] | None:
    """Return time, MMSI, longitude, latitude and velocity of a message, or None for one without position, or no parts.

    Raises `ValueError` with a description of a message that cannot be decoded, or is a position without a time.
    """
    from pyais.exceptions import AISBaseException
    from pyais.messages import AISSentence

    if not parts:
        return None
    try:
        message = AISSentence.assemble_from_iterable([part.sentence for part in parts]).decode().asdict()
    except (AISBaseException, TypeError, ValueError):
        raise ValueError("damaged") from None
    lon, lat = message.get("lon"), message.get("lat")
    if not (isinstance(lon, float) and isinstance(lat, float) and abs(lon) <= 180.0 and abs(lat) <= 90.0):
        return None
    time = next((part.time for part in parts if part.time is not None), None)
    if time is None or not math.isfinite(time):
        raise ValueError("with a position but no time")
    return time / 1000.0 if time > _MILLISECONDS else time, str(message["mmsi"]), lon, lat, _velocity(message)


def _velocity(message: dict[str, Any]) -> tuple[float, float] | None:
    """Return the velocity to the east and north, m/s, or None if unknown."""
    speed, course = message.get("speed"), message.get("course")
    if speed is None or course is None or speed >= _NO_SPEED or course >= _NO_COURSE:
        return None
    angle = math.radians(course)
    return _KNOT * speed * math.sin(angle), _KNOT * speed * math.cos(angle)
