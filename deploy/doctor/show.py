"""The findings as a table."""

from collections.abc import Iterable

from rich import box
from rich.table import Table

from deploy.doctor.finding import Finding, Verdict

_STYLES = {Verdict.GOOD: None, Verdict.WARNING: "yellow", Verdict.BAD: "red"}


def findings_table(findings: Iterable[Finding]) -> Table:
    """Draws one row per finding."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1))
    table.add_column("")
    for name in ("what", "found", "what to do"):
        table.add_column(name)
    for finding in findings:
        table.add_row(
            finding.verdict, finding.subject, finding.found, finding.advice, style=_STYLES[finding.verdict]
        )
    return table
