"""Recordings in the formats of others, in files made here, byte by byte as they are sent."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asterix.generated import manifest
from pyais import encode_dict

from recordings import ORIGIN, SHIPS
from vedette.errors import InputError
from vedette.evaluation.runs import run_scenario
from vedette.models import Bias
from vedette.recorded import Conventions, Origin, RecordedSensor, RecordedTargets, parse_scans
from vedette.recorded.files import read_table
from vedette.scenarios.from_recording import scenario_from_recording
from vedette.scenarios.warnings import scenario_warnings

CATS: Any = manifest["CATS"]
KNOT = 1852.0 / 3600.0  # m/s


def ais(time: float | None, **said: Any) -> str:
    """A position report, after a tag block with the receiver's time."""
    (line,) = encode_dict({"type": 1, "speed": 10.0, "course": 90.0, **said}, talker_id="AI")
    if time is None:
        return str(line)
    body = f"s:rx,c:{time:.0f}"
    total = 0
    for letter in body:
        total ^= ord(letter)
    return f"\\{body}*{total:02X}\\{line}"


def plot(
    time: float,
    rho: float,
    theta: float,
    sic: int = 2,
    level: float | None = None,
    garbled: int = 0,
    doppler: tuple[int, float] | None = None,
) -> bytes:
    """A data block of one plot; doppler: whether the speed is doubtful, and the speed in m/s."""
    category = CATS[48][-1]
    said: dict[str, Any] = {
        "010": (("SAC", 1), ("SIC", sic)),
        "140": ((time, "s")),
        "040": (("RHO", (rho, "NM")), ("THETA", (theta, "°"))),
    }
    if level is not None:
        said["090"] = (("V", 0), ("G", garbled), ("FL", (level, "FL")))
    if doppler is not None:
        said["120"] = {"CAL": (("D", doppler[0]), 0, ("CAL", (doppler[1], "m/s")))}
    record = category.cv_record.create(said)
    block: bytes = category.create([record]).unparse().to_bytes()
    return block


def other_category() -> bytes:
    category = CATS[34][-1]
    record = category.cv_record.create({"000": 1, "010": (("SAC", 1), ("SIC", 2))})
    block: bytes = category.create([record]).unparse().to_bytes()
    return block


@pytest.mark.parametrize(
    "pattern",
    [
        "2016-01-12T13:02:{:02d}Z {}",
        "2016-01-12 13:02:{:02d},{}",
        "[2016-01-12T13:02:{:02d}] {}",
        "{1},r003669930,14526037{0}",
        "14526037{} {}",
    ],
)
def test_times_of_ais_logs_without_tag_blocks_are_read(tmp_path: Path, pattern: str) -> None:
    sentences = [ais(None, mmsi="235000001", lon=-1.11 + 1e-4 * k, lat=50.79) for k in range(3)]
    lines = [pattern.format(21 + 10 * k, sentence) for k, sentence in enumerate(sentences)]
    (tmp_path / "a.nmea").write_text("\n".join(lines), "ascii")
    times = read_table(tmp_path / "a.nmea").columns["time"]
    np.testing.assert_allclose(np.diff(times), 10.0)
    first = 1452603721.0 if pattern.count("14526037") else 1452603741.0
    assert times[0] == first


def test_ais_without_any_time_is_refused_with_the_lines_that_are_read(tmp_path: Path) -> None:
    (tmp_path / "a.nmea").write_text(ais(None, mmsi="235000001", lon=-1.1, lat=50.8), "ascii")
    with pytest.raises(
        InputError, match=r"2016-01-12T13:02:21Z !AIVDM.*got 1 line with a position but no time \(first: row 1\)"
    ):
        read_table(tmp_path / "a.nmea")


