"""`swarmtouch sim`: a flight on a virtual clock, faster than real time."""

import argparse
import json
import sys

from deploy.cli.arguments import add_flight_arguments, new_file, number

DESCRIPTION = """Flies a scenario in one process on a virtual clock: real agents that exchange messages,
tick by tick, with simulated bodies. The same inputs give the same bytes. It starts from a hover in the rest
formation. --law central lets one computer compute all drones at once (vectorised: for large formations)."""
EXAMPLE = """swarmtouch sim rhombus --seconds 20 --plot rhombus.png
         swarmtouch sim grid --set formation.n=1000 --law central --seconds 5
         swarmtouch sim maze --hand recording:flights/S2_visual_1 --csv maze.csv"""

LONGEST_S = 3600.0
"""Every tick of a flight is kept in memory."""
LAWS = ("paper", "stable", "central")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments."""
    add_flight_arguments(parser, hand="scripted:tour?lead=1")
    parser.add_argument(
        "--seconds",
        type=number(0.001, LONGEST_S),
        default=20.0,
        metavar="S",
        help="longest flight (%(default)s)",
    )
    parser.add_argument(
        "--law", choices=LAWS, help="another law than the scenario's, or `central`: one computer for all"
    )
    parser.add_argument("--csv", type=new_file, metavar="FILE", help="one row per tick, time-aligned")
    parser.add_argument("--plot", type=new_file, metavar="FILE", help="top view (.png, .svg, .pdf)")
    parser.add_argument("--json", action="store_true", help="last line of stdout is the summary as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Simulates and returns the exit code: 0 if everybody followed, and nobody collided or left the fence."""
    from deploy.lockstep.simulate import Options, simulate  # noqa: PLC0415  --help stays quick

    summary = simulate(
        Options(
            scenario=arguments.scenario,
            hand=arguments.hand,
            seconds=arguments.seconds,
            law=arguments.law,
            overrides=tuple(arguments.overrides),
            csv=arguments.csv,
            plot=arguments.plot,
        )
    )
    for name, value in summary.items():
        shown = f"{value:.3f}" if isinstance(value, float) else value
        if isinstance(value, list):
            shown = "; ".join(value) or "none"
        print(f"{name:20} {shown}", file=sys.stderr if arguments.json else sys.stdout)
    if arguments.json:
        print(json.dumps(summary))
    return 0 if summary["ok"] else 1
