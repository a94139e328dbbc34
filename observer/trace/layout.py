"""What a trace is made of: its files in a run directory and the metadata in each."""

from pathlib import Path

from mcap.writer import MCAP0_MAGIC

SCENARIO = "scenario"
"""Metadata record with the `name` of the swarm and the resolved scenario as `toml`."""
RECORDER = "recorder"
"""Metadata record with how many messages the recorder `dropped`; the last one in a file counts."""


def trace_file(folder: Path, number: int) -> Path:
    """Returns the name of the n-th trace in a run directory: `trace.mcap`, `trace-2.mcap`, ..."""
    return folder / ("trace.mcap" if number == 1 else f"trace-{number}.mcap")


def trace_files(folder: Path) -> tuple[Path, ...]:
    """Returns the traces in a run directory that hold anything at all, oldest first."""
    found = sorted(folder.glob("trace*.mcap"), key=_number)
    return tuple(path for path in found if path.stat().st_size > len(MCAP0_MAGIC))


def _number(path: Path) -> int:
    suffix = path.stem.removeprefix("trace-")
    return int(suffix) if suffix.isdecimal() else 1
