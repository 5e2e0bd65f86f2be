"""The command that tracks scans as they arrive: live."""

from __future__ import annotations

import contextlib
import hashlib
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from vedette.cli.assumptions import note_assumptions
from vedette.cli.compiling import compiling
from vedette.cli.completing import strategies
from vedette.cli.errors import usage_error
from vedette.cli.options import Seed, Speed, Trust
from vedette.cli.output import echo, emit_json, note
from vedette.cli.running import CodeTrust, check_planner, compile_if_cold, interruptible
from vedette.cli.scenario_files import print_warnings
from vedette.internal.extras import require_packages

if TYPE_CHECKING:
    from vedette.live import PersistentLoop
    from vedette.reports.live import LiveScreen


def live(
    sensors: Annotated[
        Path,
        typer.Option("--sensors", metavar="FILE", help="Sensors file or scenario (YAML)."),
    ],
    max_delay: Annotated[
        float,
        typer.Option(
            "--max-delay",
            metavar="SECONDS",
            min=0.001,
            help="Accept scans up to this late; older ones are dropped.",
        ),
    ] = 30.0,
    max_lead: Annotated[
        float,
        typer.Option(
            "--max-lead",
            metavar="SECONDS",
            min=0.001,
            help="Reject a time stamp further ahead than this, unless several sensors agree.",
        ),
    ] = 60.0,
    speed: Speed = 10.0,
    planner: Annotated[
        str,
        typer.Option(
            "--planner",
            metavar="NAME",
            help='Planner, as in `vedette run`; "stationary": no decisions.',
            autocompletion=strategies,
        ),
    ] = "jdm",
    decide_every: Annotated[
        float | None,
        typer.Option(
            "--decide-every",
            metavar="SECONDS",
            min=0.001,
            help="Interval between decisions; default: `control` in the scenario.",
        ),
    ] = None,
    planning_timeout: Annotated[
        float | None,
        typer.Option(
            "--planning-timeout",
            metavar="SECONDS",
            min=0.001,
            help="Use the best action found so far after this time; default: no limit.",
        ),
    ] = None,
    snapshot: Annotated[
        Path | None,
        typer.Option(
            "--snapshot", metavar="FILE", help="Save the state to FILE regularly, and resume from it if it exists."
        ),
    ] = None,
    snapshot_interval: Annotated[
        float,
        typer.Option("--snapshot-interval", metavar="SECONDS", min=0.0, help="Interval between snapshots."),
    ] = 10.0,
    record: Annotated[
        Path | None,
        typer.Option("--record", metavar="FILE", help="Append every input line to FILE; replayed on resume."),
    ] = None,
    listen: Annotated[
        list[str] | None,
        typer.Option(
            "--listen",
            metavar="ADDRESS",
            help="stdin (default), tcp://HOST:PORT, or ws://HOST:PORT (also serves a web page). May be repeated.",
        ),
    ] = None,
    token: Annotated[
        str | None,
        typer.Option(
            "--token",
            metavar="TEXT",
            envvar="VEDETTE_TOKEN",
            help="Token that clients must send. Required for addresses other than loopback.",
        ),
    ] = None,
    seed: Seed = 0,
    trust: Trust = False,
) -> None:
    """Track scans as they arrive.

    Reads one JSON line per scan; writes estimates, and plans when a decision is due.
    """
    from vedette.live import PersistentLoop, build_live_loop
    from vedette.live.server import check_address
    from vedette.scenarios.from_recording import scenario_from_sensors

    sources = [_parse_source(address) for address in listen or ["stdin"]]
    for source in sources:
        if source.kind != "stdin":
            check_address(source.host, token)
    if any(source.kind == "ws" for source in sources):
        require_packages("vedette live --listen ws://", "websockets", "jinja2", "matplotlib", "pyarrow")
    live_scenario = scenario_from_sensors(sensors, speed=speed, decide_every=decide_every, plan_within=planning_timeout)
    check_planner(live_scenario.scenario, planner, "--planner")
    CodeTrust(trust)(live_scenario.scenario)
    print_warnings(live_scenario.scenario)
    note_assumptions(live_scenario.assumed, sensors)
    loop = build_live_loop(
        live_scenario, planner, max_delay=max_delay, max_lead=max_lead, decide_every=decide_every, seed=seed
    )
    screen = None
    if any(source.kind == "ws" for source in sources):
        from vedette.reports.live import LiveScreen

        screen = LiveScreen(live_scenario.scenario, loop, lambda: persistent.state)
        loop = screen.live
    options = (max_delay, max_lead, speed, planner if loop.planner else "", decide_every, planning_timeout, seed)
    identity = hashlib.sha256(repr(options).encode() + sensors.read_bytes()).hexdigest()
    import asyncio

    with interruptible("what came is kept where --snapshot or --record say so"):
        compile_if_cold(live_scenario.scenario)
        persistent = PersistentLoop(
            loop, identity=identity, snapshot=snapshot, snapshot_interval=snapshot_interval, record=record, report=note
        )
        try:
            with compiling():
                for answers in persistent.resume():
                    _print_answers(answers)
                asyncio.run(_listen(persistent, screen, sources, token))
        finally:
            persistent.close()
    emit_json(_document(persistent))


