"""The vehicles' links as the world sees them: the newest command per drone in, poses out, over UDP."""

import math
import socket
from collections import Counter
from collections.abc import Container, Iterable, Mapping
from typing import NamedTuple, Self

from msgspec import Struct

from agents.vehicles.base import Pose
from agents.vehicles.bodies.link_loss import obeyed
from agents.vehicles.bodies.state import CUT, DESCEND, FLY, IDLE
from agents.vehicles.link import MAX_DATAGRAM, Order, Verb, decode_order, encode_pose
from shared.errors import DecodeError, DeviceError
from shared.messages import ORIGIN, Vector

MAX_PER_CALL = 1024
"""Datagrams looked at per call: a flood of garbage costs commands, never the world's clock."""

DRIVER_SILENT_S = 0.5
"""A driver says something every 0.25 s at least; one that is silent for longer has let go of its body."""

COMMAND_OF = {Verb.FLY: FLY, Verb.DESCEND: DESCEND, Verb.IDLE: IDLE, Verb.STOP: CUT}


class Told(Struct, frozen=True):
    """The last command of one vehicle: value of a `Command`, set-point, m, and when it came, monotonic, s."""

    kind: int = CUT
    setpoint: Vector = ORIGIN
    at: float = -math.inf


class Driver(NamedTuple):
    """Who flies a body: address, and when last heard, monotonic, s."""

    address: tuple[str, int]
    heard: float


class Radio:
    """One UDP socket for all drones.

    Drivers and world may start in any order: a body belongs to whoever speaks for it first, gets its poses, and
    is heard alone until silent for `DRIVER_SILENT_S`. So nobody else commands a body that is flown, as nobody
    shares the radio channel of a real one.

    Args:
        address: Host and port to listen on; port 0 takes a free one.
        ids: Numbers of the drones.
        hovers: Those that follow the link-loss rule `hover`, the others `crazyflie`.

    Attributes:
        rejected: Refused datagrams by reason.

    Raises:
        DeviceError: The address cannot be listened on.
    """

    def __init__(self, address: tuple[str, int], ids: Iterable[int], hovers: Container[int]) -> None:
        self._hovers = hovers
        self._told = {drone: Told() for drone in ids}
        self._drivers: dict[int, Driver] = {}
        self.rejected: Counter[str] = Counter()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind(address)
        except OSError as error:
            self._socket.close()
            host, port = address
            raise DeviceError(
                f"the world cannot listen on {host}:{port}: {error}; another world may be running, or set"
                ' vehicles.all.uri = "sim://127.0.0.1:PORT/{id}"'
            ) from error

    @property
    def port(self) -> int:
        """The port that it listens on."""
        return int(self._socket.getsockname()[1])

    def receive(self, now: float) -> None:
        """Takes what has arrived.

        Args:
            now: Monotonic time, s.
        """
        for _ in range(MAX_PER_CALL):
            try:
                datagram, sender = self._socket.recvfrom(MAX_DATAGRAM)
            except OSError:
                return
            try:
                self._obey(decode_order(datagram), sender, now)
            except DecodeError as error:
                self.rejected[error.reason] += 1

    def command(self, drone: int, now: float) -> tuple[int, Vector]:
        """Returns what a vehicle obeys now, its link-loss rule applied: value of a `Command`, set-point, m."""
        told = self._told[drone]
        return obeyed(told.kind, now - told.at, hovers=drone in self._hovers), told.setpoint

    def send(self, reports: Mapping[int, Pose]) -> None:
        """Sends poses of drones to their drivers."""
        for drone, driver in self._drivers.items():
            if drone not in reports:
                continue
            try:
                self._socket.sendto(encode_pose(drone, reports[drone]), driver.address)
            except OSError:
                self.rejected["unsent"] += 1

    def close(self) -> None:
        """Closes the socket."""
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _obey(self, order: Order, sender: tuple[str, int], now: float) -> None:
        if order.drone not in self._told:
            raise DecodeError("unknown-drone", str(order.drone))
        driver = self._drivers.get(order.drone)
        if driver and driver.address != sender and now - driver.heard <= DRIVER_SILENT_S:
            raise DecodeError("not-its-driver", f"{sender} speaks for drone {order.drone}")
        self._drivers[order.drone] = Driver(sender, now)
        if order.verb is not Verb.HELLO:
            self._told[order.drone] = Told(COMMAND_OF[order.verb], order.setpoint, now)
