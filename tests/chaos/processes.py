"""Faults inside processes and around them: frozen, talked at, a clock that steps, a disk that is full."""

import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from shared.messages import Mode
from shared.nodes import OBSERVER, WORLD, drone_node
from tests.chaos.flight import GUEST, PORT, ChaosFlight, chaos_flight
from tests.chaos.row import Row, judge
from tests.chaos.steps import REJOIN_S, Fly, all_calm, all_follow, follow_at, only, wait, watch_from_now
from tests.chaos.watch import references

REST = "scripted:hold"
DISK_BYTES = 1 << 20
RECORDER = f"{OBSERVER}/0"
"""Ends, and says why, when it cannot write."""


def freeze(folder: Path) -> Row:
    """Stops a process for 5 s without killing it."""
    with chaos_flight(folder, REST) as flight:
        watch = watch_from_now(flight, (2,))
        flight.pause("drone/2", 5.0)
        silent, gone = watch.alarm(), watch.cue("drone/2")
        back = wait(flight, lambda: all_follow(flight))
        flight.recorder.listen(1.5)
        return judge(
            "freeze drone 2 for 5 s",
            watch,
            recovered_s=back,
            demands=[
                (silent is not None, "noticed by state age"),
                (gone is None or silent is None or gone > silent, "state age is sooner than the token"),
            ],
            times=[(silent, 0.6, "noticed within 0.6 s"), (back, REJOIN_S, "all back in 12 s")],
            notes=["token stays" if gone is None else f"token gone after {gone:.2f} s"],
        )


def talk(hz: float, what: str) -> Fly:
    """Lets a stranger send garbage on every key for 5 s."""

    def fly(folder: Path) -> Row:
        with chaos_flight(folder) as flight:
            watch = watch_from_now(flight)
            places = [f"tcp/{flight.lab.mesh(drone_node(drone))}:{PORT}" for drone in flight.ids]
            said = flight.run_as(GUEST, "tests.chaos.intruder", "rhombus", str(hz), "5", *places)
            ages = watch.ages(references(flight.formation, flight.ids))
            back = wait(flight, lambda: all_follow(flight))
            flight.recorder.listen(1.5)
            refused = sum(
                sum(flight.recorder.statuses[drone_node(drone)].rejected.values()) for drone in flight.ids
            )
            return judge(
                f"{what}, {hz:.0f}/s for 5 s",
                watch,
                recovered_s=back,
                demands=[
                    (only(watch, Mode.FOLLOW), "no wrong failsafe"),
                    (refused > 0, "garbage is counted"),
                ],
                notes=[f"{said} sent, {refused} counted, oldest data {1e3 * ages.max():.0f} ms"],
            )

    return fly


def step_clock(folder: Path) -> Row:
    """Sets the relay's and drone 1's wall clock back by an hour, in flight and then at a restart."""

    def hour_back(flight: ChaosFlight) -> None:
        for token in ("relay/0", "drone/1"):
            python, _, _, module, *arguments = flight.command_of(token)
            flight.replace(token, python, "-m", "tests.chaos.stepped_clock", "-3600", module, *arguments)

    with chaos_flight(folder) as flight:
        recorder = flight.recorder
        hour_back(flight)
        watch = watch_from_now(flight, (1,))
        known = {key: heard.epoch for key, heard in recorder.latest(2).heard.items()}
        for token in ("relay/0", "drone/1"):
            flight.kill(token)
            flight.start(token)

        def accepted() -> bool:
            """Drone 2 hears both again, though their epochs are older than the ones it knew."""
            heard = recorder.latest(2).heard
            return all(heard[key].epoch < known[key] for key in known) and follow_at(flight, (2, 3, 4))

        rejoined = wait(flight, accepted)
        wait(flight, lambda: all_calm(flight))
        stepped = watch_from_now(flight, (1,))
        for token in ("relay/0", "drone/1"):
            flight.processes[token].send_signal(signal.SIGUSR1)
        flight.recorder.listen(2.0)
        return judge(
            "clock of relay and drone 1 back 1 h",
            watch,
            recovered_s=rejoined,
            demands=[
                (only(stepped, Mode.FOLLOW), "a step in flight changes nothing"),
                (not stepped.flags(), "nobody raises a flag"),
            ],
            times=[(rejoined, REJOIN_S, "heard again in 12 s")],
        )


def fill_disk(folder: Path) -> Row:
    """Fills the disk that the recorder and the world write to."""
    with small_disk(folder / "disk") as disk:

        def use(flight: ChaosFlight) -> None:
            command = flight.command_of(f"{WORLD}/0")
            place = command.index("--run-dir") + 1
            flight.replace(f"{WORLD}/0", *command[:place], str(disk), *command[place + 1 :])
            scenario = str(flight.folder / "scenario.toml")
            flight.add(OBSERVER, "observer", "--scenario", scenario, "--run-dir", str(disk))

        with chaos_flight(folder, before=use) as flight:
            watch = watch_from_now(flight)
            fill(disk)
            flight.recorder.listen(8.0)
            back = wait(flight, lambda: all_follow(flight))
            complaints = [line for line in flight.logs().splitlines() if "No space left" in line]
            return judge(
                "full disk for recorder and world",
                watch,
                recovered_s=back,
                demands=[
                    (only(watch, Mode.FOLLOW), "nobody even holds"),
                    (bool(complaints), "who cannot write says so"),
                    ("Traceback" not in flight.logs(), "nobody crashes"),
                    (
                        {t for t, p in flight.processes.items() if p.poll() is not None} <= {RECORDER},
                        "all fly on",
                    ),
                ],
                notes=complaints[:2],
            )


def fill(disk: Path) -> None:
    """Writes until nothing more fits."""
    with suppress(OSError), (disk / "filling").open("wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))


@contextmanager
def small_disk(place: Path) -> Iterator[Path]:
    """Mounts a disk in memory of `DISK_BYTES`."""
    place.mkdir(parents=True)
    mount, unmount = ("mount", "-t", "tmpfs", "-o", f"size={DISK_BYTES}", "chaos"), ("umount", "--lazy")
    subprocess.run([*mount, str(place)], check=True)
    try:
        yield place
    finally:
        subprocess.run([*unmount, str(place)], check=True)
