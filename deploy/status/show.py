"""The status of a swarm for people, and for programs."""

from typing import Any

from rich import box
from rich.table import Table

from deploy.status.report import Row
from shared.plain_text import plain

_LONGEST_FORM = 16
_LEFT = ("process", "mode", "law", "how it is")


def status_table(rows: list[Row], title: str) -> Table:
    """Draws one row per process."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=0)
    for name in ("process", "mode", "height", "rate", "cpu", "memory", "law", "rejected", "how it is"):
        table.add_column(name, justify="left" if name in _LEFT else "right", no_wrap=name != "how it is")
    for row in rows:
        table.add_row(*_cells(row), style=None if row.well else "red")
    return table


def audit_table(rows: list[Row]) -> Table | None:
    """Draws who is linked to whom and who was refused, None for a swarm without keys."""
    if not any(row.links or row.refused for row in rows):
        return None
    table = Table(title="links by certificate, and who was refused", title_justify="left", box=box.SIMPLE_HEAD)
    for name in ("process", "linked to", "refused"):
        table.add_column(name, no_wrap=name == "process")
    for row in rows:
        refused = "\n".join(f"{who}: {n} times" for who, n in row.refused.items())
        table.add_row(
            row.token, ", ".join(sorted(row.links)), refused or "-", style="yellow" if row.refused else None
        )
    return table


def status_json(rows: list[Row]) -> list[dict[str, Any]]:
    """Returns one object per process: `process`, `well`, `problems`, and what it said of itself."""
    return [
        {
            "process": row.token,
            "well": row.well,
            "problems": list(row.problems),
            "mode": row.heard.state.mode.value if row.heard.state else None,
            "rate_hz": row.heard.status.rate_hz if row.heard.status else None,
            "cpu": row.heard.status.cpu if row.heard.status else None,
            "rss_mb": row.heard.status.rss_mb if row.heard.status else None,
            "form": row.heard.status.form if row.heard.status else None,
            "rejected": row.rejected,
            "links": row.links,
            "refused": row.refused,
        }
        for row in rows
    ]


def _cells(row: Row) -> tuple[str, ...]:
    state, status = row.heard.state, row.heard.status
    return (
        row.token,
        state.mode.value if state else "",
        f"{state.position[2]:.2f} m" if state else "",
        f"{status.rate_hz:.0f} Hz" if status else "-",
        f"{status.cpu:.0%}" if status else "-",
        f"{status.rss_mb:.0f} MB" if status else "-",
        plain(status.form.removeprefix("compiled "), _LONGEST_FORM) if status else "-",
        str(sum(status.rejected.values())) if status else "-",
        ", ".join(row.problems) or "well",
    )