def test_ships_report_themselves(tmp_path: Path) -> None:
    lines = [ais(1452603741 + 10 * k, mmsi="235000001", lon=-1.11 + 1e-4 * k, lat=50.79) for k in range(6)]
    lines += ["!AIVDM,1,1,,A,garbage*00", "no message", ais(None, mmsi="235000002", lon=-1.1, lat=50.8)]
    lines += [ais(1452603741, mmsi="235000003", lon=181.0, lat=91.0)]  # it does not know where it is
    (tmp_path / "ships.nmea").write_text("\n".join(lines) + "\n", "ascii")
    table = read_table(tmp_path / "ships.nmea")
    assert table.rows == [1, 2, 3, 4, 5, 6]
    left = "left out: 2 lines damaged (first: row 7), 1 line with a position but no time (first: row 9)"
    assert table.notes == (left,)
    np.testing.assert_allclose(table.columns["vx"], 10.0 * KNOT)
    targets = RecordedTargets.from_file(tmp_path / "ships.nmea", origin_deg=(-1.11, 50.79))
    truth = targets.truth([0.0, 25.0], rng=np.random.default_rng(0))
    expected = Origin(-1.11, 50.79).to_plane([-1.11 + 2.5e-4], [50.79])
    np.testing.assert_allclose(truth.states[1:, :2], expected, atol=8.0)  # AIS rounds to a few metres


@pytest.mark.parametrize("place", [12, 30, -3], ids=["time", "position", "checksum"])
def test_a_damaged_message_is_skipped_and_reported(place: int, tmp_path: Path) -> None:
    lines = [ais(1452603741 + 10 * k, mmsi="235000001", lon=-1.11 + 1e-4 * k, lat=50.79) for k in range(6)]
    letters = list(lines[2])
    letters[place] = "7" if letters[place] != "7" else "5"
    (tmp_path / "ships.nmea").write_text("\n".join([*lines[:2], "".join(letters), *lines[3:]]), "ascii")
    assert read_table(tmp_path / "ships.nmea").rows == [1, 2, 4, 5, 6]
    targets = RecordedTargets.from_file(tmp_path / "ships.nmea")
    assert targets.reports.notes == ("left out: 1 line damaged (first: row 3)",)


@pytest.mark.parametrize("place", [0, 1, 3, 6])
def test_no_damaged_letter_at_the_start_of_a_message_loses_it_without_a_word(place: int, tmp_path: Path) -> None:
    lines = [f"!{ais(1452603741 + 10 * k, mmsi='235000001', lon=-1.1, lat=50.79).partition('!')[2]}" for k in range(3)]
    lines = [f"{line},{1452603741 + 10 * k}" for k, line in enumerate(lines)]
    for byte in set(range(256)) - {10, 13}:
        letters = bytearray(lines[1], "ascii")
        if letters[place] == byte:
            continue
        letters[place] = byte
        (tmp_path / "ships.nmea").write_bytes(b"\n".join([lines[0].encode(), bytes(letters), lines[2].encode()]))
        table = read_table(tmp_path / "ships.nmea")
        assert table.rows == [1, 2, 3] or table.notes, chr(byte)


def of_two_sentences(time: int | None, number: int, **said: Any) -> list[str]:
    """A report of extended class B, cut in two: the second sentence has neither a time nor a place."""
    whole = encode_dict({"type": 19, "speed": 10.0, "course": 90.0, **said}, talker_id="AI")[0].split(",")[5]
    found = []
    for part, payload in enumerate((whole[:28], whole[28:]), start=1):
        body = f"AIVDM,2,{part},{number},A,{payload},0"
        total = 0
        for letter in body:
            total ^= ord(letter)
        found.append(f"!{body}*{total:02X}")
    return found if time is None else [f"{time} {found[0]}", found[1]]


