"""How good it was: OSPA, statistics over paired runs, tables; figures are in `vedette.evaluation.figures`."""

from vedette.evaluation.comparison import Comparison, chosen_headings_deg, compare
from vedette.evaluation.metrics import OspaResult, ospa, ospa_of_run
from vedette.evaluation.statistics import PairedDifference, Summary, paired_difference, summarise
from vedette.evaluation.tables import decision_rows, strategy_csv, strategy_markdown, strategy_rows

__all__ = [
    "Comparison",
    "OspaResult",
    "PairedDifference",
    "Summary",
    "chosen_headings_deg",
    "compare",
    "decision_rows",
    "ospa",
    "ospa_of_run",
    "paired_difference",
    "strategy_csv",
    "strategy_markdown",
    "strategy_rows",
    "summarise",
]
