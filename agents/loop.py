"""The process around an agent: receive -> compute -> publish, until told to stop.

A turn is made by the thread that brings the last input of a step, see `agents.turns`.
"""

import logging
import threading
from typing import NamedTuple

from agents.agent import Agent
from agents.control.modes import POSE_LOST
from agents.near_links import NearLinks
from agents.turns import Turns
from agents.vehicles.base import Pose, Vehicle
from shared.clock import NS_PER_S, Clock
from shared.codec import encode
from shared.conditions import conditions
from shared.messages import DroneState, Flag, Mode
from shared.process import StatusReporter
from shared.transport import Inbox, Publish

LONGEST_WAIT = 0.05
"""The loop looks at the stop event and the clock at least this often, s."""

POSE_WAIT_NS = NS_PER_S // 100
"""A vehicle that has not reported yet is asked again after this long."""

COMPLAINT_NS = 5 * NS_PER_S
"""Who waits for others, or is missed by them, says so this often."""

_APART = Flag.WAITING | Flag.MISSED
_log = logging.getLogger("agent")


class PoseWatch:
    """Notes when the vehicle's newest pose was first seen, on our clock."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._seq: int | None = None
        self._seen_ns = 0

    def read(self, now_ns: int) -> tuple[Pose, float] | None:
        """Returns the newest pose and its age in seconds, None before the first."""
        pose = self._vehicle.pose()
        if pose is None:
            return None
        if pose.seq != self._seq:
            self._seq, self._seen_ns = pose.seq, now_ns
        return pose, (now_ns - self._seen_ns) / NS_PER_S


class Mouth(NamedTuple):
    """Where an agent publishes.

    Attributes:
        state: Its own state.
        places: Where it saw whom last.
    """

    state: Publish
    places: Publish


class Pilot:
    """Makes the turns of an agent's loop: receive -> compute -> publish.

    Args:
        agent: Its brain.
        vehicle: Its body.
        inbox: Filled by the bus with everything in `agent.senses.keys`.
        mouth: Sends what it says.
        clock: The process's clock.
    """

    def __init__(self, agent: Agent, vehicle: Vehicle, inbox: Inbox, mouth: Mouth, clock: Clock) -> None:
        self._agent, self._vehicle, self._inbox = agent, vehicle, inbox
        self._mouth, self._clock = mouth, clock
        self._poses = PoseWatch(vehicle)
        self._mode: Mode | None = None
        self._complain_ns = 0

    def turn(self) -> int:
        """Takes in what has arrived and makes a step if one is due; returns when the next turn is due, ns."""
        self._agent.receive(self._inbox.take())
        now = self._clock()
        due = self._agent.due(now)
        if due.at_ns <= now and self._step(now):
            due = self._agent.due(now)
        self._inbox.expect(due.awaits)
        return due.at_ns if due.at_ns > now else now + POSE_WAIT_NS

    def _step(self, now_ns: int) -> bool:
        """Steps, publishes and commands; returns whether it could: the vehicle must have reported once."""
        seen = self._poses.read(now_ns)
        if seen is None:
            return False
        state = self._agent.step(now_ns, *seen)
        # The neighbours first: they wait for it, while the vehicle still has its last command.
        self._mouth.state(encode(state, self._clock()))
        command(self._vehicle, state)
        if (places := self._agent.places()) is not None:
            self._mouth.places(encode(places))
        if state.mode is not self._mode:
            _log.info("%s at height %.2f m (%s)", state.mode, state.position[2], state.flags.name or "no flags")
            self._mode = state.mode
        if state.flags & _APART and now_ns >= self._complain_ns:
            self._complain_ns = now_ns + COMPLAINT_NS
            _log.info("%s (%s)", state.mode, ", ".join(conditions(state, _APART)))
        return True


def run(
    agent: Agent,
    vehicle: Vehicle,
    inbox: Inbox,
    mouth: Mouth,
    links: NearLinks,
    status: StatusReporter,
    clock: Clock,
    stopping: threading.Event,
) -> None:
    """Runs an agent until `stopping` is set.

    Args:
        agent: Its brain.
        vehicle: Its body.
        inbox: Filled by the bus with everything in `agent.senses.keys`.
        mouth: Sends what it says.
        links: To those who come near.
        status: Tells its health.
        clock: The process's clock.
        stopping: Ends the loop.
    """
    turns = Turns(Pilot(agent, vehicle, inbox, mouth, clock).turn, clock)
    inbox.answer = turns.take_aside
    while not stopping.is_set():
        turns.take()
        links.follow(agent.near)
        status.tick(agent.steps, "running" if agent.steps else "starting", agent.senses.rejected)
        turns.rest(LONGEST_WAIT)
    turns.end()
    links.close()
    status.tick(agent.steps, "ending", agent.senses.rejected, force=True)


def command(vehicle: Vehicle, state: DroneState) -> None:
    """Gives the vehicle what a step decided."""
    if state.mode is Mode.STOP:
        vehicle.stop()
    elif state.mode is Mode.GROUND:
        vehicle.idle()
    elif state.pose_age > POSE_LOST:
        vehicle.descend()
    else:
        vehicle.fly(state.setpoint)