def test_positions_in_messages_of_several_sentences_are_read(tmp_path: Path) -> None:
    """Also where those of two ships come between each other."""
    one = of_two_sentences(1452603741, 1, mmsi="235000001", lon=-1.11, lat=50.79)
    two = of_two_sentences(1452603742, 2, mmsi="235000002", lon=-1.12, lat=50.78, course=0.0)
    alone = ais(1452603743, mmsi="235000003", lon=-1.13, lat=50.77)
    (tmp_path / "ships.nmea").write_text("\n".join([one[0], two[0], alone, *two[1:], *one[1:]]), "ascii")
    table = read_table(tmp_path / "ships.nmea")
    assert (table.rows, table.notes) == ([3, 4, 5], ())
    assert table.columns["id"] == ["235000003", "235000002", "235000001"]
    assert table.columns["time"] == [1452603743.0, 1452603742.0, 1452603741.0]
    np.testing.assert_allclose(table.columns["longitude"], [-1.13, -1.12, -1.11], atol=1e-6)
    np.testing.assert_allclose(table.columns["latitude"], [50.77, 50.78, 50.79], atol=1e-6)
    np.testing.assert_allclose(table.columns["vx"], [10.0 * KNOT, 0.0, 10.0 * KNOT], atol=1e-9)


def test_messages_that_are_not_complete_are_counted(tmp_path: Path) -> None:
    """A first sentence before another first one, a second alone, and a first at the end."""
    reports = [of_two_sentences(1452603741 + k, 1, mmsi="235000001", lon=-1.11, lat=50.79) for k in range(4)]
    lines = [reports[0][0], *reports[1], reports[2][1], reports[3][0]]
    (tmp_path / "ships.nmea").write_text("\n".join(lines), "ascii")
    table = read_table(tmp_path / "ships.nmea")
    assert (table.rows, table.columns["time"]) == ([3], [1452603742.0])
    assert table.notes == ("left out: 3 lines of messages that are not complete (first: row 1)",)
    (tmp_path / "ships.nmea").write_text(reports[0][0], "ascii")
    with pytest.raises(InputError, match=r"got 1 line of messages that are not complete \(first: row 1\)"):
        read_table(tmp_path / "ships.nmea")
    whole = of_two_sentences(None, 1, mmsi="235000001", lon=-1.11, lat=50.79)
    (tmp_path / "ships.nmea").write_text("\n".join(whole), "ascii")
    with pytest.raises(InputError, match=r"got 1 line with a position but no time \(first: row 2\)"):
        read_table(tmp_path / "ships.nmea")


def test_valid_doppler_speeds_are_range_rates(tmp_path: Path) -> None:
    plots = [plot(0.0, 5.0, 45.0, doppler=(0, -20.0)), plot(1.0, 5.0, 45.0, doppler=(1, 30.0)), plot(2.0, 5.0, 45.0)]
    (tmp_path / "radar.ast").write_bytes(b"".join(plots))
    assert read_table(tmp_path / "radar.ast").columns["range_rate_mps"] == [-20.0, None, None]
    (tmp_path / "radar.ast").write_bytes(b"".join(plots[1:]))
    assert "range_rate_mps" not in read_table(tmp_path / "radar.ast").columns


def test_records_without_a_position_are_reported(tmp_path: Path) -> None:
    category = CATS[48][-1]
    record = category.cv_record.create({"010": (("SAC", 1), ("SIC", 2)), "140": ((4.0, "s"))})
    (tmp_path / "radar.ast").write_bytes(plot(0.0, 5.0, 45.0) + category.create([record]).unparse().to_bytes())
    assert read_table(tmp_path / "radar.ast").notes[1] == "left out: 1 record of category 048 without a time or place"


def test_a_ship_without_a_speed_has_none_for_all(tmp_path: Path) -> None:
    lines = [ais(10, mmsi="235000001", lon=1.0, lat=50.0), ais(20, mmsi="235000001", lon=1.0, lat=50.0, speed=102.3)]
    (tmp_path / "ships.ais").write_text("\n".join(lines), "ascii")
    assert "vx" not in read_table(tmp_path / "ships.ais").columns


