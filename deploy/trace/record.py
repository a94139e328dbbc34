"""`swarmtouch trace record`: join a flight and record it."""

import os
from pathlib import Path

from deploy.launcher.run_directory import create_run_directory, write_run_file
from observer.swarm import LATEST, RUNS, SCENARIO_FILE, open_observer, running_scenario
from observer.trace.record import INBOX_DEPTH, run
from observer.trace.write import TraceWriter
from shared.clock import system_clock
from shared.config import dump_scenario
from shared.messages import MAX_DRONE_ID
from shared.nodes import OBSERVER
from shared.process import prepare_process
from shared.scenario import Scenario
from shared.transport import Inbox


def main(*, source: str | None, output: Path | None) -> int:
    """Records until Ctrl-C; returns the exit code, 1 if nothing was heard."""
    scenario = running_scenario(source)
    folder = output or _run_of(source) or _new_run(scenario)
    stopping, clock = prepare_process(OBSERVER), system_clock()
    # Number 0 is the recorder that the launcher started; any number of others may listen beside it.
    number = 1 + os.getpid() % MAX_DRONE_ID
    with open_observer(scenario) as bus:
        writer = TraceWriter(folder, scenario)
        print(f"recording to {writer.path}; Ctrl-C ends", flush=True)
        inbox = Inbox(clock, INBOX_DEPTH)
        run(writer, bus, inbox, clock, stopping, number)
    print(f"{writer.path}: {writer.written} messages, {inbox.dropped + writer.refused} dropped")
    if not writer.written:
        print("nothing was heard: does the swarm run, and by this scenario?")
    return 0 if writer.written else 1


def _new_run(scenario: Scenario) -> Path:
    """Creates a run directory of a swarm that was started by hand."""
    folder = create_run_directory(RUNS, lambda text: print(text, flush=True))
    write_run_file(folder / SCENARIO_FILE, dump_scenario(scenario))
    return folder


def _run_of(source: str | None) -> Path | None:
    """Returns the run directory of the flight to record, None if the scenario is not from one."""
    folder = RUNS / LATEST if source is None else Path(source)
    return folder.resolve() if folder.is_dir() else None
