"""Whether what filters and fusions believe is true: said against found, where the truth is drawn from the very model.

    python benchmarks/beliefs.py [--detection P ...] [--runs N] [--cases WORD ...] [--errors E ...] [--summary]
    python benchmarks/beliefs.py --summary --write docs/filters.md

Four sites give birth with probability 0.06 at each of 25 scans; targets live on with 0.95 and are detected with P by
each position sensor, among 10 false measurements a scan. Each run draws targets from just this, so each of the 100
labels (step, site) exists or not at each scan, and the number of targets is a draw from its posterior where that is
right.

Prints of each filter, and of each way to take two sensors' scans or beliefs together, a Markdown table: the labels and
scans of which an existence between two bounds was said, the mean that was said, and the share that exists with its
standard error (runs are independent, scans of a run are not). Labels that a belief does not hold are said not to exist.

Then a table of a line each: the largest difference of said and found over the bins of more than 500, with its standard
error; the log loss and Brier score of the labels, summed over them, a scan, existences held in 1e-6 to 1 - 1e-6; what
the ranks of the true number in its posterior distribution (ties broken at random) differ from uniform, as the largest
distance of the distribution functions, 0 to 1; OSPA (c = 100 m, p = 1); CPU milliseconds a scan. Filters without labels
have the number alone. And what share exists of what was said, a line each. Equal arguments print equal tables, but for
the times.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path

from pages import write_between

from calibration import BOUNDS, ENOUGH, SEED, Calibration, Case, calibration, cases


def bin_table(found: Calibration) -> Iterator[str]:
    """Said against found."""
    yield "| said from | to | labels and scans | said | exist |"
    yield "|---:|---:|---:|---:|---:|"
    for low, high, (number, said, true, error) in zip(BOUNDS[:-1], BOUNDS[1:], found.bins(), strict=True):
        if number:
            yield f"| {low:g} | {high:g} | {number:.0f} | {said:.3f} | {true:.3f} ± {error:.3f} |"


def summary_table(told: Sequence[tuple[Case, Calibration]]) -> Iterator[str]:
    """A line each: the scores."""
    yield "| beliefs | largest difference | log loss | Brier | ranks | OSPA, m | ms |"
    yield "|---|---:|---:|---:|---:|---:|---:|"
    for case, found in told:
        labels = " | | "
        if case.labels:
            worst, error = found.worst
            labels = f"{worst:.3f} ± {error:.3f} | {found.log_loss:.3f} | {found.brier:.3f}"
        yield f"| {case.name} | {labels} | {found.rank_deviation:.3f} | {found.ospa:.2f} | {found.milliseconds:.2f} |"


def shares_table(told: Sequence[tuple[Case, Calibration]]) -> Iterator[str]:
    """A line each: what share exists of what was said, in brackets where that is too few to judge by."""
    yield "| beliefs | " + " | ".join(f"{low:g} to {high:g}" for low, high in itertools.pairwise(BOUNDS)) + " |"
    yield "|---|" + "---:|" * (len(BOUNDS) - 1)
    for case, found in told:
        if case.labels:
            yield f"| {case.name} | " + " | ".join(_share(*row[:3]) for row in found.bins()) + " |"


def _share(number: float, said: float, true: float) -> str:
    if not number:
        return ""
    return f"{true:.3f} of {said:.3f}" if number > ENOUGH else f"({true:.3f} of {said:.3f})"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--detection", type=float, nargs="+", default=[0.7, 0.95], help="of each sensor")
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--cases", nargs="+", default=[""], help="words in their names; all")
    parser.add_argument(
        "--errors", type=float, nargs="*", default=[], help="further split errors of the factored filter"
    )
    parser.add_argument("--summary", action="store_true", help="without the tables of each")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="Markdown page with a place for the tables of all")
    options = parser.parse_args(arguments)
    texts = []
    for detection in options.detection:
        title = f"P_D {detection:g}, {options.runs} runs, seed {SEED}"
        print(f"\n## {title}", flush=True)
        told = []
        for case in cases(options.errors):
            if any(word in case.name for word in options.cases):
                told.append((case, calibration(case, detection, options.runs)))
                if case.labels and not options.summary:
                    print("\n".join(["", f"### {case.name}", "", *bin_table(told[-1][1])]), flush=True)
        texts.append("\n".join([f"{title}:", "", *summary_table(told), "", *shares_table(told)]))
        print(f"\n{texts[-1]}", flush=True)
    if options.write:
        write_between(options.write, "beliefs.py", "\n\n".join(texts))


if __name__ == "__main__":
    main()
