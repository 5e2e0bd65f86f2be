"""The command that tracks scans as they arrive: live."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from vedette.cli.compiling import compiling
from vedette.cli.completing import strategies
from vedette.cli.listening import Source, listen_to, parse_sources, print_answers
from vedette.cli.options import Seed, Speed, Trust
from vedette.cli.output import emit_json, note
from vedette.cli.running import CodeTrust, check_planner, compile_if_cold, interruptible
from vedette.cli.scenario_files import note_assumptions, print_warnings

if TYPE_CHECKING:
    from vedette.live import LiveLoop, PersistentLoop
    from vedette.reports.live import LiveScreen
    from vedette.scenarios.from_recording import LiveScenario


SensorsOrScenario = Annotated[Path, typer.Option("--sensors", metavar="FILE", help="Sensors file or scenario (YAML).")]
MaxDelay = Annotated[
    float,
    typer.Option(
        "--max-delay", metavar="SECONDS", min=0.001, help="Accept scans up to this late; older ones are dropped."
    ),
]
MaxLead = Annotated[
    float,
    typer.Option(
        "--max-lead",
        metavar="SECONDS",
        min=0.001,
        help="Reject a time stamp further ahead than this, unless several sensors agree.",
    ),
]
PlannerName = Annotated[
    str,
    typer.Option(
        "--planner",
        metavar="NAME",
        help='Planner, as in `vedette run`; "stationary": no decisions.',
        autocompletion=strategies,
    ),
]
DecideEvery = Annotated[
    float | None,
    typer.Option(
        "--decide-every",
        metavar="SECONDS",
        min=0.001,
        help="Interval between decisions; default: `control` in the scenario.",
    ),
]
PlanningTimeout = Annotated[
    float | None,
    typer.Option(
        "--planning-timeout",
        metavar="SECONDS",
        min=0.001,
        help="Use the best action found so far after this time; default: no limit.",
    ),
]
Snapshot = Annotated[
    Path | None,
    typer.Option(
        "--snapshot", metavar="FILE", help="Save the state to FILE regularly, and resume from it if it exists."
    ),
]
SnapshotInterval = Annotated[
    float, typer.Option("--snapshot-interval", metavar="SECONDS", min=0.0, help="Interval between snapshots.")
]
Record = Annotated[
    Path | None,
    typer.Option("--record", metavar="FILE", help="Append every input line to FILE; replayed on resume."),
]
Listen = Annotated[
    list[str] | None,
    typer.Option(
        "--listen",
        metavar="ADDRESS",
        help="stdin (default), tcp://HOST:PORT, or ws://HOST:PORT (also serves a web page). May be repeated.",
    ),
]
Token = Annotated[
    str | None,
    typer.Option(
        "--token",
        metavar="TEXT",
        envvar="VEDETTE_TOKEN",
        help="Token that clients must send. Required for addresses other than loopback.",
    ),
]


def live(
    sensors: SensorsOrScenario,
    max_delay: MaxDelay = 30.0,
    max_lead: MaxLead = 60.0,
    speed: Speed = 10.0,
    planner: PlannerName = "jdm",
    decide_every: DecideEvery = None,
    planning_timeout: PlanningTimeout = None,
    snapshot: Snapshot = None,
    snapshot_interval: SnapshotInterval = 10.0,
    record: Record = None,
    listen: Listen = None,
    token: Token = None,
    seed: Seed = 0,
    trust: Trust = False,
) -> None:
    """Track scans as they arrive.

    Reads one JSON line per scan, and writes estimates, and plans when a decision is due.
    """
    from vedette.live import PersistentLoop, build_live_loop

    sources = parse_sources(listen or ["stdin"], token)
    options = _LoopOptions(max_delay, max_lead, speed, planner, decide_every, planning_timeout, seed)
    live_scenario = _read_scenario(sensors, options, trust)
    loop = build_live_loop(
        live_scenario, planner, max_delay=max_delay, max_lead=max_lead, decide_every=decide_every, seed=seed
    )
    in_use = options if loop.planner else options._replace(planner="")
    identity = hashlib.sha256(repr(tuple(in_use)).encode() + sensors.read_bytes()).hexdigest()
    screen = None
    if any(source.kind == "ws" for source in sources):
        from vedette.reports.live import LiveScreen

        screen = LiveScreen(live_scenario.scenario, loop, lambda: persistent.state)
        loop = screen.live
    with interruptible("what came is kept where --snapshot or --record say so"):
        _compile(live_scenario, loop)
        persistent = PersistentLoop(
            loop, identity=identity, snapshot=snapshot, snapshot_interval=snapshot_interval, record=record, report=note
        )
        _process(persistent, screen, sources, token)
    emit_json(_document(persistent))


class _LoopOptions(NamedTuple):
    """Options that change the answers. A snapshot or record made with others is refused."""

    max_delay: float
    max_lead: float
    speed: float
    planner: str
    decide_every: float | None
    planning_timeout: float | None
    seed: int


def _read_scenario(sensors: Path, options: _LoopOptions, trust: bool) -> LiveScenario:
    from vedette.scenarios.from_recording import scenario_from_sensors

    live_scenario = scenario_from_sensors(
        sensors, speed=options.speed, decide_every=options.decide_every, plan_within=options.planning_timeout
    )
    check_planner(live_scenario.scenario, options.planner, "--planner")
    CodeTrust(trust)(live_scenario.scenario)
    print_warnings(live_scenario.scenario)
    note_assumptions(live_scenario.assumed, sensors)
    return live_scenario


def _compile(live_scenario: LiveScenario, loop: LiveLoop) -> None:
    """Compile what the loop calls, as clients would wait for it."""
    from vedette.live.building import warm_up
    from vedette.scenarios.trust import custom_code

    compile_if_cold(live_scenario.scenario)
    if not custom_code(live_scenario.scenario.model):
        with compiling():
            warm_up(loop)


def _process(
    persistent: PersistentLoop, screen: LiveScreen | None, sources: Sequence[Source], token: str | None
) -> None:
    """Answer the lines of the record again, then those that arrive."""
    import asyncio

    try:
        with compiling():
            for answers in persistent.resume():
                print_answers(answers)
            asyncio.run(listen_to(persistent, screen, sources, token))
    finally:
        persistent.close()


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
        "fit": state.fit.fit.to_dict(),
    }
