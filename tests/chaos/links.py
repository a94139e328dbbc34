"""Faults of links: the swarm in parts, packets lost, late, doubled, out of order, a vehicle unheard."""

from pathlib import Path

from shared.messages import Flag, Mode
from shared.nodes import RELAY, WORLD, drone_node
from shared.topics import HAND
from tests.chaos.flight import chaos_flight
from tests.chaos.row import Row, judge
from tests.chaos.steps import REJOIN_S, Fly, all_follow, only, wait, watch_from_now, within
from tests.chaos.watch import Watch, references
from tests.chaos.weather import Weather

FRESH_S = 0.3
"""No data between healthy nodes is ever older."""
HEALED_S = 2.0
BAD_WEATHER = Weather(delay=0.05, jitter=0.02, loss=0.2, duplicate=0.05)
WORSE = 1.15
"""How much worse the swarm may follow in bad weather."""


def partition(seconds: float) -> Fly:
    """Parts the human and drone 1 from the rest."""

    def fly(folder: Path) -> Row:
        with chaos_flight(folder, protocol="udp") as flight:
            recorder, lab = flight.recorder, flight.lab
            rest = tuple(drone for drone in flight.ids if drone != 1)
            watch = Watch(flight, recorder.clock(), rest)
            lab.part((RELAY, drone_node(1)), [node for node in flight.nodes if node not in (RELAY, "drone/1")])
            recorder.listen(seconds)
            modes = {recorder.latest(drone).mode for drone in rest}
            drift = watch.drift(rest, (2.0, min(seconds, 9.5)))
            lab.heal()
            landed = seconds > 10.0
            designed = {Mode.LAND, Mode.GROUND} if landed else {Mode.HOLD}
            normal = (lambda: recorder.all_in(Mode.GROUND, rest)) if landed else (lambda: all_follow(flight))
            back = wait(flight, normal, 8.0)
            recorder.listen(2.0)
            ages = watch.ages([pair for pair in references(flight.formation, rest) if pair[0] != HAND.key()])
            down = all(recorder.latest(drone).mode is Mode.GROUND for drone in rest)
            return judge(
                f"part human and 1 from the rest, {seconds:.0f} s",
                watch,
                recovered_s=back,
                demands=[
                    (
                        modes <= designed,
                        "HOLD, or LAND after 10 s",
                    ),
                    (drift <= 0.3, "drift of at most 0.3 m"),
                    (down if landed else within(back, HEALED_S), "down for good, or FOLLOW within 2 s"),
                    (ages.max() < FRESH_S, "data between healthy nodes younger than 0.3 s"),
                ],
                notes=[f"drift {drift:.2f} m, oldest data between healthy nodes {1e3 * ages.max():.0f} ms"],
            )

    return fly


def lose_packets(folder: Path) -> Row:
    """Loses a fifth of all packets for 10 s."""
    with chaos_flight(folder, protocol="udp") as flight:
        flight.lab.lose(0.2)
        watch = watch_from_now(flight)
        flight.recorder.listen(10.0)
        flight.lab.heal()
        ages = watch.ages(references(flight.formation, flight.ids))
        back = wait(flight, lambda: all_follow(flight), 2.0)
        flight.recorder.listen(1.5)
        return judge(
            "lose 20 % for 10 s",
            watch,
            recovered_s=back,
            demands=[
                (only(watch, Mode.FOLLOW), "no wrong failsafe"),
                (ages.max() < FRESH_S, "data younger than 0.3 s"),
            ],
            notes=[f"oldest data {1e3 * ages.max():.0f} ms"],
        )


def silence_vehicle(folder: Path) -> Row:
    """Cuts the world's stream to one drone for 2 s: it no longer knows where it is."""
    with chaos_flight(folder) as flight:
        healthy = tuple(drone for drone in flight.ids if drone != 4)
        watch = Watch(flight, flight.recorder.clock(), (4,))
        others = Watch(flight, watch.start_ns, healthy)
        flight.lab.silence(drone_node(4), WORLD)
        flight.recorder.listen(2.0)
        flight.lab.heal()
        back = wait(flight, lambda: all_follow(flight), REJOIN_S)
        flight.recorder.listen(1.5)
        return judge(
            "no pose of drone 4 for 2 s",
            watch,
            recovered_s=back,
            demands=[
                (within(watch.alarm(Flag.OLD_POSE), 0.3), "old pose flagged after 0.1 s"),
                (only(others, Mode.FOLLOW), "nobody else even holds"),
            ],
        )


def bad_weather(seconds: float) -> Fly:
    """Follows the same motion twice, in fair weather and in bad."""

    def fly(folder: Path) -> Row:
        with chaos_flight(folder, "scripted:eight?peak=0.4", emulated=True, protocol="udp") as flight:
            fair = watch_from_now(flight)
            flight.recorder.listen(seconds)
            fair_rms = fair.tracking_rms()
            flight.lab.weather(BAD_WEATHER)
            flight.recorder.listen(1.0)
            bad = watch_from_now(flight)
            flight.recorder.listen(seconds)
            bad_rms = bad.tracking_rms()
            ages = bad.ages(references(flight.formation, flight.ids))
            modes = only(bad, Mode.FOLLOW)
            flight.lab.weather(Weather())
            back = wait(flight, lambda: all_follow(flight), 2.0)
            return judge(
                f"lose 20 %, 50 +- 20 ms, duplicates, reordering, {seconds:.0f} s",
                bad,
                recovered_s=back,
                demands=[
                    (modes, "no wrong failsafe"),
                    (bad_rms <= WORSE * fair_rms, f"follows at most {WORSE} times worse than in fair weather"),
                ],
                notes=[
                    f"RMS to the ideal formation {bad_rms:.3f} m, in fair weather {fair_rms:.3f} m "
                    f"({bad_rms / fair_rms:.2f} times); oldest data {1e3 * ages.max():.0f} ms"
                ],
            )

    return fly