def test_radars_say_what_they_see(tmp_path: Path) -> None:
    content = plot(46941.5, 10.0, 45.0) + other_category() + plot(46942.0, 3.25, 271.0, sic=7)
    (tmp_path / "radar.ast").write_bytes(content)
    table = read_table(tmp_path / "radar.ast")
    assert table.columns["sensor"] == ["1/2", "1/7"]
    assert table.columns["range_nmi"] == [10.0, 3.25]
    np.testing.assert_allclose(table.columns["bearing_deg"], [45.0, 271.0], atol=360.0 / 2**16)
    assert (table.columns["time"], table.bearings) == ([46941.5, 46942.0], "north")


def test_biases_of_a_radar_count_as_its_bearings_do(tmp_path: Path) -> None:
    """Clockwise, as the format says without the conventions."""
    (tmp_path / "radar.ast").write_bytes(plot(0.0, 5.0, 92.0))
    site = RecordedSensor("1/2", "bearing_range", (0.0, 0.0, 0.0), Bias(bearing=np.radians(2.0)))
    found = parse_scans(read_table(tmp_path / "radar.ast"), [site], Conventions({}, {}))
    assert isinstance(found.scans[0][0], np.ndarray)
    np.testing.assert_allclose(found.scans[0][0][0, 0], 0.0, atol=2.0 * np.pi / 2**16)


def test_the_height_of_a_flight_level_is_taken_off_slant_ranges(tmp_path: Path) -> None:
    """Three aircraft at flight level 330 over a round Earth, 20, 60 and 150 km from the radar along its horizon."""
    earth, height, ground = 6_371_000.0, 330 * 30.48, np.array([20e3, 60e3, 150e3])
    up = np.sqrt((earth + height) ** 2 - ground**2) - earth
    slant = np.hypot(ground, up) / 1852.0
    content = b"".join(plot(float(k), rho, 45.0, level=330.0) for k, rho in enumerate(slant.tolist()))
    (tmp_path / "radar.ast").write_bytes(content)
    table = read_table(tmp_path / "radar.ast")
    np.testing.assert_allclose(1852.0 * np.array(table.columns["range_nmi"]), ground, atol=10.0)  # 1 / 256 nmi
    assert table.notes == ()
    others = plot(3.0, 20.0, 45.0, level=330.0, garbled=1) + plot(4.0, 1.0, 45.0, level=330.0) + plot(5.0, 8.0, 45.0)
    (tmp_path / "radar.ast").write_bytes(content + others)
    table = read_table(tmp_path / "radar.ast")
    assert table.columns["range_nmi"][3:] == [20.0, 1.0, 8.0]  # garbled; nearer than it is high; none
    assert table.notes[0].startswith("3 of 6 plots have no flight level: their slant ranges are taken for ranges along")


def test_slant_ranges_warn(tmp_path: Path) -> None:
    (tmp_path / "radar.ast").write_bytes(b"".join(plot(5.0 * k, 5.0 + 0.1 * k, 45.0) for k in range(6)))
    text = "sensors:\n  - {name: 1/2, position: [0, 0], detection: {kind: constant, probability: .9}}\n"
    (tmp_path / "radar.yaml").write_text(text, "utf-8")
    found = scenario_from_recording(tmp_path / "radar.yaml", tmp_path / "radar.ast")
    assert any("6 of 6 plots have no flight level" in line for line in scenario_warnings(found.scenario))


def test_midnight_is_passed(tmp_path: Path) -> None:
    (tmp_path / "radar.ast").write_bytes(b"".join(plot(time, 5.0, 10.0) for time in (86399.5, 0.5, 4.5)))
    assert read_table(tmp_path / "radar.ast").columns["time"] == [86399.5, 86400.5, 86404.5]


