"""The command that tracks scans while they come in: live."""

from __future__ import annotations

import asyncio
import hashlib
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vedette.cli.compiling import compiling
from vedette.cli.completing import strategies
from vedette.cli.errors import usage_error
from vedette.cli.options import Seed, Trust
from vedette.cli.output import note, publish, say
from vedette.cli.running import Approval, check_planner, compile_if_cold, interruptible
from vedette.cli.scenario_files import warn

if TYPE_CHECKING:
    from vedette.live import Keeping

_CHUNK = 1 << 16


def live(
    sensors: Annotated[
        Path,
        typer.Option("--sensors", metavar="FILE", help="YAML file about the sensors and the region, or a scenario."),
    ],
    window: Annotated[float, typer.Option("--window", min=0.001, help="s that a scan may be late.")] = 30.0,
    ahead: Annotated[
        float,
        typer.Option("--ahead", min=0.001, help="s that a scan may be ahead of all others, unless several agree."),
    ] = 60.0,
    speed: Annotated[
        float,
        typer.Option("--speed", min=0.001, help="m/s that targets hardly exceed, where motion or births are not said."),
    ] = 10.0,
    planner: Annotated[
        str,
        typer.Option("--planner", help="Who decides, see `vedette run`; still: nobody.", autocompletion=strategies),
    ] = "jdm",
    decide_every: Annotated[
        float | None,
        typer.Option("--decide-every", metavar="S", min=0.001, help="s between decisions; none: as `control` says."),
    ] = None,
    snapshot: Annotated[
        Path | None, typer.Option("--snapshot", metavar="FILE", help="Keeps the state, and is gone on from.")
    ] = None,
    every: Annotated[float, typer.Option("--every", metavar="S", min=0.0, help="s between snapshots.")] = 10.0,
    record: Annotated[
        Path | None, typer.Option("--record", metavar="FILE", help="Keeps the lines as they came, and is gone on from.")
    ] = None,
    listen: Annotated[
        str | None,
        typer.Option("--listen", metavar="HOST:PORT", help="Take lines from TCP clients, not from standard input."),
    ] = None,
    token: Annotated[
        str | None,
        typer.Option("--token", envvar="VEDETTE_TOKEN", help="What clients must send first; a must beyond loopback."),
    ] = None,
    seed: Seed = 0,
    trust: Trust = False,
) -> None:
    """Track scans while they come in, a line of JSON each; estimates, and plans when they are due, as lines go out."""
    from vedette.live import Keeping, live_of
    from vedette.live.serving import check_address
    from vedette.scenarios.of_recording import scenario_of_sensors

    address = None if listen is None else _address(listen)
    if address is not None:
        check_address(address[0], token)
    known = scenario_of_sensors(sensors, speed=speed, decide_every=decide_every)
    check_planner(known.scenario, planner, "--planner")
    Approval(trust)(known.scenario)
    warn(known.scenario)
    for text in known.assumed:
        note(f"not said, so {text}")
    loop = live_of(known, planner, window=window, ahead=ahead, decide_every=decide_every, seed=seed)
    options = (window, ahead, speed, planner if loop.planner else "", decide_every, seed)
    of = hashlib.sha256(repr(options).encode() + sensors.read_bytes()).hexdigest()
    with interruptible("what came is kept where --snapshot or --record say so"):
        compile_if_cold(known.scenario)
        keeping = Keeping(loop, of=of, snapshot=snapshot, every=every, record=record, tell=note)
        try:
            with compiling():
                for answers in keeping.resume():
                    _say(answers)
                if address is None:
                    _from_input(keeping)
                else:
                    asyncio.run(_from_clients(keeping, address, token))
        finally:
            keeping.close()
    publish(_document(keeping))


def _address(listen: str) -> tuple[str, int]:
    host, _, port = listen.rpartition(":")
    if not host or not port.isdecimal() or int(port) > 65535:
        raise usage_error(f"expected HOST:PORT; got {listen!r}", "--listen")
    return host.strip("[]"), int(port)


def _say(answers: Iterable[dict[str, Any]]) -> None:
    from vedette.live import encoded

    for answer in answers:
        say(encoded(answer).decode(), nl=False)


def _from_input(keeping: Keeping) -> None:
    from vedette.live import MOST_BYTES, LineSplitter

    splitter = LineSplitter(MOST_BYTES)
    source: Any = sys.stdin.buffer
    while data := source.read1(_CHUNK):
        for line in splitter.feed(data):
            _say(keeping.take(line))
    for line in splitter.rest():
        _say(keeping.take(line))


async def _from_clients(keeping: Keeping, address: tuple[str, int], token: str | None) -> None:
    from vedette.live import Server

    def take(line: bytes) -> Iterable[dict[str, Any]]:
        answers = keeping.take(line)
        _say(answers)
        return answers

    server = await Server(take, token, note).listen(*address)
    host, port = server.sockets[0].getsockname()[:2]
    note(f"listens on {host}:{port}")
    try:
        await asyncio.Event().wait()  # for ever: Ctrl-C ends it, and waits for no client
    finally:
        server.close()


def _document(keeping: Keeping) -> dict[str, Any]:
    state = keeping.state
    timeline = state.timeline
    return {
        "lines": state.num_lines,
        "errors": state.num_errors,
        "scans": timeline.num_taken,
        "late": timeline.num_late,
        "dropped": timeline.num_dropped,
        "repeated": timeline.num_repeated,
        "decisions": state.num_decisions,
    }
