"""Every benchmark that a user feels, as one table: by itself, or turn about with another checkout.

    python benchmarks/all.py --quick                         # about two minutes
    python benchmarks/all.py --against OTHER/src             # in pairs, turn about
    python benchmarks/all.py --against OTHER/src --figure docs/images/benchmarks.png --write docs/performance.md
    python benchmarks/all.py --only scan decision            # groups, or parts of names

Each library runs in a process of its own with one thread; before each pair of rounds they change who is first. Printed
are the least and the median over the rounds, and how many times as fast this checkout is: the median of the ratios
of the pairs. What another checkout does not have, or has under other names, is a dash. Times are CPU time, of a
campaign wall time. Peers are those of `benchmarks/peers.py`, where they are installed for `--peers-python`.

Both are timed by the modules of this folder, each of which says by `measures()` what it can time.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pages import write_between
from timing import Figures, Measure

MODULES = (
    "filter_scan", "planning", "many_sensors", "crowd", "central_scan", "fusion_rules", "eight_sensors", "store",
    "whole_run", "start", "campaign", "gym_steps",
)  # fmt: skip
HERE = Path(__file__).resolve().parent
QUICK_ROUNDS = 3


def all_measures() -> Iterator[Measure]:
    """Of all modules that this library can be timed by."""
    for name in MODULES:
        if not (HERE / f"{name}.py").exists():
            continue
        try:
            module = importlib.import_module(name)
        except ImportError as error:
            print(f"{name}: left out: {error}", file=sys.stderr)
            continue
        yield from getattr(module, "measures", tuple)()


def serve() -> None:
    """Answer each line, the key of a measure, with one figure of it; what else is printed goes to the errors."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    known = {measure.key: measure for measure in all_measures()}
    current, once = "", None
    for line in sys.stdin:
        key = line.strip()
        try:
            if key != current:
                current, once = key, None
                once = known[key].prepare()
            assert once is not None, "it could not be prepared"
            told: dict[str, Any] = {"value": once()}
        except Exception as error:  # of another checkout, nearly anything
            told = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(told), file=answers, flush=True)


