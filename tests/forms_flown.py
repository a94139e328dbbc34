"""Flies what ships, and prints what was flown in a form that two processes can be compared by.

`python -m tests.forms_flown`: the first line is the form of the law, then one line per flight with the hash of
every state of every drone, to the last bit.
"""

import hashlib
import itertools
from collections.abc import Iterator

import numpy as np

from agents.settings import hand_settings
from deploy.falsify.draw import Plan, draw_case
from deploy.falsify.swarm import fly
from deploy.lockstep.central import Flock
from deploy.lockstep.hand_track import map_samples, relayed
from deploy.lockstep.lockstep import Lockstep
from deploy.lockstep.start import rest_places, start_flyers
from shared.compiled import form
from shared.config import SCENARIOS, load_scenario
from shared.formation import build_formation

SECONDS = 10.0
CASES = 8
NAMES = sorted(path.stem for path in SCENARIOS.glob("*.toml"))
HAND = "scripted:tour?peak=0.9&lead=1"


def agents(name: str, *overrides: str, airborne: bool) -> str:
    """Real agents in lockstep: everything that they publish."""
    scenario = load_scenario(name, overrides)
    formation = build_formation(scenario)
    samples = relayed(HAND, SECONDS, scenario.rates.control_hz)
    ((_, hand),) = map_samples(samples[:1], hand_settings(scenario, formation))
    flyers = start_flyers(scenario, formation, rest_places(formation, hand), airborne=airborne)
    swarm, seen = Lockstep(scenario, formation, flyers), hashlib.sha256()
    for sample in samples:
        swarm.advance(sample)
        for key in sorted(swarm.payloads):
            seen.update(swarm.payloads[key])
    return seen.hexdigest()


def flock(name: str, *overrides: str) -> str:
    """One central computer: the bodies and their set-points."""
    scenario = load_scenario(name, overrides)
    formation = build_formation(scenario)
    hands = map_samples(relayed(HAND, SECONDS, scenario.rates.control_hz), hand_settings(scenario, formation))
    central, seen = Flock(scenario, formation, rest_places(formation, hands[0][1])), hashlib.sha256()
    for sample, hand in hands:
        central.advance(sample, hand)
        seen.update(np.array([(member.position, member.setpoint) for member in central.members]).tobytes())
    return seen.hexdigest()


def faulty(seed: int) -> str:
    """Agents under faults and weather that are drawn, with any law, body, size and columns."""
    case = draw_case(Plan(scenarios=("rhombus", "line", "slalom"), vary=True), np.random.default_rng(seed))
    return hashlib.sha256(fly(case).position.tobytes()).hexdigest()


def flights() -> Iterator[tuple[str, str]]:
    """Yields what was flown, and its hash."""
    for name, airborne in itertools.product(NAMES, (True, False)):
        yield f"{name}, airborne={airborne}", agents(name, airborne=airborne)
    for law, body in itertools.product(("paper", "stable"), ("identified", "crazyflie")):
        overrides = (f"swarm.law={law}", f"vehicles.all.body={body}", "avoidance.rule=projection")
        yield f"slalom, {law}, {body}", agents("slalom", *overrides, airborne=False)
        yield f"maze as a flock, {law}, {body}", flock("maze", *overrides)
    # So near that everybody keeps off everybody all the time.
    yield "a dense flock", flock("grid", "formation.n=49", "formation.spacing=0.32", "formation.width=0.32")
    for seed in range(CASES):
        yield f"case {seed}", faulty(seed)


if __name__ == "__main__":
    print(form())
    for name, flown in flights():
        print(f"{name}: {flown}")
