"""Impedance links into one drone: a mass-spring-damper driven by the hand's velocity, stepped exactly.

`M x'' + D x' + K x = Kv v_hand`, three axes per link, in the formation's frame. The zero-order-hold step is
exact for any damping and any dt > 0 (DESIGN section 4); the paper's printed `Ad` has the wrong signs.
"""

import math
from dataclasses import dataclass
from typing import Final, final

from mypy_extensions import mypyc_attr

from agents.control.vectors import ORIGIN, Vector

_SERIES_BELOW: Final = 0.1
"""|A| T below which the closed form of the input matrix loses digits and the series is used."""
_SERIES_TERMS: Final = 14

Transition = tuple[float, float, float, float, float, float]
"""Ad00, Ad01, Ad10, Ad11, Bd0, Bd1 for the state (displacement, rate)."""


@final
class Spring:
    """The parameters of a link; equal ones are best one object, which remembers its last discretisation.

    Attributes:
        mass: M > 0, kg.
        damping: D >= 0, N s/m.
        stiffness: K > 0, N/m.
        gain: Kv, N s/m.
    """

    def __init__(self, mass: float, damping: float, stiffness: float, gain: float) -> None:
        self.mass: Final = mass
        self.damping: Final = damping
        self.stiffness: Final = stiffness
        self.gain: Final = gain
        self._dt = 0.0
        self._transition: Transition = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)

    def over(self, dt: float) -> Transition:
        """Returns `discretise` of this spring over `dt`, s: all links of a step mostly ask for the same."""
        if dt != self._dt:
            self._transition = discretise(self.mass, self.damping, self.stiffness, self.gain, dt)
            self._dt = dt
        return self._transition


@final
@dataclass(frozen=True)
class Link:
    """One impedance link into a drone.

    Attributes:
        name: `"from-to"`.
        spring: Its parameters.
        limit: Bound of the displacement per axis, m.
    """

    name: str
    spring: Spring
    limit: float


@mypyc_attr(acyclic=True)
@final
class LinkState:
    """Displacement, m, and rate, m/s, of one link in the formation's frame."""

    def __init__(self, displacement: Vector, rate: Vector) -> None:
        self.displacement: Final = displacement
        self.rate: Final = rate


AT_REST: Final = LinkState(ORIGIN, ORIGIN)


def step_links(
    states: tuple[LinkState, ...], links: tuple[Link, ...], hand_velocity: Vector, dt: float
) -> tuple[LinkState, ...]:
    """Advances the links by one step.

    Args:
        states: Before, one per link.
        links: Their parameters.
        hand_velocity: Mapped hand velocity in the formation's frame, m/s, held over the step.
        dt: Step, s, > 0.
    """
    hx, hy, hz = hand_velocity
    stepped = []
    for i in range(len(links)):
        a00, a01, a10, a11, b0, b1 = links[i].spring.over(dt)
        x, y, z = states[i].displacement
        u, v, w = states[i].rate
        displacement = (a00 * x + a01 * u + b0 * hx, a00 * y + a01 * v + b0 * hy, a00 * z + a01 * w + b0 * hz)
        rate = (a10 * x + a11 * u + b1 * hx, a10 * y + a11 * v + b1 * hy, a10 * z + a11 * w + b1 * hz)
        stepped.append(LinkState(displacement, rate))
    return tuple(stepped)


def discretise(mass: float, damping: float, stiffness: float, gain: float, dt: float) -> Transition:
    """Exact zero-order-hold discretisation of one link.

    With `s = -D/2M` and `q = s^2 - K/M` of either sign, `Ad = e^{sT} [C I + T S (A - s I)]` with
    `C = cosh(T sqrt q)`, `S = sinh(T sqrt q) / (T sqrt q)`; no branch at critical damping.

    Args:
        mass: M > 0, kg.
        damping: D >= 0, N s/m.
        stiffness: K > 0, N/m.
        gain: Kv, N s/m.
        dt: T > 0, s.
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
    elif slow == 0.0:
        b0 = (1.0 - a00) * gain / stiffness
    else:
        b0 = _one_minus_a00(slow, w2, dt) * gain / stiffness
    return a00, a01, a10, a11, b0, a01 * gain / mass


def _exponentials(s: float, w2: float, q: float, dt: float) -> tuple[float, float, float]:
    """Returns the slow pole (overdamped only, else 0), `e^{sT} C` and `e^{sT} T S`."""
    x = q * dt * dt
    if abs(x) < 1e-3:
        # cosh and sinh(z)/z as series in z^2 = x, of either sign: smooth through critical damping.
        c = 1.0 + x / 2.0 * (1.0 + x / 12.0 * (1.0 + x / 30.0))
        sinc = 1.0 + x / 6.0 * (1.0 + x / 20.0 * (1.0 + x / 42.0))
        decay = math.exp(s * dt)
        return 0.0, decay * c, decay * dt * sinc
    if q < 0.0:
        root = math.sqrt(-q)
        decay = math.exp(s * dt)
        return 0.0, decay * math.cos(root * dt), decay * math.sin(root * dt) / root
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
    total, power, k = 0.0, dt * dt / 2.0, 3.0
    for _ in range(_SERIES_TERMS):
        total += curvature * power
        rate, curvature = curvature, 2.0 * s * curvature - w2 * rate
        power *= dt / k
        k += 1.0
    return total
