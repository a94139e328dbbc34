"""Which reader reads what: a trace, a flight folder or a ROS bag becomes one and the same record."""

from pathlib import Path

import numpy as np

from observer.report.record import ROW_HZ, FlightRecord
from observer.report.recordings import read_bag_flight, read_folder
from observer.report.trace import read_trace
from observer.trace.read import open_trace
from shared.errors import ConfigError

SHORTEST = 3.0
"""A shorter flight is not worth a report, s."""


def open_record(source: str | Path) -> FlightRecord:
    """Reads a recorded flight of any kind.

    Args:
        source: A run directory with a trace or its MCAP file, a flight folder (with `meta.json`), or a `.bag`.

    Raises:
        ConfigError: There is nothing, nothing readable, or too little at the path.
    """
    path = Path(source)
    record = _read(path)
    seconds = np.count_nonzero(np.isfinite(record.position).all(axis=(1, 2))) / ROW_HZ
    if seconds < SHORTEST:
        raise ConfigError(
            f"{path}: the formation flew for {seconds:.1f} s; a report needs at least {SHORTEST:g} s"
        )
    return record


def _read(path: Path) -> FlightRecord:
    if path.suffix == ".bag":
        return read_bag_flight(path)
    if (path / "meta.json").is_file():
        return read_folder(path)
    return read_trace(open_trace(path), path.resolve().name)
