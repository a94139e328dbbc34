"""From what the user asked for to a flight and its summary."""

import asyncio
import json
import os
import sys
from pathlib import Path

from attrs import frozen
from rich.console import Console

from deploy.launcher.flight import Flight, Outcome
from deploy.launcher.glove_panel import GlovePanel
from deploy.launcher.hand_choice import HandChoice, choose_hand
from deploy.launcher.monitor import Monitor
from deploy.launcher.pattern_file import write_pattern_file
from deploy.launcher.ports import free_port_near, free_ports
from deploy.launcher.process_table import (
    ConsoleChoice,
    GloveChoice,
    hint_overrides,
    process_table,
    resolve_scenario,
)
from deploy.launcher.run_directory import create_run_directory, write_run_file
from deploy.launcher.status_view import StatusView
from deploy.launcher.summary import Json, flight_summary, print_summary
from deploy.terminal.console import WIDTH, open_console
from deploy.terminal.job_control import in_foreground
from deploy.terminal.streams import PatientStream
from glove_bridge.gloves import check_glove
from glove_bridge.patterns import load_patterns
from human_relay.sources import source_hints
from observer.console import PORT
from observer.console.arguments import TOKEN_VARIABLE
from observer.console.pattern_file import PATTERN_FILE
from observer.swarm import SCENARIO_FILE
from shared.bus import join
from shared.clock import system_clock
from shared.compiled import form
from shared.config import dump_scenario
from shared.errors import ConfigError
from shared.formation import Formation
from shared.nodes import LOOPBACK, OBSERVER, all_nodes
from shared.scenario import Scenario
from shared.scenario_check.check import open_scenario
from shared.scenario_check.checked import leave_checked

SUMMARY_FILE = "summary.json"


@frozen(kw_only=True)
class Options:
    """What the user asks for.

    Attributes:
        scenario: Name or file.
        hand: URI of the hand source.
        glove: What the operator wears, None for nothing.
        console: Whether to serve the page, which may take the hand.
        seconds: Length of the flight, None until the hand ends it.
        overrides: `key=value` items for the scenario.
        runs: Directory of all runs.
        json: Whether the summary goes to stdout as one line of JSON and everything else to stderr.
        live: Whether a terminal gets a live table.
        record: Whether everything is recorded in the run directory.
        verbose: Whether the processes log debugging details.
    """

    scenario: str
    hand: str
    glove: GloveChoice | None = None
    console: bool = False
    seconds: float | None = None
    overrides: tuple[str, ...] = ()
    runs: Path = Path("runs")
    json: bool = False
    live: bool = True
    record: bool = False
    verbose: bool = False


def launch(options: Options) -> Json:
    """Flies once.

    Args:
        options: What the user asks for.

    Returns:
        The summary (`deploy.launcher.summary`), which has also been printed and written to the run directory.

    Raises:
        ConfigError: The scenario, the hand, the glove or the place for runs is refused; nothing has been
            started.
        DeviceError: The bus cannot be opened.
    """
    scenario, formation, hand = _resolve(options)
    with PatientStream(sys.stdout) as out, PatientStream(sys.stderr) as err:
        console = open_console(err if options.json else out)
        run_dir = create_run_directory(options.runs, lambda text: _say(console, text))
        write_run_file(run_dir / SCENARIO_FILE, dump_scenario(scenario))
        leave_checked(run_dir / SCENARIO_FILE, scenario)
        outcome, summary = asyncio.run(_fly(options, scenario, formation, hand, run_dir, console))
        print_summary(summary, console)
        line = f"{json.dumps(summary)}\n"
        if options.json and not outcome.refused:
            out.write(line)
        _keep_summary(run_dir / SUMMARY_FILE, line, console)
    if outcome.refused:
        raise ConfigError(_refusal(outcome, run_dir))
    return summary


def _keep_summary(path: Path, line: str, console: Console) -> None:
    """Writes what has been printed; a disk that is full or gone costs the file, and it is said."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(line, encoding="utf-8")
    except OSError as error:
        _say(console, f"the summary above is not in {path}: {error}")


def _say(console: Console, text: str) -> None:
    console.print(f"launcher | {text}", soft_wrap=True)


def _resolve(options: Options) -> tuple[Scenario, Formation, HandChoice]:
    if options.glove:
        load_patterns(options.glove.patterns)
        check_glove(options.glove.uri)
    hints = hint_overrides(source_hints(options.hand))
    scenario, formation = open_scenario(options.scenario, (*hints, *options.overrides))
    tcp_ports, (udp_port,) = free_ports(tcp=len(all_nodes(formation)), udp=1)
    hand = choose_hand(options.hand, scenario, console=options.console)
    return resolve_scenario(scenario, formation, tcp_ports, udp_port, hand.pointer), formation, hand


async def _fly(
    options: Options,
    scenario: Scenario,
    formation: Formation,
    hand: HandChoice,
    run_dir: Path,
    console: Console,
) -> tuple[Outcome, Json]:
    page = _console_choice(hand, run_dir) if options.console else None
    if options.glove:
        write_pattern_file(run_dir, options.glove.patterns)
    rows = process_table(
        scenario,
        formation,
        file=run_dir / SCENARIO_FILE,
        hand=hand.uri,
        run_dir=run_dir,
        glove=options.glove,
        record=options.record,
        console=page,
        verbose=options.verbose,
    )
    live = options.live and _is_ours(console)
    panel = GlovePanel(options.glove.patterns) if options.glove else None
    with (
        join(scenario, formation, OBSERVER) as bus,
        StatusView(console, run_dir, live=live, panel=panel) as view,
    ):
        for remark in hand.remarks:
            view.event(f"hand: {remark}")
        if page:
            view.event(f"fly it in the browser: {_page_address(page.port)}")
        if form().refused:
            view.event(f"the law flies in its {form()} form: {form().reason}; swarmtouch doctor says more")
        monitor = Monitor(bus, formation, system_clock())
        flight = Flight(
            formation=formation,
            rows=rows,
            monitor=monitor,
            run_dir=run_dir,
            files=_texts(run_dir / SCENARIO_FILE, run_dir / PATTERN_FILE),
            seconds=options.seconds,
            landing_speed=scenario.limits.landing_speed,
            takeoff_s=scenario.limits.takeoff_height / scenario.limits.takeoff_speed,
            view=view,
        )
        outcome = await flight.run()
    return outcome, flight_summary(outcome, monitor, glove=options.glove, remarks=hand.remarks)


def _texts(*files: Path) -> dict[Path, str]:
    return {file: file.read_text(encoding="utf-8") for file in files if file.exists()}


def _is_ours(console: Console) -> bool:
    """Whether it is a terminal that we may draw on, and wide enough."""
    if not console.is_terminal:
        return False
    terminal = console.file.fileno()
    return in_foreground(terminal) and os.get_terminal_size(terminal).columns >= WIDTH


def _console_choice(hand: HandChoice, run_dir: Path) -> ConsoleChoice:
    return ConsoleChoice(port=free_port_near(PORT), pattern_file=run_dir / PATTERN_FILE, takeover=hand.takeover)


def _page_address(port: int) -> str:
    wanted = f"?token= and what {TOKEN_VARIABLE} says" if os.environ.get(TOKEN_VARIABLE) else ""
    return f"http://{LOOPBACK}:{port}/{wanted}"


def _refusal(outcome: Outcome, run_dir: Path) -> str:
    """Says why a process refused to start, in its own last words."""
    name = outcome.refused[0]
    log = run_dir / "logs" / f"{name}.log"
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines() if log.is_file() else []
    return f"{name} refused to start: {lines[-1] if lines else 'it left no message'}"