def track(time: float, lon: float, lat: float, number: int = 7, velocity: tuple[float, float] | None = None) -> bytes:
    category = CATS[62][-1]
    said: dict[str, Any] = {
        "010": (("SAC", 1), ("SIC", 9)),
        "070": ((time, "s")),
        "040": number,
        "105": (("LAT", (lat, "°")), ("LON", (lon, "°"))),
    }
    if velocity is not None:
        said["185"] = (("VX", (velocity[0], "m/s")), ("VY", (velocity[1], "m/s")))
    block: bytes = category.create([category.cv_uap.cv_record.create(said)]).unparse().to_bytes()
    return block


def test_tracks_of_a_system_are_scans_of_positions_and_reports(tmp_path: Path) -> None:
    lon, lat = ORIGIN.to_degrees([[300.0, -400.0]])[0].tolist()
    content = b"".join(track(86399.0 + k - 86400.0 * (k > 0), lon, lat, 7, (4.0, -3.0)) for k in range(2))
    (tmp_path / "system.ast").write_bytes(content)
    site = RecordedSensor("1/9", "position", (0.0, 0.0, 0.0))
    found = parse_scans(read_table(tmp_path / "system.ast"), [site], Conventions({}, {}), ORIGIN)
    assert found.times.tolist() == [0.0, 1.0]
    assert isinstance(found.scans[1][0], np.ndarray)
    np.testing.assert_allclose(found.scans[1][0], [[300.0, -400.0]], atol=1.0)  # 180 / 2^25 degrees
    (tmp_path / "both.ast").write_bytes(plot(86399.0, 5.0, 10.0) + content + track(2.0, lon, lat, 8))
    assert read_table(tmp_path / "both.ast").columns["range_nmi"] == [5.0]
    table = read_table(tmp_path / "both.ast", reports=True)
    assert (table.columns["id"], table.columns["time"]) == (["7", "7", "8"], [86399.0, 86400.0, 86402.0])
    assert "vx" not in table.columns  # the last does not say
    targets = RecordedTargets.from_file(tmp_path / "system.ast", origin_deg=(ORIGIN.longitude_deg, ORIGIN.latitude_deg))
    # VY is to true north at the place of the track, which the plane has 6.6e-5 radians from y.
    (axes,) = ORIGIN.axes([lon], [lat])
    np.testing.assert_allclose(targets.tracks[0].velocities, [axes @ [4.0, -3.0]] * 2, rtol=1e-6)
    (tmp_path / "plots.ast").write_bytes(plot(1.0, 5.0, 10.0))
    with pytest.raises(InputError, match=r"plots.ast: expected tracks of category 062; got none"):
        read_table(tmp_path / "plots.ast", reports=True)


