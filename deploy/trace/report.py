"""`swarmtouch trace report`: the paper's figures and tables of a flight."""

from collections.abc import Sequence
from pathlib import Path

from shared.errors import ConfigError
from shared.files import writing
from shared.plain_text import plain


def main(*, runs: Sequence[Path], output: Path) -> int:
    """Writes the report; returns the exit code."""
    try:
        from observer.report.page import remarks  # noqa: PLC0415  the extra `plot`
        from observer.report.source import open_record  # noqa: PLC0415
        from observer.report.write import write_report  # noqa: PLC0415
    except ImportError as error:
        raise ConfigError(
            f"trace report needs {error.name}: install the extra, for example pip install 'swarmtouch[plot]'"
        ) from error
    flights = [open_record(run) for run in runs]
    with writing(output):
        page = write_report(flights, output)
    print(page)
    for remark in remarks(flights):
        print(plain(remark))
    return 0
