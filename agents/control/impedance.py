"""Impedance links: a mass-spring-damper driven by the hand's velocity, stepped exactly.

`M x'' + D x' + K x = Kv v_hand`, three axes per link, in the formation's frame. The zero-order-hold step is
exact for any damping and any dt > 0 (DESIGN section 4); the paper's printed `Ad` has the wrong signs.
"""

import functools
import math
from collections.abc import Sequence

import numpy as np
from attrs import field, frozen

from shared.formation import Link, Vec

_SERIES_BELOW = 0.1
"""|A| T below which the closed form of the input matrix loses digits and the series is used."""
_SERIES_TERMS = 14


@frozen(kw_only=True)
class LinkState:
    """Displacement (L, 3), m, and rate (L, 3), m/s, of L links in the formation's frame."""

    displacement: Vec = field(eq=False)
    rate: Vec = field(eq=False)


def rest_state(links: int) -> LinkState:
    """Returns the state of L links at rest."""
    return LinkState(displacement=np.zeros((links, 3)), rate=np.zeros((links, 3)))


def step_links(state: LinkState, transition: Vec, hand_velocity: Vec) -> LinkState:
    """Advances all links by one step.

    Args:
        state: The links before.
        transition: (L, 6) rows of `transition_rows`.
        hand_velocity: (3,) mapped hand velocity in the formation's frame, m/s, held over the step.

    Returns:
        The links after.
    """
    a00, a01, a10, a11, b0, b1 = transition.T[:, :, None]
    x, v = state.displacement, state.rate
    return LinkState(
        displacement=a00 * x + a01 * v + b0 * hand_velocity,
        rate=a10 * x + a11 * v + b1 * hand_velocity,
    )


def transition_rows(links: Sequence[Link], dt: float) -> Vec:
    """Returns (L, 6) rows `[Ad00, Ad01, Ad10, Ad11, Bd0, Bd1]`."""
    rows = [discretise(link.mass, link.damping, link.stiffness, link.gain, dt) for link in links]
    return np.array(rows).reshape(len(links), 6)


@functools.lru_cache(maxsize=64)
def discretise(
    mass: float, damping: float, stiffness: float, gain: float, dt: float
) -> tuple[float, float, float, float, float, float]:
    """Exact zero-order-hold discretisation of one link; remembered, because links mostly have equal parameters.

    With `s = -D/2M` and `q = s^2 - K/M` of either sign, `Ad = e^{sT} [C I + T S (A - s I)]` with
    `C = cosh(T sqrt q)`, `S = sinh(T sqrt q) / (T sqrt q)`; no branch at critical damping.

    Args:
        mass: M > 0, kg.
        damping: D >= 0, N s/m.
        stiffness: K > 0, N/m.
        gain: Kv, N s/m.
        dt: T > 0, s.

    Returns:
        Ad00, Ad01, Ad10, Ad11, Bd0, Bd1 for the state (displacement, rate).
    """
    s = -damping / (2.0 * mass)
    w2 = stiffness / mass
    q = s * s - w2
    slow, ec, ets = _exponentials(s, w2, q, dt)
    a01 = ets
    a00 = ec - s * ets
    a11 = ec + s * ets
    a10 = -w2 * a01
    if (w2 + abs(2.0 * s) + 1.0) * dt < _SERIES_BELOW:
        b0 = _integral_series(s, w2, dt) * gain / mass
    elif slow is None:
        b0 = (1.0 - a00) * gain / stiffness
    else:
        b0 = _one_minus_a00(slow, w2, dt) * gain / stiffness
    return a00, a01, a10, a11, b0, a01 * gain / mass


def _exponentials(s: float, w2: float, q: float, dt: float) -> tuple[float | None, float, float]:
    """Returns the slow pole (overdamped only), `e^{sT} C` and `e^{sT} T S`."""
    x = q * dt * dt
    if abs(x) < 1e-3:
        # cosh and sinh(z)/z as series in z^2 = x, of either sign: smooth through critical damping.
        c = 1.0 + x / 2 * (1.0 + x / 12 * (1.0 + x / 30))
        sinc = 1.0 + x / 6 * (1.0 + x / 20 * (1.0 + x / 42))
        decay = math.exp(s * dt)
        return None, decay * c, decay * dt * sinc
    if q < 0:
        root = math.sqrt(-q)
        decay = math.exp(s * dt)
        return None, decay * math.cos(root * dt), decay * math.sin(root * dt) / root
    root = math.sqrt(q)
    # s + root cancels when strongly overdamped; its equal -w2 / (root - s) does not, and nothing overflows.
    slow, fast = -w2 / (root - s), s - root
    e_slow, e_fast = math.exp(slow * dt), math.exp(fast * dt)
    return slow, (e_slow + e_fast) / 2.0, (e_slow - e_fast) / (2.0 * root)


def _one_minus_a00(slow: float, w2: float, dt: float) -> float:
    """Returns `1 - Ad00` of an overdamped link without cancellation at small slow * dt."""
    fast = w2 / slow
    return (fast * math.expm1(slow * dt) - slow * math.expm1(fast * dt)) / (slow - fast)


def _integral_series(s: float, w2: float, dt: float) -> float:
    """Returns the integral of Ad01 over dt as a power series (displacement after a unit acceleration)."""
    # Coefficients of e^{At} applied to (0, 1): c_{k+1} follows from x'' = 2 s x' - w2 x.
    rate, curvature = 0.0, 1.0
    total, power = 0.0, dt * dt / 2.0
    for k in range(3, 3 + _SERIES_TERMS):
        total += curvature * power
        rate, curvature = curvature, 2.0 * s * curvature - w2 * rate
        power *= dt / k
    return total
