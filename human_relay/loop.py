"""The relay's loop: receive from the source and the operator, compute, publish; nothing comes back."""

import logging
import threading
from collections.abc import Callable

from msgspec.structs import replace

from human_relay.relay import HAND_JUMP, IMPOSSIBLE_POSE, RelayState, due_ns, make_sample, order
from human_relay.sources.base import HandPose, HandSource
from shared.clock import NS_PER_S, Clock
from shared.codec import encode
from shared.messages import Wish
from shared.nodes import RELAY
from shared.process import StatusReporter
from shared.signature import Sign, blank
from shared.topics import HAND
from shared.transport import Bus

_LOG_PERIOD_NS = 5 * NS_PER_S
_log = logging.getLogger("hand")

WaitForOrders = Callable[[float], list[Wish]]
"""Waits for at most so many seconds; returns the operator's orders so far, at once when there are any."""


def run(
    source: HandSource,
    wait: WaitForOrders,
    bus: Bus,
    clock: Clock,
    stopping: threading.Event,
    sign: Sign | None = None,
    hand_hz: float = HAND.rate_hz,
) -> None:
    """Relays until told to stop: each pose of the source once, at its time, and repeats while it is silent.

    Of a source that has more poses than `hand_hz` the newest are sent.

    Args:
        source: The hand.
        wait: The operator, and the only place where the loop rests.
        bus: Only published on.
        clock: Clock of the process, the one that the source was opened with.
        stopping: Ends the loop.
        sign: Signs each sample, where the swarm has keys.
        hand_hz: Samples per second.
    """
    publish = bus.publisher(HAND)
    status = StatusReporter(bus, RELAY, 0, clock)
    state = RelayState(epoch=clock(), period_ns=round(NS_PER_S / hand_hz))
    ordered: list[Wish] = []
    rejected, complain_ns = 0, 0
    for remark in source.remarks:
        _log.warning("%s", remark)

    def report(word: str, *, force: bool = False) -> None:
        metrics = {"samples": float(state.seq)}
        counts = {IMPOSSIBLE_POSE: state.rejected, HAND_JUMP: state.guard.jumps}
        status.tick(state.seq, word, counts, lambda: metrics, force=force)

    while not stopping.is_set():
        now = clock()
        for wish in ordered:
            state = order(state, wish)
        offered = source.poll(now)
        if ordered or now >= due_ns(state, offered):
            state, sample = make_sample(state, offered, now, finished=source.finished)
            if offered and state.rejected > rejected and now >= complain_ns:
                _complain(offered, state)
                complain_ns = now + _LOG_PERIOD_NS
            rejected = state.rejected
            publish(sign(encode(replace(sample, signature=blank()))) if sign else encode(sample))
        report("running")
        wake_ns = min(source.next_ns(now), due_ns(state, offered))
        ordered = wait((wake_ns - clock()) / NS_PER_S)
    report("ending", force=True)


def _complain(offered: HandPose, state: RelayState) -> None:
    place = ", ".join(f"{x:g}" for x in offered.position)
    if state.guard.jumped:
        what = f"the hand cannot have come to ({place}) m: it holds until it moves like a hand again"
    else:
        what = f"no hand can be at ({place}) m"
    _log.warning("%s; in metres? (so far %d jumps, %d poses)", what, state.guard.jumps, state.rejected)
