"""Kill -9: agents, those who only watch, the relay, the router."""

from pathlib import Path

from shared.clock import NS_PER_S
from shared.messages import Flag, Mode
from shared.nodes import CONSOLE, OBSERVER
from tests.chaos.flight import OBSERVERS, ROUTER, ChaosFlight, chaos_flight
from tests.chaos.row import Row, judge
from tests.chaos.steps import (
    CUE_S,
    REJOIN_S,
    Fly,
    all_follow,
    only,
    settle,
    wait,
    watch_from_now,
)

REST = "scripted:hold"
SURVIVORS_S = 5.0
"""The survivors stand in the repaired geometry so soon ..."""
WATCHED_S = 8.0
"""... and still do after this long."""
RESTART_S = 0.25
"""A supervisor's pause before it starts a process again."""
CUT_S = 2.0
"""A body that hears nobody cuts its motors after this long (link-loss rule `crazyflie`)."""


def kill_drones(*victims: int) -> Fly:
    """Kills agents for good, the hand at rest; the others stand where repair puts them; then they come back."""

    def fly(folder: Path) -> Row:
        with chaos_flight(folder, REST) as flight:
            recorder = flight.recorder
            watch = watch_from_now(flight, victims)
            for victim in victims:
                flight.kill(f"drone/{victim}")
            shaped = settle(watch, WATCHED_S)
            modes = {mode for drone in watch.drones for mode in watch.modes(drone)}
            orphans = [i for i in watch.drones if set(flight.formation.references(i)) & set(victims)]
            repaired = [i for i in orphans if Flag.REPAIRED in recorder.latest(i).flags]
            for victim in victims:
                flight.start(f"drone/{victim}")
            back = wait(flight, lambda: all_follow(flight, victims))
            recorder.listen(1.5)
            return judge(
                f"kill -9 drone {' and '.join(map(str, victims))}",
                watch,
                gone=f"drone/{victims[0]}",
                recovered_s=back,
                demands=[
                    (shaped is not None, "survivors within 10 % of the repaired geometry"),
                    (repaired == orphans, f"repaired: {orphans}, not only {repaired}"),
                    (modes <= {Mode.FOLLOW, Mode.HOLD}, "survivors fly on"),
                ],
                times=[
                    *((watch.cue(f"drone/{victim}"), CUE_S, "cue by token within 50 ms") for victim in victims),
                    (shaped, SURVIVORS_S, "survivors in shape in 5 s"),
                    (back, REJOIN_S, "all back in 12 s"),
                ],
                notes=[f"survivors in shape after {shaped:.2f} s"] if shaped is not None else [],
            )

    return fly


def restart_drone(folder: Path) -> Row:
    """Kills an agent that a supervisor brings back while its body is still in the air."""
    with chaos_flight(folder) as flight:
        watch = watch_from_now(flight, (2,))
        flight.kill("drone/2")
        flight.recorder.listen(RESTART_S)
        flight.start("drone/2")
        back = wait(flight, lambda: all_follow(flight, (2,)))
        steps = [s.step_ns - watch.start_ns for s in flight.recorder.states[2] if s.epoch > watch.start_ns]
        flight.recorder.listen(1.5)
        return judge(
            "kill -9 drone 2, restarted",
            watch,
            gone="drone/2",
            recovered_s=back,
            times=[
                (watch.cue("drone/2"), CUE_S, "cue by token within 50 ms"),
                (steps[0] / NS_PER_S if steps else None, CUT_S, "it is back before its motors are cut"),
                (back, REJOIN_S, "all back in 12 s"),
            ],
        )


def kill_bystander(role: str) -> Fly:
    """Kills a process on which nothing in flight depends, and brings it back."""

    def fly(folder: Path) -> Row:
        with chaos_flight(folder, before=add_bystanders) as flight:
            watch, token = watch_from_now(flight), f"{role}/0"
            flight.kill(token)
            flight.recorder.listen(2.0)
            flight.start(token)
            seen = token not in OBSERVERS
            back = wait(flight, lambda: not seen or token in flight.recorder.present)
            flight.recorder.listen(3.0)
            return judge(
                f"kill -9 {role}",
                watch,
                gone=token if seen else None,
                recovered_s=back,
                demands=[
                    (only(watch, Mode.FOLLOW), "nobody even holds"),
                    (flight.processes[token].poll() is None, "it runs again"),
                ],
                times=[(watch.cue(token), CUE_S, "cue by token within 50 ms")] if seen else [],
                notes=[] if seen else ["no observer sees another: judged by its process"],
            )

    return fly


def kill_relay(folder: Path) -> Row:
    """Kills the relay for 3 s."""
    with chaos_flight(folder) as flight:
        watch = watch_from_now(flight)
        flight.kill("relay/0")
        flight.recorder.listen(3.0)
        held = all(flight.recorder.latest(drone).mode is Mode.HOLD for drone in watch.drones)
        drift = watch.drift(watch.drones, (1.5, 3.0))
        flight.start("relay/0")
        back = wait(flight, lambda: all_follow(flight))
        flight.recorder.listen(1.5)
        return judge(
            "kill -9 relay for 3 s",
            watch,
            gone="relay/0",
            recovered_s=back,
            demands=[(held, "HOLD after 1 s"), (drift <= 0.3, "drift of at most 0.3 m")],
            times=[
                (watch.cue("relay/0"), CUE_S, "cue by token within 50 ms"),
                (watch.alarm(Flag.HAND_STALE), 0.4, "the hand counts as silent after 0.25 s"),
                (back, REJOIN_S, "all back in 12 s"),
            ],
            notes=[f"drift {drift:.2f} m"],
        )


def kill_router(folder: Path) -> Row:
    """Kills the router that everybody is a client of, for 1 s."""
    with chaos_flight(folder, routed=True) as flight:
        watch = watch_from_now(flight)
        flight.kill(f"{ROUTER}/0")
        flight.recorder.listen(1.0)
        flight.start(f"{ROUTER}/0")
        back = wait(flight, lambda: all_follow(flight))
        flight.recorder.listen(1.5)
        epochs = {state.epoch for drone in watch.drones for state in flight.recorder.states[drone]}
        return judge(
            "kill -9 router for 1 s",
            watch,
            recovered_s=back,
            demands=[(len(epochs) == len(watch.drones), "every agent outlives it")],
            times=[(back, REJOIN_S, "all back in 12 s")],
        )


def add_bystanders(flight: ChaosFlight) -> None:
    """Adds those who only watch."""
    scenario = ("--scenario", str(flight.folder / "scenario.toml"))
    flight.add(OBSERVER, "observer", *scenario, "--run-dir", str(flight.folder / "trace"))
    flight.add(CONSOLE, "observer.console", *scenario, "--port", "0")