def test_plots_are_tracked(tmp_path: Path) -> None:
    rng, content = np.random.default_rng(0), b""
    for time in np.arange(0.0, 100.0, 4.0).tolist():
        for state in SHIPS:
            offset = state[:2] + state[2:] * time + rng.normal(0.0, 15.0, 2)
            azimuth = float(np.degrees(np.arctan2(offset[0], offset[1]))) % 360.0
            turned = ((azimuth + 90.0) % 360.0) / 90.0  # s, at four a turn, from the west on
            content += plot(40000.0 + time + turned, float(np.hypot(*offset)) / 1852.0, azimuth)
    (tmp_path / "radar.ast").write_bytes(content)
    (tmp_path / "radar.yaml").write_text(
        "origin: {lon: -1.1171, lat: 50.7865}\nrecording: {scan_window: 3.5}\n"
        'sensors:\n  - {name: "1/2", position: [0, 0], detection: {kind: constant, probability: 0.95}, '
        "noise: {kind: range_dependent, sigma_range: 20.0, eta_range: 0.0, sigma_bearing_deg: 0.5, eta_bearing: 0.0}, "
        "clutter: {kind: region, rate: 0.5}}\n",
        "utf-8",
    )
    made = scenario_from_recording(tmp_path / "radar.yaml", tmp_path / "radar.ast")
    assert made.assumed["turn"].startswith("1/2 once in 4 s, clockwise")
    assert [len(scan) for scans in made.recording.scans for scan in scans if scan is not None][1:-1] == [3] * 24
    last = run_scenario(made.scenario, "stationary", seed=0).estimates[-2]
    truth = SHIPS[:, :2] + SHIPS[:, 2:] * 98.0
    assert last.num_targets == 3
    assert max(min(np.hypot(*(mean[:2] - ship)) for ship in truth) for mean in last.means) < 60.0
    assert ORIGIN.to_degrees(last.means[:, :2]).shape == (3, 2)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.nmea", b"nothing\n", "got 1 line damaged (first: row 1)"),
        ("a.pcap", b"\xd4\xc3\xb2\xa1", "got a capture; write it by `tshark -r a.pcap -T fields -e udp.payload | xxd"),
        ("a.ast", b"\x30\x00", "a.ast: expected ASTERIX data blocks; got other bytes"),
        ("a.ast", b"\x3e\x00\x05\xff\xff", "a.ast: expected records of category 062 in data block 1"),
        ("a.ast", b"\x30\x00\x05\xff\xff", "a.ast: expected records of category 048 in data block 1"),
        ("a.asterix", b"", "a.asterix: expected plots of category 048 or tracks of category 062; got none"),
    ],
)
def test_other_bytes_are_refused(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as error:
        read_table(tmp_path / name)
    assert message in str(error.value)


def service(time: float, kind: int = 1, sic: int = 2, period: float | None = None) -> bytes:
    """A data block of one service message: the beam passes the north (1), or enters a sector (2)."""
    category = CATS[34][-1]
    said: dict[str, Any] = {"000": kind, "010": (("SAC", 1), ("SIC", sic)), "030": ((time, "s"))}
    if period is not None:
        said["041"] = (period, "s")
    block: bytes = category.create([category.cv_record.create(said)]).unparse().to_bytes()
    return block


@pytest.mark.parametrize("tells_period", [True, False])
def test_service_messages_tell_the_turn_and_empty_turns_of_a_radar(tmp_path: Path, tells_period: bool) -> None:
    """Three plots in ten turns of 4 s are too few to find a turn; whole turns before and after are empty scans."""
    norths = [1000.0 + 4.0 * k for k in range(11)]
    content = b"".join(service(time, period=4.0 if tells_period else None) for time in norths)
    content += b"".join(plot(time + 1.0, 20.0, 90.0) for time in (1012.0, 1016.0, 1024.0))
    content += service(1001.0, kind=2, sic=7) + service(1002.0, kind=3)
    (tmp_path / "radar.ast").write_bytes(content)
    site = RecordedSensor("1/2", "bearing_range", (0.0, 0.0, 0.0))
    found = parse_scans(read_table(tmp_path / "radar.ast"), [site], Conventions({}, {}))
    sizes = [0 if scans[0] is None else len(scans[0]) for scans in found.scans]
    assert 9 <= len(sizes) <= 10
    assert sum(sizes) == 3
    assert np.diff(found.times) == pytest.approx(4.0, abs=1e-6)
    alone = parse_scans(read_table(tmp_path / "radar.ast"), [replace(site, turn="none")], Conventions({}, {}))
    assert len(alone.times) == 3


def test_measured_flight_levels_of_tracks_are_altitudes(tmp_path: Path) -> None:
    category = CATS[62][-1]
    said = {
        "010": (("SAC", 1), ("SIC", 9)),
        "070": ((1000.0, "s")),
        "105": (("LAT", (50.0, "°")), ("LON", (4.0, "°"))),
        "040": 7,
    }
    records = [category.cv_record.create(said | more) for more in ({"136": ((100.0, "FL"))}, {})]
    (tmp_path / "tracks.ast").write_bytes(category.create(records).unparse().to_bytes())
    assert read_table(tmp_path / "tracks.ast").columns["altitude_m"] == [pytest.approx(3048.0), None]
