"""`swarmtouch trace export`: for Foxglove, Lichtblick and PlotJuggler, or as tables."""

from pathlib import Path

from observer.trace.foxglove import export_foxglove
from observer.trace.read import open_trace
from observer.trace.tables import export_csv
from shared.errors import ConfigError
from shared.files import writing


def main(*, run: Path, foxglove: Path | None, csv: Path | None) -> int:
    """Writes what was asked for; returns the exit code, 1 if the trace holds nothing."""
    if foxglove is None and csv is None:
        raise ConfigError("trace export: as what? Name --foxglove FILE or --csv DIR, or both")
    trace = open_trace(run)
    if foxglove is not None and any(foxglove.resolve() == file.resolve() for file in trace.files):
        raise ConfigError(f"--foxglove {foxglove}: that is the trace itself; name another file")
    written = 0
    if foxglove is not None:
        with writing(foxglove):
            written = export_foxglove(trace, foxglove)
        print(f"{foxglove}: {written} messages")
    if csv is not None:
        with writing(csv):
            tables, left_out = export_csv(trace, csv)
        written += len(tables) - 1
        print(f"{csv}: {len(tables)} tables")
        if left_out:
            print(f"{csv}: {left_out} or more columns that somebody made up were left out")
    for fault in trace.faults:
        print(f"{run}: {fault}")
    if rejected := sum(trace.rejected.values()):
        print(f"{run}: {rejected} payloads are no valid message and were left out")
    return 0 if written else 1
