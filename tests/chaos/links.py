"""Faults of links: the swarm in parts, packets lost, late, doubled, out of order, a vehicle unheard."""

from pathlib import Path

from shared.messages import Flag, Mode
from shared.nodes import RELAY, WORLD, drone_node
from shared.topics import DRONE_STATE, HAND
from tests.chaos.flight import chaos_flight
from tests.chaos.row import Row, judge
from tests.chaos.steps import REJOIN_S, Fly, all_follow, only, wait, watch_from_now
from tests.chaos.watch import Watch, references
from tests.chaos.weather import Weather

FRESH_S = 0.3
"""No data between healthy nodes is ever older ..."""
STALLED_S = 2.0
"""... and if it is that old, no busy machine is the reason."""
HEALED_S = 2.0
"""The swarm follows again so soon after a partition."""
BAD_WEATHER = Weather(delay=0.05, jitter=0.02, loss=0.2, duplicate=0.05)
CUT = 2
"""Who is cut off."""
WORSE = 1.15
"""How much worse the swarm may follow in bad weather."""


def partition(seconds: float, protocol: str) -> Fly:
    """Parts the human and drone 1 from the rest."""

    def fly(folder: Path) -> Row:
        with chaos_flight(folder, protocol=protocol) as flight:
            recorder, lab = flight.recorder, flight.lab
            rest = tuple(drone for drone in flight.ids if drone != 1)
            watch = Watch(flight, recorder.clock(), rest)
            leader = Watch(flight, watch.start_ns, (1,))
            lab.part((RELAY, drone_node(1)), [node for node in flight.nodes if node not in (RELAY, "drone/1")])
            recorder.listen(seconds)
            modes = {recorder.latest(drone).mode for drone in rest}
            drift = watch.drift(rest, (2.0, min(seconds, 9.5)))
            landed = seconds > 10.0
            # It hears its hand, but nobody who could keep away from it.
            led = only(leader, Mode.FOLLOW, Mode.HOLD, *((Mode.LAND, Mode.GROUND) if landed else ()))
            held = recorder.latest(1).mode is not Mode.FOLLOW
            lab.heal()
            designed = {Mode.LAND, Mode.GROUND} if landed else {Mode.HOLD}
            back = wait(flight, lambda: recorder.all_in(Mode.GROUND, rest) if landed else all_follow(flight))
            recorder.listen(2.0)
            mates = [pair for pair in references(flight.formation, rest) if pair[0] != HAND.key()]
            ages = leader.ages([*mates, (HAND.key(), 1)])
            return judge(
                f"part human and 1 from the rest, {seconds:.0f} s, {protocol}",
                watch,
                recovered_s=back,
                demands=[
                    (modes <= designed, "HOLD, or LAND after 10 s"),
                    (led and held, "drone 1, alone with its hand, holds as well"),
                    (drift <= 0.3, "drift of at most 0.3 m"),
                    (not landed or all(recorder.latest(i).mode is Mode.GROUND for i in rest), "down for good"),
                    (ages.max() < STALLED_S, "no link between healthy nodes stalls"),
                ],
                times=[
                    *([] if landed else [(back, HEALED_S, "FOLLOW within 2 s")]),
                    (ages.max(), FRESH_S, "data between healthy nodes younger than 0.3 s"),
                ],
                notes=[f"drift {drift:.2f} m, oldest data between healthy nodes {1e3 * ages.max():.0f} ms"],
            )

    return fly


def cut_off(protocol: str) -> Fly:
    """Cuts one drone off from the mesh for 20 s, in the middle of a moving formation.

    On a radio it still hears the hand: what it does not hear are the others.
    """

    def fly(folder: Path) -> Row:
        with chaos_flight(folder, "scripted:eight?peak=0.6", protocol=protocol) as flight:
            recorder, lab = flight.recorder, flight.lab
            others = tuple(drone for drone in flight.ids if drone != CUT)
            watch = Watch(flight, recorder.clock(), others)
            lonely = Watch(flight, watch.start_ns, (CUT,))
            heard = {drone_node(CUT), *((RELAY,) if protocol == "radio" else ())}
            lab.part((drone_node(CUT),), [node for node in flight.nodes if node not in heard])
            recorder.listen(20.0)
            modes = lonely.modes(CUT)
            flew_on = all(recorder.latest(drone).mode is Mode.FOLLOW for drone in others)
            lab.heal()
            back = wait(flight, lambda: all(Flag.MISSED not in recorder.latest(i).flags for i in flight.ids))
            recorder.listen(3.0)
            down = recorder.latest(CUT).mode is Mode.GROUND
            return judge(
                f"cut drone {CUT} off for 20 s, {protocol}",
                watch,
                recovered_s=back,
                demands=[
                    (modes[-2:] == (Mode.LAND, Mode.GROUND), "it lands by its own ladder"),
                    (Mode.HOLD in modes, "it holds before"),
                    (flew_on, "the others fly on"),
                    (down, "it stays down when it is heard again: the operator has to ask"),
                ],
                notes=[f"drone {CUT}: {'-'.join(modes)}"],
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
        back = wait(flight, lambda: all_follow(flight))
        flight.recorder.listen(1.5)
        return judge(
            "lose 20 % for 10 s",
            watch,
            recovered_s=back,
            demands=[(only(watch, Mode.FOLLOW), "no wrong failsafe")],
            times=[(ages.max(), FRESH_S, "data younger than 0.3 s")],
            notes=[f"oldest data {1e3 * ages.max():.0f} ms"],
        )


def rejoin_in_bad_weather(folder: Path) -> Row:
    """Kills drone 2 in bad weather and starts it again: every other must hear it, and it every other."""
    with chaos_flight(folder, "scripted:hold", emulated=True, protocol="udp") as flight:
        flight.lab.weather(BAD_WEATHER)
        flight.recorder.listen(1.0)
        watch = watch_from_now(flight, (2,))
        flight.kill("drone/2")
        flight.start("drone/2")

        def joined() -> bool:
            """It hears the hand and its reference, and who refers to it hears it anew."""
            epoch, heard = flight.recorder.latest(2).epoch, flight.recorder.latest(4).heard
            return (
                epoch > watch.start_ns
                and heard[DRONE_STATE.key(id=2)].epoch == epoch
                and {HAND.key(), DRONE_STATE.key(id=1)} <= flight.recorder.latest(2).heard.keys()
                and all_follow(flight)
            )

        back = wait(flight, joined)
        flight.recorder.listen(1.5)
        return judge(
            "kill -9 drone 2, restarted in that weather",
            watch,
            recovered_s=back,
            demands=[(only(watch, Mode.FOLLOW, Mode.HOLD), "the others fly on")],
            times=[(back, REJOIN_S, "all back in 12 s")],
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
        back = wait(flight, lambda: all_follow(flight))
        flight.recorder.listen(1.5)
        return judge(
            "no pose of drone 4 for 2 s",
            watch,
            recovered_s=back,
            demands=[(only(others, Mode.FOLLOW), "nobody else even holds")],
            times=[
                (watch.alarm(Flag.OLD_POSE), 0.3, "old pose flagged after 0.1 s"),
                (back, REJOIN_S, "all back in 12 s"),
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
            back = wait(flight, lambda: all_follow(flight))
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
