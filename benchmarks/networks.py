"""The ways of making one picture of several sensors' scans, side by side on the scenes of docs/networks.md.

    python benchmarks/networks.py                                              # every campaign network-*.toml
    python benchmarks/networks.py examples/campaigns/network-three-positions.toml --runs 200 --workers 2

Runs each campaign, in a folder that is kept (`--out`), and goes on with one that is there; then prints a Markdown
table for each of its settings. Runs are paired: at the same number every rule meets the same truth and the same
scans. OSPA and its parts are means over scans and runs, with one standard error over the runs; "N bias" is the number
of estimates minus that of targets; "tracked" the share of the targets seen by some sensor that have an estimate;
times are wall time of filters and fusion, all sensors together, in a process of one thread; "kB per scan" what all
sensors together send, in units of 1000 bytes, numbers of 8 bytes uncompressed.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import campaign_tables
import numpy as np

from vedette.campaigns import CampaignResults, load_spec
from vedette.campaigns.results import GroupComparison
from vedette.evaluation.tail_summary import tail_sentence
from vedette.internal.text import named_in

CAMPAIGNS = Path(__file__).parents[1] / "examples/campaigns"
STAGES = ("filter", "fusion")
TRACKED = "tracked_fraction"  # as the scenes name the measure


def table(results: CampaignResults, group: GroupComparison) -> Iterator[str]:
    """The lines of the table of one setting."""
    comparison = group.comparison
    first = group.cells[0].name
    shares = [name for name in results.metrics(first, results.finished(first)[0]).custom if name == TRACKED]
    names = ["Rule", named_in("OSPA", comparison.unit), "Localisation", "Cardinality", "N bias"]
    names += [*(["tracked"] * len(shares)), "ms per scan", "kB per scan"]
    yield "| " + " | ".join(names) + " |"
    yield "| --- |" + " ---: |" * (len(names) - 1)
    for label, cell in zip(group.labels, group.cells, strict=True):
        score = comparison.summary(label)
        parts = [f"{float(comparison.summary(label, part).mean):.3f}" for part in ("localisation", "cardinality")]
        bias = f"{float(comparison.summary(label, 'cardinality_error').mean):+.3f}".replace("-", "\N{MINUS SIGN}")
        tracked = [f"{100.0 * float(comparison.summary(label, name).mean):.1f} %" for name in shares]
        error = f"{float(score.mean):.3f} ± {float(score.standard_error):.3f}"
        costs = (f"{scan_ms(results, cell.name):.1f}", f"{scan_kilobytes(results, cell.name):.1f}")
        yield "| " + " | ".join([label, error, *parts, bias, *tracked, *costs]) + " |"
    yield ""
    yield f"{comparison.num_runs} paired runs of {comparison.scenario}. {tail_sentence(comparison)}"


def scan_ms(results: CampaignResults, cell: str) -> float:
    """Median over the runs of a cell of the mean time that filters and fusion took for a scan, ms."""
    timings = [results.record(cell, run).timings for run in results.finished(cell)]
    return float(np.median([1e3 * sum(spent[stage].mean() for stage in STAGES if stage in spent) for spent in timings]))


def scan_kilobytes(results: CampaignResults, cell: str) -> float:
    """Mean over scans and runs of a cell of what all sensors together sent at a scan, kB."""
    sent = [results.record(cell, run).health.bytes_sent.sum(axis=1).mean() for run in results.finished(cell)]
    return float(np.mean(sent)) / 1e3


def main() -> None:
    parser = campaign_tables.parser(__doc__ or "", "network-results")
    parser.add_argument("specs", nargs="*", type=Path, help="campaigns; none: all network-*.toml of the examples")
    given = parser.parse_args()
    for path in given.specs or sorted(CAMPAIGNS.glob("network-*.toml")):
        results = campaign_tables.run(load_spec(path), given.out / path.stem, given, path.parent)
        campaign_tables.print_tables(results, table)


if __name__ == "__main__":
    main()
