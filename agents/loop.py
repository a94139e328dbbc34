"""The process around an agent: receive -> compute -> publish, until told to stop."""

import logging
import threading

from agents.agent import Agent
from agents.control.modes import POSE_LOST
from agents.vehicles.base import Pose, Vehicle
from shared.clock import NS_PER_S, Clock
from shared.codec import encode
from shared.messages import DroneState, Mode
from shared.process import StatusReporter
from shared.transport import Inbox, Publish

LONGEST_WAIT = 0.05
"""The loop looks at the stop event and the clock at least this often, s."""

POSE_WAIT = 0.01
"""A vehicle that has not reported yet is asked again after this long, s."""

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


def run(
    agent: Agent,
    vehicle: Vehicle,
    inbox: Inbox,
    publish: Publish,
    status: StatusReporter,
    clock: Clock,
    stopping: threading.Event,
) -> None:
    """Runs an agent until `stopping` is set.

    Args:
        agent: Its brain.
        vehicle: Its body.
        inbox: Filled by the bus with everything in `agent.senses.keys`.
        publish: Sends its state.
        status: Tells its health.
        clock: The process's clock.
        stopping: Ends the loop.
    """
    poses = PoseWatch(vehicle)
    mode: Mode | None = None
    while not stopping.is_set():
        agent.receive(inbox.take())
        status.tick(agent.steps, "running" if agent.steps else "starting", agent.senses.rejected)
        now = clock()
        wait = (agent.due_ns(now) - now) / NS_PER_S
        if wait > 0:
            inbox.wait(min(wait, LONGEST_WAIT))
            continue
        seen = poses.read(now)
        if seen is None:
            inbox.wait(POSE_WAIT)
            continue
        state = agent.step(now, *seen)
        command(vehicle, state)
        publish(encode(state, clock()))
        if state.mode is not mode:
            _log.info("%s at height %.2f m (%s)", state.mode, state.position[2], state.flags.name or "no flags")
            mode = state.mode
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
