"""One flight that may go wrong: scenario, hand, faults and weather, as a value that can be flown again."""

from typing import Literal

from attrs import frozen

from shared.scenario import Triple

FaultKind = Literal["cut", "mute", "deaf", "kill", "held", "blind", "empty", "relay", "glitch"]
"""What fails, see `Fault`."""

Order = Literal["FLY", "HOLD", "LAND"]


@frozen(kw_only=True)
class Stroke:
    """One minimum-jerk motion of the hand.

    Attributes:
        to: Where the hand goes, world frame, m.
        yaw: Where it turns to meanwhile, rad.
        peak: Its largest speed, m/s.
        rest: How long it rests before, s.
    """

    to: Triple
    yaw: float = 0.0
    peak: float
    rest: float = 0.0


@frozen(kw_only=True)
class Fault:
    """Something that fails for a while.

    | kind | what |
    |---|---|
    | `cut` | nobody hears the drone and it hears nobody; its process and its vehicle run on |
    | `mute` | nobody hears it |
    | `deaf` | it hears nobody |
    | `kill` | its process is gone: its body does what its link-loss rule says; a new process comes at the end |
    | `held` | a hand holds it in place |
    | `blind` | its vehicle's pose does not come |
    | `empty` | its battery is critical |
    | `relay` | nobody hears the hand; `drone` is 0 |
    | `glitch` | the tracker takes the place of the drone at rest for that of the hand |

    Attributes:
        kind: What.
        drone: Whose.
        start: When, s.
        end: Until when, s.
    """

    kind: FaultKind
    drone: int = 0
    start: float
    end: float

    def on(self, t: float) -> bool:
        """Says whether it is there at a time, s."""
        return self.start <= t < self.end


@frozen(kw_only=True)
class Weather:
    """What every link does to what is sent.

    Attributes:
        loss: Share of the messages that never arrive.
        delay: Longest delay, s; each link has its own, from 0 to this.
    """

    loss: float = 0.0
    delay: float = 0.0


@frozen(kw_only=True)
class Wished:
    """What the operator orders at a time, s."""

    t: float
    order: Order


@frozen(kw_only=True)
class Case:
    """One flight.

    Attributes:
        scenario: Name or file.
        overrides: `key=value` items for it.
        seconds: How long, s.
        airborne: Begins hovering in the rest formation about the mapped hand; else on the ground, at home.
        hand: Where the hand begins, world frame, m.
        strokes: How it moves then.
        wishes: What the operator orders; FLY until the first.
        faults: What fails.
        weather: Of every link.
        seed: Of what the weather loses and delays.
    """

    scenario: str
    overrides: tuple[str, ...] = ()
    seconds: float
    airborne: bool = True
    hand: Triple
    strokes: tuple[Stroke, ...] = ()
    wishes: tuple[Wished, ...] = ()
    faults: tuple[Fault, ...] = ()
    weather: Weather = Weather()
    seed: int = 0
