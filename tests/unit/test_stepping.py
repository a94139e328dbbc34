"""When an agent steps."""

from hypothesis import given
from hypothesis import strategies as st

from agents.stepping import StepRule, due_ns, step_rule
from shared.config import load_scenario
from shared.scenario import Rates

MS = 1_000_000


def test_the_bounds_are_120_hz_and_one_and_a_half_periods() -> None:
    rule = step_rule(load_scenario("rhombus").rates)
    assert rule == StepRule(shortest=8_333_333, longest=25 * MS, resting=100 * MS)


def test_with_a_slower_hand_it_steps_at_the_rate_of_the_hand() -> None:
    assert step_rule(Rates(hand_hz=30.0)).longest == 50 * MS
    assert step_rule(Rates(control_hz=30.0)).longest == 50 * MS
    assert step_rule(Rates(hand_hz=100.0)) == step_rule(Rates())


def test_with_its_inputs_it_steps_as_soon_as_it_may_else_at_the_latest() -> None:
    rule = StepRule(shortest=8 * MS, longest=25 * MS, resting=100 * MS)
    assert due_ns(rule, 100 * MS, inputs_complete=True) == 108 * MS
    assert due_ns(rule, 100 * MS, inputs_complete=False) == 125 * MS


@given(control=st.floats(1.0, 500.0), highest=st.floats(1.0, 1_000.0), last=st.integers(0, 2**62))
def test_inputs_never_delay_a_step(control: float, highest: float, last: int) -> None:
    rule = step_rule(Rates(control_hz=control, max_control_hz=max(control, highest)))
    early, late = (due_ns(rule, last, inputs_complete=complete) for complete in (True, False))
    assert last < early < late
