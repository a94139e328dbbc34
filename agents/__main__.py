"""One drone: `python -m agents --scenario rhombus --id 2`."""

import argparse
import gc
import sys
from concurrent.futures import ThreadPoolExecutor

from agents.agent import Agent
from agents.loop import Mouth, run
from agents.near_links import NearLinks
from agents.settings import agent_settings
from agents.vehicles import open_vehicle
from shared.bus import join, reach
from shared.clock import system_clock
from shared.errors import SwarmTouchError
from shared.nodes import drone_node
from shared.process import StatusReporter, add_process_arguments, explain, prepare_process, tell_form
from shared.scenario_check.checked import check_drone, open_checked
from shared.topics import DRONE_STATE, PLACES
from shared.transport import Inbox
from shared.vehicles import vehicle_settings


def main() -> int:
    """Runs one agent until SIGTERM or SIGINT."""
    args = _parse()
    stopping = prepare_process(f"drone/{args.id}", verbose=args.verbose)
    clock = system_clock()
    try:
        scenario, formation = open_checked(args.scenario, args.set)
        check_drone(formation, args.id, args.scenario)
        settings = agent_settings(scenario, formation, args.id)
        agent = Agent(scenario, formation, args.id, settings, epoch=clock())
        vehicle = open_vehicle(str(vehicle_settings(scenario, args.id).uri))
        bus = join(scenario, formation, drone_node(args.id), audited=True)
    except SwarmTouchError as error:
        return explain("agents", error)
    inbox = Inbox(clock)
    with bus:
        for key in agent.senses.keys:
            bus.subscribe(key, inbox)
        mouth = Mouth(bus.publisher(DRONE_STATE, id=args.id), bus.publisher(PLACES, id=args.id))
        own = drone_node(args.id)
        links = NearLinks(
            lambda other: reach(scenario, formation, own, drone_node(other)),
            inbox,
            clock,
            ThreadPoolExecutor(1),
        )
        # What starting up has left never dies: the collector need not look through it in flight.
        gc.freeze()
        status = StatusReporter(bus, "drone", args.id, clock, tell_form())
        run(agent, vehicle, inbox, mouth, links, status, clock, stopping)
        vehicle.close()
    return 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m agents",
        description="One drone of the swarm: computes its goal from what it hears and commands its vehicle.",
        epilog="example: python -m agents --scenario rhombus --id 2 --set vehicles.all.uri=sim://10.0.0.5:7400/{id}",
    )
    add_process_arguments(parser)
    parser.add_argument("--id", type=int, required=True, help="number of this drone in the scenario")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
