"""When an agent steps: as soon as its inputs are in, not at the next tick of a clock (DESIGN section 4).

Waiting for the next 60 Hz tick would cost 1-16 ms per hop.
"""

from collections.abc import Collection
from typing import Final, NamedTuple

from attrs import frozen

from shared.clock import NS_PER_S
from shared.scenario import Rates

FALLBACK_PERIODS = 1.5
"""Without its inputs an agent steps after this many periods; at 1.0 jitter would cause extra steps."""
RESTING_NS: Final = NS_PER_S // 10
"""Who waits on the ground is to be heard before it counts as silent, and leaves the processor to others."""


@frozen
class StepRule:
    """When the next step is due, ns after the last one.

    Attributes:
        shortest: Not earlier.
        longest: Not later.
        resting: Of a drone on the ground that hears no hand.
    """

    shortest: int
    longest: int
    resting: int


class Due(NamedTuple):
    """When the next step is due, ns; earlier once something has come on all of the keys that it awaits."""

    at_ns: int
    awaits: Collection[str]


def step_rule(rates: Rates) -> StepRule:
    """Returns the bounds for the rates of a scenario.

    An agent steps at the rate of the hand, be it slower than `control_hz`; without a hand at its own.
    """
    longest = round(NS_PER_S * FALLBACK_PERIODS / min(rates.control_hz, rates.hand_hz))
    return StepRule(
        shortest=round(NS_PER_S / rates.max_control_hz), longest=longest, resting=max(longest, RESTING_NS)
    )


def due_ns(rule: StepRule, last_step_ns: int, *, inputs_complete: bool) -> int:
    """Returns when the next step is due.

    Args:
        rule: The bounds.
        last_step_ns: Start of the last step.
        inputs_complete: Whether every live input is newer than at the last step.
    """
    return last_step_ns + (rule.shortest if inputs_complete else rule.longest)
