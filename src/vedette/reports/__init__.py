"""Reports of a campaign or a single run: a self-contained HTML page, and figures for papers."""

from vedette.internal.extras import require_packages

require_packages("a report", "jinja2", "matplotlib", "pyarrow")

from vedette.reports.html import replay_code, write_demo, write_report
from vedette.reports.saving import write_figures, write_run_figures, write_summary
from vedette.reports.single import write_run_report

__all__ = [
    "replay_code",
    "write_demo",
    "write_figures",
    "write_report",
    "write_run_figures",
    "write_run_report",
    "write_summary",
]
