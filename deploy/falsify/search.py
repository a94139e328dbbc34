"""The search: random cases first, then small changes of the worst of each class.

The same seed flies the same cases in the same order, however many processes fly them: what is drawn in a round
depends only on the rounds before it.
"""

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager

import numpy as np
from attrs import field, frozen

from agents.vehicles.world.setup import referee_rules
from deploy.falsify.case import Case
from deploy.falsify.change import change
from deploy.falsify.draw import Plan, draw_case
from deploy.falsify.judge import CLASSES, Kind, Verdict, judge
from deploy.falsify.swarm import fly, prepare

ROUND = 32
"""Flights of one round."""
RANDOM_SHARE = 0.5
"""Share of the budget that is flown at random."""
KEPT = 4
"""So many of the worst of each class are changed."""


@frozen(kw_only=True)
class Budget:
    """When the search ends: after so many flights, or so long.

    Attributes:
        flights: How many; None: as many as there is time for.
        seconds: How long, s; None: as long as it takes.
    """

    flights: int | None = None
    seconds: float | None = None

    def spent(self, flown: int, seconds: float) -> float:
        """Returns which share of it has been used up."""
        shares = [0.0]
        if self.flights is not None:
            shares.append(flown / self.flights)
        if self.seconds is not None:
            shares.append(seconds / self.seconds)
        return max(shares)


@frozen
class Find:
    """A case and what it came to.

    Attributes:
        number: Which flight of the search it was, from 1.
        case: The case.
        verdict: The worst of each class in it.
    """

    number: int
    case: Case
    verdict: Verdict

    def margin(self, kind: Kind) -> float:
        """Returns how far the class is from its limit, m; negative: it is broken."""
        return CLASSES[kind].margin(self.verdict[kind].value)


@frozen(kw_only=True)
class Finds:
    """What a search has found.

    Attributes:
        flights: How many were flown.
        broken: In how many of them a limit of a class was broken.
        worst: Up to `KEPT` of each class, the worst first.
    """

    flights: int = 0
    broken: dict[Kind, int] = field(factory=lambda: dict.fromkeys(CLASSES, 0))
    worst: dict[Kind, tuple[Find, ...]] = field(factory=lambda: dict.fromkeys(CLASSES, ()))

    def add(self, find: Find) -> "Finds":
        """Returns the finds with one more flight."""
        broken = {kind: count + (find.margin(kind) < 0.0) for kind, count in self.broken.items()}
        worst = {
            kind: tuple(sorted((*kept, find), key=lambda each: each.margin(kind))[:KEPT])
            if find.margin(kind) < float("inf")
            else kept
            for kind, kept in self.worst.items()
        }
        return Finds(flights=self.flights + 1, broken=broken, worst=worst)


def try_case(case: Case) -> Verdict:
    """Flies a case and judges it.

    Raises:
        ConfigError: Its scenario is refused.
    """
    scenario, formation = prepare(case.scenario, case.overrides)
    return judge(fly(case), referee_rules(scenario, formation, formation.ids))


def search(
    plan: Plan,
    budget: Budget,
    seed: int,
    *,
    jobs: int | None = None,
    report: Callable[[Finds], None] = lambda _: None,
) -> Finds:
    """Searches until the budget is spent.

    Args:
        plan: What may be drawn.
        budget: How much is flown.
        seed: Of everything that is drawn.
        jobs: Processes that fly; None: one per processor; 1: this one.
        report: Told after every round.

    Raises:
        ConfigError: A scenario of the plan is refused.
    """
    for scenario in plan.scenarios:
        prepare(scenario, plan.overrides)
    started, finds, rounds = time.monotonic(), Finds(), 0
    with _crew(jobs) as crew:
        while (spent := budget.spent(finds.flights, time.monotonic() - started)) < 1.0:
            rng = np.random.default_rng([seed, rounds])
            count = ROUND if budget.flights is None else min(ROUND, budget.flights - finds.flights)
            cases = list(_next_cases(plan, finds, rng, count, at_random=spent < RANDOM_SHARE))
            for case, verdict in zip(cases, crew(cases), strict=True):
                finds = finds.add(Find(finds.flights + 1, case, verdict))
            rounds += 1
            report(finds)
    return finds


def _next_cases(
    plan: Plan, finds: Finds, rng: np.random.Generator, count: int, *, at_random: bool
) -> Iterator[Case]:
    known = [kept for kept in finds.worst.values() if kept]
    for number in range(count):
        if at_random or not known:
            yield draw_case(plan, rng)
            continue
        kept = known[number % len(known)]
        yield change(kept[int(rng.integers(len(kept)))].case, plan, rng)


Crew = Callable[[Sequence[Case]], Iterator[Verdict]]


@contextmanager
def _crew(jobs: int | None) -> Iterator[Crew]:
    count = jobs or os.cpu_count() or 1
    if count == 1:
        yield lambda cases: map(try_case, cases)
        return
    pool: Executor = ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"))
    with pool:
        try:
            yield lambda cases: pool.map(try_case, cases)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
