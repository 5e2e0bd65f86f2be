"""Tables that compare strategies, as text, Markdown, LaTeX and CSV."""

import csv
import io
import itertools
import re
from collections.abc import Mapping

import numpy as np

from vedette.evaluation.actions import describe_choice
from vedette.evaluation.comparison import Comparison
from vedette.evaluation.ensembles import PARTS
from vedette.evaluation.statistics import CONFIDENCE, Summary, summarise
from vedette.evaluation.tail_summary import strategy_tail, tail_sentence
from vedette.internal.text import markdown_table, named_in, spreadsheet_text, with_error

_ESCAPED = str.maketrans(
    {
        **{letter: f"\\{letter}" for letter in "&%$#_{}"},
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "\\": r"\textbackslash{}",
        "\N{MINUS SIGN}": "-",
    }
)
_NUMBER = re.compile(r"(?<![\w.])[+-][0-9.]+")  # with a sign, which LaTeX text would print as a hyphen
_ERRORS = ("OSPA", "Localisation", "Cardinality", "Difference")


def header(comparison: Comparison) -> tuple[str, ...]:
    """Return the names of the columns of `strategy_rows`."""
    return ("Strategy", *(named_in(name, comparison.unit) for name in _ERRORS), "95 % interval", "Runs won")


def strategy_rows(comparison: Comparison) -> list[tuple[str, ...]]:
    """Return one row for each strategy: mean OSPA with standard error, its parts, and the paired difference.

    The columns are those of `header`. The difference is strategy minus the first strategy, so positive if the first is
    better. "Runs won" is the share of runs that the first strategy wins, and the share of ties if there are any. The
    first row has no difference.
    """
    return [_row(comparison, strategy) for strategy in comparison.strategies]


def decision_rows(comparison: Comparison, strategy: str, *, at_most: int = 3) -> list[tuple[str, str]]:
    """Return for each decision of a strategy its time, and the most frequent combinations of actions with shares."""
    rows = []
    for decision, time in enumerate(comparison.decision_times):
        shares = list(comparison.decision_shares(strategy, decision).items())[:at_most]
        if not shares:
            continue
        rows.append((f"{time:g} s", ", ".join(f"({describe_choice(choice)}) {share:.0%}" for choice, share in shares)))
    return rows


def strategy_markdown(comparison: Comparison) -> str:
    """Return the table as Markdown, with its caption below."""
    table = markdown_table(header(comparison), strategy_rows(comparison))
    return "\n".join([table, *filter(None, (caption(comparison), tail_sentence(comparison))), ""])


def strategy_latex(comparison: Comparison) -> str:
    """Return the table as LaTeX (package booktabs) with its caption, in an environment `table`."""
    rows = [tuple(map(_latex, row)) for row in (header(comparison), *strategy_rows(comparison))]
    lines = [f"{' & '.join(row)} \\\\" for row in rows]
    caption_text = " ".join(filter(None, (caption(comparison), tail_sentence(comparison))))
    body = "\n".join(["\\toprule", lines[0], "\\midrule", *lines[1:], "\\bottomrule"])
    return (
        f"\\begin{{table}}\n\\centering\n\\caption{{{_latex(caption_text)}}}\n"
        f"\\begin{{tabular}}{{l{'r' * (len(rows[0]) - 1)}}}\n{body}\n\\end{{tabular}}\n\\end{{table}}\n"
    )


def _latex(text: str) -> str:
    """Return text for LaTeX: special characters escaped, signed numbers and signs of arithmetic in mathematics."""
    return _NUMBER.sub(lambda match: f"${match[0]}$", text.translate(_ESCAPED)).replace("±", "$\\pm$")


def significance(comparison: Comparison) -> str:
    """Return which differences to the first strategy are significant at 5 %, in a sentence, empty for a single run."""
    others = list(zip(comparison.strategies, comparison.p_values(), strict=True))[1:]
    if not others or comparison.num_runs < 2:
        return ""
    significant = [name for name, p_value in others if p_value <= 1.0 - CONFIDENCE]
    insignificant = [name for name, _ in others if name not in significant]
    corrected = " (Holm correction)" if len(others) > 1 else ""
    if not insignificant:
        subject = "The difference is" if len(others) == 1 else f"All {len(others)} differences are"
        return f"{subject} significant at 5 %{corrected}."
    if not significant:
        return f"No difference is significant at 5 %{corrected}."
    return f"Significant at 5 %{corrected}: {', '.join(significant)}; not significant: {', '.join(insignificant)}."


def decisions_markdown(comparison: Comparison) -> str:
    """Return the decisions of each strategy and their frequencies, as Markdown."""
    rows = [
        (strategy, time, shares)
        for strategy in comparison.strategies
        for time, shares in decision_rows(comparison, strategy)
    ]
    return markdown_table(("Strategy", "Time", "Actions and share of the runs"), rows, numbers=False)