class _Source(NamedTuple):
    """A source of lines: stdin, tcp or ws, with its address."""

    kind: str
    host: str = ""
    port: int = 0


def _parse_source(listen: str) -> _Source:
    if listen == "stdin":
        return _Source(listen)
    kind, _, address = listen.rpartition("://")
    host, _, port = address.rstrip("/").rpartition(":")
    if kind not in ("tcp", "ws") or not host or not port.isdecimal() or int(port) > 65535:
        raise usage_error(f"expected stdin, tcp://HOST:PORT or ws://HOST:PORT; got {listen!r}", "--listen")
    return _Source(kind, host.strip("[]"), int(port))


def _print_answers(answers: Iterable[dict[str, Any]]) -> None:
    from vedette.live import encode_line

    for answer in answers:
        echo(encode_line(answer).decode(), nl=False)


async def _listen(
    persistent: PersistentLoop, screen: LiveScreen | None, sources: Sequence[_Source], token: str | None
) -> None:
    """Process lines until standard input ends, or until Ctrl-C if there are clients; do not wait for them."""
    import asyncio

    from vedette.live import LineServer, TcpServer, iter_lines

    def process(line: bytes) -> Iterable[dict[str, Any]]:
        answers = persistent.process(line)
        _print_answers(answers)
        if screen is not None:
            screen.note(answers)
        return answers

    line_server = LineServer(process, token, note)
    async with contextlib.AsyncExitStack() as servers:
        for source in sources:
            if source.kind == "tcp":
                server: Any = await TcpServer(line_server).listen(source.host, source.port)
            elif screen is not None and source.kind == "ws":
                from vedette.live.web import WebServer

                server = await WebServer(line_server, screen, source.host).listen(source.port)
            else:
                continue
            servers.callback(server.close)
            host, port = server.sockets[0].getsockname()[:2]
            address = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
            note(
                f"listens on {source.kind}://{address}"
                + (f"; the page is http://{address}/" if source.kind == "ws" else "")
            )
        if any(source.kind == "stdin" for source in sources):
            async for line in iter_lines(sys.stdin.buffer):
                await line_server.answer(line, None)
        if any(source.kind != "stdin" for source in sources):
            await asyncio.Event().wait()


def _document(persistent: PersistentLoop) -> dict[str, Any]:
    state = persistent.state
    timeline = state.timeline
    return {
        "lines": state.num_lines,
        "errors": state.num_errors,
        "scans": timeline.num_processed,
        "late": timeline.num_late,
        "dropped": timeline.num_dropped,
        "repeated": timeline.num_repeated,
        "decisions": state.num_decisions,
    }
