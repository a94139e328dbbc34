"""`swarmtouch vehicle`: what a vehicle can do, measured."""

import argparse

from deploy.cli.arguments import new_file
from shared.errors import ConfigError

DESCRIPTION = """identify: measures how a body answers to its set-point, how hard it accelerates and what the
model leaves over, in a recorded flight or of a simulated body, and writes it down as an envelope: the safety
filter takes its distances and speeds from it, where vehicles.all.envelope names it (docs/vehicles.md)."""
EXAMPLE = """swarmtouch vehicle identify sim:crazyflie
         swarmtouch vehicle identify runs/latest --drone 2 --output mine.toml
         swarmtouch up rhombus --set vehicles.all.envelope=mine.toml"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    summary = "measure an envelope, from a flight or of a simulated body"
    identify = actions.add_parser("identify", help=summary, description=summary)
    identify.add_argument(
        "source",
        metavar="SOURCE",
        help="a run directory, MCAP file, flight folder or ROS bag; or sim:identified, sim:crazyflie",
    )
    identify.add_argument("--drone", type=int, metavar="N", help="of a flight, this drone's (default: all)")
    identify.add_argument(
        "--output", type=new_file, metavar="FILE", help="where to write the TOML (default: print it)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Does it and returns the exit code."""
    try:
        from deploy.vehicle.identify import run as identify  # noqa: PLC0415  --help must not load scipy
    except ModuleNotFoundError as error:
        raise ConfigError(f"vehicle identify needs {error.name}: pip install 'swarmtouch[plot]'") from error
    return identify(arguments)