def strategy_csv(comparisons: Mapping[str, Comparison] | Comparison) -> str:
    """Return the unrounded numbers of the table as CSV, one row per strategy, several comparisons with their names."""
    if isinstance(comparisons, Comparison):
        rows = [strategy_numbers(comparisons, strategy) for strategy in comparisons.strategies]
    else:
        rows = [
            {"group": spreadsheet_text(name), **strategy_numbers(comparison, strategy)}
            for name, comparison in comparisons.items()
            for strategy in comparison.strategies
        ]
    out = io.StringIO()
    columns = list(dict.fromkeys(name for row in rows for name in row))  # comparisons may have other measures
    writer = csv.DictWriter(out, columns, lineterminator="\n")
    if rows:
        writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def strategy_numbers(comparison: Comparison, strategy: str) -> dict[str, str | float]:
    """Return the unrounded numbers of a strategy by name: errors, the paired difference, measures."""
    difference = comparison.difference(strategy)
    paired = difference.summary
    columns = [(part, "ospa" if part == "total" else part) for part in PARTS]
    parts = [_means(comparison, strategy, part, f"{name}_mean_m", f"{name}_se_m") for part, name in columns]
    measures = [_means(comparison, strategy, name, f"{name}_mean", f"{name}_se") for name in comparison.measures]
    tail = strategy_tail(comparison, strategy)
    return {
        "strategy": spreadsheet_text(strategy),
        "runs": comparison.num_runs,
        **dict(itertools.chain(*parts)),
        "median_m": tail.median,
        "worst_m": tail.worst,
        "share_lost": tail.lost,
        "difference_m": float(paired.mean),
        "difference_se_m": float(paired.standard_error),
        "ci_low_m": float(paired.low),
        "ci_high_m": float(paired.high),
        "interval": "bootstrap" if difference.is_skewed else "t",
        "p_value": difference.p_value,
        "p_holm": float(comparison.p_values()[comparison.strategies.index(strategy)]),
        "win_rate": difference.win_rate,
        **dict(itertools.chain(*measures)),
    }


def _means(comparison: Comparison, strategy: str, part: str, *names: str) -> list[tuple[str, float]]:
    """Return the mean over the runs that have a value, and its standard error, under these names."""
    means = comparison.run_means(strategy, part)
    known = means[~np.isnan(means)]
    summary = summarise(known) if len(known) else None
    values = (float(summary.mean), float(summary.standard_error)) if summary else (np.nan, np.nan)
    return list(zip(names, values, strict=True))


def caption(comparison: Comparison) -> str:
    """Return the caption of the table: heading and legend in one paragraph."""
    return f"{heading(comparison)}. {legend(comparison)}".rstrip()


def heading(comparison: Comparison) -> str:
    """Return scenario, number of runs and time window: `paper-a: 30 paired runs, mean OSPA over t = 11 to 40 s`."""
    times = comparison.times[comparison.counted]
    paired = "paired " if len(comparison.strategies) > 1 else ""
    runs = f"{comparison.num_runs} {paired}runs" if comparison.num_runs > 1 else "1 run"
    return f"{comparison.scenario}: {runs}, mean OSPA over t = {times[0]:g} to {times[-1]:g} s"


def legend(comparison: Comparison) -> str:
    """Return the meaning of the table's columns, in sentences, empty for one run of one strategy."""
    first, several = comparison.strategies[0], comparison.num_runs > 1
    parts = ["± is one standard error."] if several else []
    if len(comparison.strategies) > 1:
        parts.append(f"Difference: strategy minus {first}, so positive values mean a larger error than {first}.")
        if several:
            parts.append(f"Won: share of the runs in which {first} has the smaller error.")
    skewed = [name for name in comparison.strategies[1:] if comparison.difference(name).is_skewed] if several else []
    if skewed:
        parts.append(f"Bootstrap intervals, because the differences are skewed: {', '.join(skewed)}.")
    return " ".join(parts)


def _row(comparison: Comparison, strategy: str) -> tuple[str, ...]:
    total = _mean_with_error(comparison.summary(strategy))
    parts = [f"{float(comparison.summary(strategy, part).mean):.2f}" for part in ("localisation", "cardinality")]
    if strategy == comparison.strategies[0]:
        return (strategy, total, *parts, "", "", "")
    difference = comparison.difference(strategy)
    interval = f"{difference.summary.low:+.2f} to {difference.summary.high:+.2f}"
    has_interval = comparison.num_runs > 1
    tied = f", {difference.tie_rate:.0%} tied" if difference.tie_rate > 0.0 else ""
    return (
        strategy,
        total,
        *parts,
        _mean_with_error(difference.summary, sign="+"),
        interval if has_interval else "unknown",
        f"{difference.win_rate:.0%}{tied}" if has_interval else "unknown",
    )


def _mean_with_error(summary: Summary, sign: str = "") -> str:
    return with_error(float(summary.mean), float(summary.standard_error), sign)