class Library:
    """A checkout that is timed, in a process of its own."""

    def __init__(self, source: Path) -> None:
        environment = {**os.environ, "PYTHONPATH": str(source), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [sys.executable, str(HERE / "all.py"), "--serve"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        self.faults: dict[str, str] = {}

    def figure(self, key: str) -> float | None:
        """One figure of a measure; None, and a word in `faults`, where it has none."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        if key in self.faults:
            return None
        self._process.stdin.write(f"{key}\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        told = json.loads(answer) if answer else {"error": "the process ended"}
        if "error" in told:
            self.faults[key] = told["error"]
            return None
        return float(told["value"])

    def close(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


@dataclass(frozen=True)
class Line:
    """What was found of one measure, of this checkout and of the other."""

    measure: Measure
    own: Figures | None
    other: Figures | None
    ratio: float | None


def timed(measure: Measure, own: Library, other: Library | None, rounds: int) -> Line:
    """All rounds of a measure, the libraries turn about."""
    pairs: list[tuple[float | None, float | None]] = []
    for number in range(rounds):
        if other is None:
            pairs.append((own.figure(measure.key), None))
        elif number % 2:
            theirs = other.figure(measure.key)
            pairs.append((own.figure(measure.key), theirs))
        else:
            pairs.append((own.figure(measure.key), other.figure(measure.key)))
    mine, theirs_all = ([value for value in side if value is not None] for side in zip(*pairs, strict=True))
    ratios = [theirs / ours for ours, theirs in pairs if ours and theirs]
    return Line(
        measure,
        Figures.of(mine) if mine else None,
        Figures.of(theirs_all) if theirs_all else None,
        statistics.median(ratios) if ratios else None,
    )


def markdown(lines: Sequence[Line], *, paired: bool) -> str:
    """The table."""
    head = "| what | unit | least | median |" + (" least before | median before | times as fast |" if paired else "")
    rows = [head, "|---|---|---:|---:|" + ("---:|---:|---:|" if paired else "")]
    for line in lines:
        row = f"| {line.measure.key} | {line.measure.unit} | {_both(line.own)} |"
        if paired:
            row += f" {_both(line.other)} | {'-' if line.ratio is None else f'{line.ratio:.2f}'} |"
        rows.append(row)
    return "\n".join(rows)


def _both(figures: Figures | None) -> str:
    return "- | -" if figures is None else " | ".join(map(_short, figures))


def _short(value: float) -> str:
    return f"{value:,.3g}" if value < 100 else f"{value:,.0f}"


def draw(lines: Sequence[Line], path: Path) -> None:
    """The least of each measure as a bar, this checkout's before the other's."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    known = [line for line in lines if line.own is not None]
    figure, axis = plt.subplots(figsize=(9.0, 1.2 + 0.3 * len(known)), layout="constrained")
    for place, line in enumerate(known):
        assert line.own is not None
        scale = 1e3 if line.measure.unit == "s" else 1.0
        if line.other is not None:
            axis.barh(
                place, scale * line.other.least, height=0.75, color="0.82", label="before" if place == 0 else None
            )
        axis.barh(place, scale * line.own.least, height=0.45, color="C0", label="now" if place == 0 else None)
        text = f"{_short(line.own.least)} {line.measure.unit}"
        text += "" if line.ratio is None else f", {line.ratio:.1f} times as fast"
        most = scale * max(line.own.least, line.other.least if line.other else 0.0)
        axis.annotate(text, (most, place), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8)
    axis.set_yticks(range(len(known)), [line.measure.key for line in known], fontsize=8)
    axis.set_ylim(len(known) - 0.4, -0.6)
    axis.set(xscale="log", xlabel="least time, ms (CPU time of one thread; of a campaign wall time)")
    axis.set_xlim(right=axis.get_xlim()[1] * 20.0)
    axis.grid(True, axis="x", alpha=0.4)
    if any(line.other for line in known):
        axis.legend(loc="upper right", frameon=False)
    figure.savefig(path, dpi=130)
    print(f"wrote {path}")


def wanted(only: Sequence[str], *, quick: bool) -> list[Measure]:
    """The measures that are asked for; quickly, those that are not long."""
    found = [measure for measure in all_measures() if not (quick and measure.long)]
    return [measure for measure in found if not only or any(part in measure.key for part in only)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few rounds, and nothing that takes long")
    parser.add_argument("--against", type=Path, metavar="SRC", help="folder of sources of another checkout")
    parser.add_argument("--only", nargs="+", default=(), metavar="PART", help="of the names of what to time")
    parser.add_argument("--rounds", type=int, help="of each measure, instead of its own number")
    parser.add_argument("--peers-python", default=os.environ.get("PEERS_PYTHON", sys.executable))
    parser.add_argument("--no-peers", action="store_true")
    parser.add_argument("--figure", type=Path, help="file to draw")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="Markdown page with a place for each table")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve:
        serve()
        return
    own = Library(HERE.parent / "src")
    other = Library(given.against.resolve()) if given.against else None
    lines = []
    for measure in wanted(given.only, quick=given.quick):
        rounds = given.rounds or (min(QUICK_ROUNDS, measure.rounds) if given.quick else measure.rounds)
        lines.append(timed(measure, own, other, rounds))
        print(markdown(lines[-1:], paired=other is not None).splitlines()[-1], flush=True)
    for library in filter(None, (own, other)):
        library.close()
    faults = "\n".join(f"{key}: {fault}" for key, fault in own.faults.items())
    text = markdown(lines, paired=other is not None)
    beside = "" if given.no_peers or given.only else peers_table(given.peers_python, quick=given.quick)
    print(f"\n{text}\n\n{beside}\n{faults}")
    if given.write:
        write_between(given.write, "all.py", text)
        if beside:
            write_between(given.write, "peers.py", beside)
    if given.figure:
        draw(lines, given.figure)


def peers_table(python: str, *, quick: bool) -> str:
    """Ours beside those that are installed."""
    import peers

    sizes, objects, steps = ((10, 30), (20,), 10) if quick else ((10, 30, 100, 300, 1000), (10, 20, 50), 20)
    return peers.table(list(peers.all_rows(python, sizes, objects, steps)))


if __name__ == "__main__":
    main()
