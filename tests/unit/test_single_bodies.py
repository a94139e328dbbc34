"""One body: what it does in floats is its row of what many do in arrays, to 1e-12."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.vehicles.bodies import advance as advancing
from agents.vehicles.bodies.advance import BODIES, FEW, ONE_BY_ONE, SUBSTEP, advance
from agents.vehicles.bodies.pid import hovering
from agents.vehicles.bodies.single.state import apart, together
from agents.vehicles.bodies.state import BodyState, Command, Commands, at_rest

PLACES = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(0.0, 2.0))
SCRIPT = st.lists(
    st.tuples(st.sampled_from(Command), PLACES | PLACES.map(lambda p: (p[0], p[1], 0.0)), st.integers(1, 40)),
    min_size=1,
    max_size=8,
)


def assert_same(some: BodyState, others: BodyState) -> None:
    for name, value in some._asdict().items():
        assert np.allclose(value, getattr(others, name), rtol=1e-12, atol=1e-12, equal_nan=True), name


@pytest.mark.parametrize("body", BODIES)
@given(place=PLACES, flying=st.booleans(), script=SCRIPT, substep=st.floats(0.25 * SUBSTEP, SUBSTEP))
def test_one_body_is_its_row(
    body: str,
    place: tuple[float, float, float],
    flying: bool,
    script: list[tuple[Command, tuple[float, float, float], int]],
    substep: float,
) -> None:
    many = (hovering if flying else at_rest)(np.array([place]))
    (one,) = apart(many)
    for kind, setpoint, substeps in script:
        command = Commands(np.array([kind], dtype=np.int8), np.array([setpoint]))
        for _ in range(substeps):
            many = BODIES[body](many, command, substep)
        one = ONE_BY_ONE[BODIES[body]](one, kind.value, setpoint, substep, substeps)
        assert_same(together([one]), many)


@pytest.mark.parametrize("body", BODIES)
def test_how_many_fly_changes_nothing(body: str, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(2)
    state = hovering(rng.uniform((-2, -2, 0), (2, 2, 2), (FEW, 3)))
    commands = Commands(rng.integers(0, 5, FEW).astype(np.int8), rng.uniform(-2, 2, (FEW, 3)))
    few = advance(BODIES[body], state, commands, 1.0)
    monkeypatch.setattr(advancing, "FEW", 0)
    many = advance(BODIES[body], state, commands, 1.0)
    assert_same(few, many)
