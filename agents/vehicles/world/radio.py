"""The vehicles' links as the world sees them: the newest command per drone in, poses out, over UDP."""

import socket
from collections import Counter
from collections.abc import Sequence
from typing import Self

import numpy as np

from agents.vehicles.bodies.fleet import Fleet, poses
from agents.vehicles.bodies.link_loss import apply_link_loss
from agents.vehicles.bodies.state import Command, Commands, Mask, Vec
from agents.vehicles.link import MAX_DATAGRAM, Order, Verb, decode_order, encode_pose
from shared.errors import DecodeError, DeviceError

MAX_PER_CALL = 1024
"""Datagrams looked at per call: a flood of garbage costs commands, never the world's clock."""

COMMAND_OF = {
    Verb.FLY: Command.FLY,
    Verb.DESCEND: Command.DESCEND,
    Verb.IDLE: Command.IDLE,
    Verb.STOP: Command.CUT,
}


class Radio:
    """One UDP socket for all drones.

    Poses of a drone go to whoever last spoke for it, so drivers and world may start in any order.

    Args:
        address: Host and port to listen on; port 0 takes a free one.
        ids: Numbers of the drones, one per row.
        hovers: (N,) rows that follow the link-loss rule `hover`, the others `crazyflie`.

    Attributes:
        rejected: Refused datagrams by reason.

    Raises:
        DeviceError: The address cannot be listened on.
    """

    def __init__(self, address: tuple[str, int], ids: Sequence[int], hovers: Mask) -> None:
        self._row = {drone: row for row, drone in enumerate(ids)}
        self._hovers = hovers
        self._kind = np.full(len(ids), Command.CUT, dtype=np.int8)
        self._setpoint = np.zeros((len(ids), 3))
        self._commanded = np.full(len(ids), -np.inf)
        self._drivers: dict[int, tuple[str, int]] = {}
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

    def commands(self, now: float) -> Commands:
        """Returns what each vehicle obeys now, its link-loss rule applied."""
        kind = apply_link_loss(self._kind, now - self._commanded, self._hovers)
        return Commands(kind, self._setpoint)

    def send(self, fleet: Fleet, charge: Vec, mute: Mask, seq: int) -> None:
        """Sends every drone's pose to its driver.

        Args:
            fleet: The bodies now.
            charge: (N,) of their batteries, 0..1.
            mute: (N,) whose pose does not come.
            seq: Number of this report.
        """
        reports, silent = poses(fleet, charge.tolist(), seq), mute.tolist()
        for drone, driver in self._drivers.items():
            row = self._row[drone]
            if silent[row]:
                continue
            try:
                self._socket.sendto(encode_pose(drone, reports[row]), driver)
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
        row = self._row.get(order.drone)
        if row is None:
            raise DecodeError("unknown-drone", str(order.drone))
        self._drivers[order.drone] = sender
        if order.verb is not Verb.HELLO:
            self._kind[row] = COMMAND_OF[order.verb]
            self._setpoint[row] = order.setpoint
            self._commanded[row] = now
