"""Runs the simulated world: `python -m agents.vehicles.world --scenario rhombus`."""

import argparse
import sys
import time
from pathlib import Path

from agents.vehicles.world.crowd import Crowd
from agents.vehicles.world.hand import HandWatch
from agents.vehicles.world.radio import Radio
from agents.vehicles.world.record import RefereeFile
from agents.vehicles.world.setup import plan_world
from agents.vehicles.world.world import World
from shared.bus import join
from shared.clock import system_clock
from shared.errors import SwarmTouchError
from shared.net.keyring import hand_verifier
from shared.nodes import WORLD
from shared.process import StatusReporter, add_process_arguments, explain, prepare_process, tell_form
from shared.scenario_check.check import open_scenario


def main() -> int:
    """Steps every simulated body until SIGTERM or SIGINT; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m agents.vehicles.world",
        description="The simulated world: all bodies, their links and the referee.",
        epilog="example: python -m agents.vehicles.world --scenario maze --set vehicles.all.body=crazyflie",
    )
    add_process_arguments(parser)
    parser.add_argument("--run-dir", type=Path, help="folder for referee.json")
    arguments = parser.parse_args()
    stopping = prepare_process("world", verbose=arguments.verbose)
    try:
        scenario, _ = open_scenario(arguments.scenario, arguments.set)
        setup = plan_world(scenario)
        radio = Radio(setup.address, setup.fleet, setup.hovers)
        verify = hand_verifier(scenario.net)
        bus = join(scenario, setup.formation, WORLD, audited=True)
    except SwarmTouchError as error:
        return explain("world", error)
    clock = system_clock()
    with radio, bus, RefereeFile(arguments.run_dir) as report:
        hand, status = HandWatch(bus, clock, verify), StatusReporter(bus, WORLD, 0, clock, tell_form())
        crowd = Crowd(bus, scenario.walkers, clock)
        world = World(setup.fleet, radio, setup.rules, time.monotonic(), setup.faults)
        while not stopping.wait(max(0.0, world.next_tick - time.monotonic())):
            world.run_until(time.monotonic(), hand.position(), crowd.step())
            report.write_when_due(time.monotonic(), world.metrics)
            status.tick(world.ticks, "running", radio.rejected + hand.rejected, world.metrics)
        status.tick(world.ticks, "ending", radio.rejected + hand.rejected, world.metrics, force=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
