"""`swarmtouch bench`: what the swarm costs, against the floor of its transport in the same run."""

import argparse
import importlib
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from deploy.cli.arguments import add_overrides, count, new_file, seconds, whole
from shared.messages import MAX_DRONE_ID

DESCRIPTION = """Measures on this machine: latency from the hand to the drones, cost of a control step, many
agents, the recorder, the simulators, the start. Real swarms and bare ones (same processes, links and payload
sizes, no control) take turns in the same run, so that load on the machine meets both. Method:
docs/performance.md."""
EXAMPLE = """swarmtouch bench chain --seconds 20 --json
         swarmtouch bench scale --agents 4,8,16,32 --plot scale.svg
         swarmtouch bench step --update docs/performance.md"""

Declare = Callable[[argparse.ArgumentParser], object]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares what can be measured, each with its own arguments."""
    kinds = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    for what, kind in _KINDS.items():
        example = f"example: swarmtouch bench {what} {kind.example}"
        child = kinds.add_parser(what, help=kind.summary, description=kind.summary, epilog=example)
        for declare in (*kind.arguments, _common(kind.scenario)):
            declare(child)


def run(arguments: argparse.Namespace) -> int:
    """Measures, prints, and returns the exit code."""
    # Before numpy is loaded: one core is one core, and the matrices are tiny.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from deploy.bench.machine import Conditions  # noqa: PLC0415  --help must not load numpy
    from deploy.bench.plot import check_plot, save_plot  # noqa: PLC0415
    from deploy.bench.report import print_report, split_at_block, write_block  # noqa: PLC0415
    from deploy.terminal.console import open_console  # noqa: PLC0415

    if arguments.plot:
        check_plot(arguments.plot)
    if arguments.update:
        split_at_block(_block(arguments), arguments.update)
    measure = importlib.import_module(f"deploy.bench.{arguments.what}").measure
    outputs = ("command", "what", "json", "plot", "update")
    options = {name: value for name, value in vars(arguments).items() if name not in outputs}
    conditions = Conditions()
    try:
        report = measure(**options, say=lambda text: print(f"bench | {text}", file=sys.stderr, flush=True))
    except KeyboardInterrupt:
        print("swarmtouch: interrupted, nothing was measured", file=sys.stderr)
        return 1
    met = conditions.text()
    print_report(report, met, open_console(stderr=arguments.json))
    if arguments.plot:
        save_plot(report, arguments.plot)
    if arguments.update:
        write_block(report, met, arguments.update)
    if arguments.json:
        for record in report.records:
            print(json.dumps(record | conditions.facts()), flush=True)
    return 0


def _block(arguments: argparse.Namespace) -> str:
    """Returns the name of the block in a document; a profile with keys has one of its own."""
    secured = getattr(arguments, "profile", None) == "field"
    return f"{arguments.what}-field" if secured else str(arguments.what)


def _common(scenario: str) -> Declare:
    def declare(parser: argparse.ArgumentParser) -> None:
        parser.add_argument("--scenario", default=scenario, help="what flies (default: %(default)s)")
        add_overrides(parser)
        parser.add_argument("--json", action="store_true", help="one line of JSON per measurement on stdout")
        parser.add_argument("--plot", type=new_file, metavar="FILE", help="draw it (.svg, .png)")
        parser.add_argument("--update", type=Path, metavar="FILE", help="replace its table in a Markdown file")

    return declare


def _option(name: str, kind: Callable[[str], Any], default: str, text: str) -> Declare:
    return lambda parser: parser.add_argument(
        f"--{name}", type=kind, default=default, metavar="N", help=f"{text} (default: %(default)s)"
    )


def _sizes_of(text: str) -> tuple[int, ...]:
    return tuple(whole(1, MAX_DRONE_ID)(part) for part in text.split(","))


def _profile(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--profile",
        choices=("laptop", "field"),
        help="network profile of the agents; field has keys for this run only (default: the scenario's)",
    )


def _seconds(default: str) -> Declare:
    return _option("seconds", seconds, default, "time that counts, per swarm, s")


def _rounds(default: str) -> Declare:
    return _option("rounds", count, default, "how often the swarms take turns")


def _number(default: str) -> Declare:
    return _option("n", count, default, "how many are measured")


def _sizes(name: str, default: str) -> Declare:
    return _option(name, _sizes_of, default, "sizes of the swarms")


class Kind(NamedTuple):
    """One thing to measure: what it is, an example, what flies, and the arguments that it takes."""

    summary: str
    example: str
    scenario: str
    arguments: tuple[Declare, ...]


_KINDS = {
    "chain": Kind(
        "hand to the last drone's set-point, against bare Zenoh and raw UDP sockets",
        "--seconds 20",
        "rhombus",
        (_seconds("20"), _rounds("4"), _profile),
    ),
    "step": Kind("one control step, decoding included", "--n 3000", "rhombus", (_number("3000"),)),
    "scale": Kind(
        "many agents: punctuality, CPU against a bare node, memory; how many are on time, against bare nodes",
        "--agents 4,8,16",
        "grid",
        (
            _sizes("agents", "4,8,16,32"),
            _seconds("10"),
            _rounds("2"),
            _option(
                "largest",
                whole(0, MAX_DRONE_ID),
                "96",
                "largest swarm tried to find how many are on time; 0: none",
            ),
        ),
    ),
    "lockstep": Kind(
        "the simulators against real time",
        "--drones 4,100,1000",
        "grid",
        (_sizes("drones", "4,100,1000,10000"), _seconds("5")),
    ),
    "record": Kind(
        "whether a flight notices its recorder, and what the recording misses",
        "--agents 12 --seconds 60",
        "grid",
        (
            _option("agents", whole(1, MAX_DRONE_ID), "12", "size of the swarm"),
            _option("seconds", seconds, "60", "time that counts, with and without a recorder each, s"),
            _rounds("3"),
        ),
    ),
    "start": Kind(
        "from `swarmtouch up` to the first formation-wide step", "--n 10", "rhombus", (_number("10"),)
    ),
}
