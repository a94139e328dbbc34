"""Files of other people's trackers, and files that once broke us: each gives a value, or is refused by name.

They are taken as they lie in the data folder, whatever it holds.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from deploy.lockstep.hand_track import relayed
from observer.trace.read import open_trace
from shared.config import load_scenario
from shared.errors import SwarmTouchError
from shared.messages import Wish
from tests.replay.flights import ABSENT, DATA

FILES = [path for folder in ("inputs", "hands") for path in sorted((DATA / folder).glob("*")) if path.is_file()]

each_file = pytest.mark.parametrize(
    "path",
    [pytest.param(path, id=path.name) for path in FILES]
    or [pytest.param(None, id="absent", marks=pytest.mark.skip(reason=ABSENT))],
)


def play(path: Path) -> object:
    """Plays a recorded hand: what is sent is finite, and where there is no hand it is at rest."""
    samples = relayed(f"recording:{path}?lead=0", 5.0, 60.0)
    assert np.isfinite([(*s.position, *s.velocity, s.yaw) for s in samples]).all()
    assert not any(any(s.velocity) for s in samples if s.mode is Wish.HOLD and not s.jumped)
    return samples


READERS: dict[str, Callable[[Path], object]] = {
    ".toml": load_scenario,
    ".mcap": lambda path: list(open_trace(path).messages()),
}


@each_file
def test_a_foreign_file_is_a_value_or_a_refusal_by_name(path: Path) -> None:
    refused = None
    try:
        assert READERS.get(path.suffix, play)(path)
    except SwarmTouchError as error:
        refused = str(error)
    print(f"{path.name}: {refused or 'read'}")
    assert refused is None or str(path) in refused


def test_a_damaged_trace_gives_all_but_the_damaged_chunks() -> None:
    traces = [path for path in FILES if path.suffix == ".mcap"]
    if not traces:
        pytest.skip(ABSENT)
    for path in traces:
        trace = open_trace(path)
        count = len(list(trace.records()))
        print(path.name, count, trace.faults)
        assert trace.missing <= max(1, trace.damaged) * 0.02 * (count + trace.missing)
