"""`swarmtouch vehicle identify`: measures what a vehicle can do and writes it down as an envelope."""

import argparse
import math
from pathlib import Path

import numpy as np

from deploy.vehicle.fit import Fitted, delay_of, fit_axis
from deploy.vehicle.motion import SIMULATED, Motion, body_of, excited, flown, hardest
from shared.arrays import Vec
from shared.config import structure
from shared.envelope import Envelope
from shared.errors import ConfigError
from shared.files import writing
from shared.toml_text import parse_toml

MOVED = 0.05
"""An axis whose set-point moves less than this, m (standard deviation), says nothing."""
_HEIGHT = "crazyflie"
"""Whose vertical axis stands in for one that a flight says nothing about."""


def run(arguments: argparse.Namespace) -> int:
    """Measures, and writes or prints; returns the exit code."""
    text = identify(str(arguments.source), arguments.drone)
    if arguments.output is None:
        print(text, end="")
    else:
        path = Path(arguments.output)
        with writing(path):
            path.write_text(text, encoding="utf-8")
    return 0


def identify(source: str, drone: int | None = None) -> str:
    """Returns the envelope of a simulated body, or of the vehicles of a recorded flight, as TOML.

    Args:
        source: `sim:` and the name of a body, or the path of a flight.
        drone: Whose motion in the flight; None: everybody's.

    Raises:
        ConfigError: There is no such source, or too little moved in it.
    """
    body = body_of(source)
    if body is None:
        motion, limits = flown(Path(source), drone), (math.inf, math.inf)
        name = Path(source).resolve().name
        about = f"the vehicles of {name}" if drone is None else f"drone {drone} of {name}"
    else:
        motion, limits, about = excited(body), hardest(body), f"the simulated body {body}"
    across, height = _moving(motion, (0, 1)), _moving(motion, (2,))
    if across is None:
        raise ConfigError(f"{source}: no set-point moves sideways by more than {MOVED:g} m; fly it about")
    lines = [
        f'about = "{about}, measured"',
        f"tau = {delay_of(*across):.2f}  # s: it is behind its set-point on the average",
        *_table("horizontal", fit_axis(*across, limits[0]), limits[0]),
        *(_stand_in() if height is None else _table("vertical", fit_axis(*height, limits[1]), limits[1])),
        *("", "[downwash]  # not measured: the usual of small drones", "radius = 0.3", "height = 1.0", ""),
    ]
    text = "\n".join(lines)
    structure(parse_toml(text, source), Envelope, source)
    return text


def _stand_in() -> list[str]:
    motion, limit = excited(_HEIGHT), hardest(_HEIGHT)[1]
    fitted = fit_axis([s[:, 2] for s in motion.setpoint], [p[:, 2] for p in motion.position], limit)
    why = f"# flown at one height: this axis is that of {SIMULATED}{_HEIGHT}"
    return [*_table("vertical", fitted, limit), why]


def _moving(motion: Motion, axes: tuple[int, ...]) -> tuple[list[Vec], list[Vec]] | None:
    """Returns the stretches of these axes in which the set-point moves; None if there is none."""
    found = [
        (setpoint[:, axis], position[:, axis])
        for axis in axes
        for setpoint, position in zip(motion.setpoint, motion.position, strict=True)
        if np.std(setpoint[:, axis]) > MOVED
    ]
    return ([told for told, _ in found], [seen for _, seen in found]) if found else None


def _table(name: str, fitted: Fitted, limit: float) -> list[str]:
    acceleration, seen = (limit, "") if math.isfinite(limit) else (fitted.seen, ": it may be able to do more")
    rows = (
        ("stiffness", fitted.stiffness, f"1/s^2; the model is {fitted.rms:.2g} m/s^2 off (RMS)"),
        ("damping", fitted.damping, "1/s"),
        ("feed", fitted.feed, "1/s"),
        ("lag", fitted.lag, "s"),
        ("acceleration", acceleration, f"m/s^2, the largest that was seen{seen}"),
        (
            "error",
            fitted.error,
            "m/s^2, 99 % of what the model and its observer leave over; add what wind does",
        ),
    )
    return ["", f"[{name}]", *(f"{key} = {float(f'{value:.3g}')}  # {why}" for key, value, why in rows)]
