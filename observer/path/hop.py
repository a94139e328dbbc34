"""What a way is made of: nodes, hops between them, and the parts that the time of a hop consists of. Pure."""

import enum
from collections.abc import Iterator, Mapping

from attrs import frozen

from shared.messages import HandSample

HAND_NODE = "hand"
GLOVE_NODE = "glove"


def drone_node(drone: int) -> str:
    """Returns the name of a drone as a node, for example `drone 2`."""
    return f"drone {drone}"


class Part(enum.StrEnum):
    """What a hop spends its time on; the parts of a hop follow each other without a gap."""

    MISSED = "missed"
    """Until the sender sent the message that was used, if not the first that carried the sample."""
    TRANSPORT = "transport"
    """Until it had arrived, encoding included."""
    WAITING = "waiting"
    """Until the listener's step started: for its other inputs, or because it was busy."""
    COMPUTE = "compute"
    """Until the step was done: for a drone its set-point, for the glove the first frame of the pattern."""


class Cause(enum.StrEnum):
    """Why the first message that carried the sample was not the one that was used."""

    NONE = ""
    LINK = "lost or late on the link"
    LISTENER = "overtaken: the listener was busy or stopped"
    EARLIER = "an earlier step had used it"
    PATTERN = "no pattern was called for, or the glove was busy"


@frozen(kw_only=True)
class Hop:
    """From the first message of a sender that carries a sample to the first result of a listener that does.

    Stamps are of the sender's clock (`sent_ns`, `used_ns`) and of the listener's; on one machine they agree to
    microseconds, between machines `transport` contains their difference.

    Attributes:
        sender: Node.
        listener: Node.
        sent_ns: Stamp of the first message that carries the sample.
        used_ns: Stamp of the message that was used: the same, or a newer one.
        arrival_ns: When that arrived.
        start_ns: When the listener's step started.
        done_ns: When it was done.
        skipped: How many messages of the sender lie between the first that carries the sample and the used one.
        cause: Why, if any.
        on_path: Whether the formation refers along it; else the hand was only heard for its velocity.
    """

    sender: str
    listener: str
    sent_ns: int
    used_ns: int
    arrival_ns: int
    start_ns: int
    done_ns: int
    skipped: int = 0
    cause: Cause = Cause.NONE
    on_path: bool = True

    @property
    def parts_ns(self) -> dict[Part, int]:
        """Returns how long each part took, ns; they add up to `total_ns`."""
        stamps = (self.sent_ns, self.used_ns, self.arrival_ns, self.start_ns, self.done_ns)
        return {part: stamps[i + 1] - stamps[i] for i, part in enumerate(Part)}

    @property
    def total_ns(self) -> int:
        """Returns the time from the sender's message to the listener's result, ns."""
        return self.done_ns - self.sent_ns


@frozen(kw_only=True)
class Effect:
    """The first result of a node that contains a sample through every hop, or a newer one.

    Attributes:
        node: Which.
        done_ns: When it was there.
        seq: Number of the state or pattern event.
        number: Number of the newest sample that it contains; larger than the sample's if that was overtaken.
        directly_ns: When a result first contained the sample in any way; a drone that heard the hand, but not
            yet its reference, steps for the hand's velocity.
        inputs: The hops into it, of every input that carried the sample; the first one decided: among those on
            the path it arrived last.
        lacked: Inputs that the node listens to and that did not carry the sample then.
        pattern: What the glove played.
    """

    node: str
    done_ns: int
    seq: int
    number: int
    directly_ns: int
    inputs: tuple[Hop, ...]
    lacked: tuple[str, ...] = ()
    pattern: str = ""


@frozen(kw_only=True)
class HandPath:
    """A sample and everything that it brought about.

    Attributes:
        number: Number of the sample, counted across restarts of the relay.
        sample: The sample.
        effects: Node -> effect, references first; nodes that it never reached are missing.
    """

    number: int
    sample: HandSample
    effects: Mapping[str, Effect]

    def way(self, node: str) -> tuple[Hop, ...]:
        """Returns the hops that decided, from the hand to a node; each begins where the one before ended.

        Their times add up to `latency_ns`. Empty if the trace lacks a message on the way.
        """
        hops = tuple(self._hops_back(node))[::-1]
        return hops if hops and hops[0].sender == HAND_NODE else ()

    def latency_ns(self, node: str) -> int:
        """Returns the time from the stamp of the sample to the effect on a node, ns."""
        return self.effects[node].done_ns - self.sample.stamp_ns

    def _hops_back(self, node: str) -> Iterator[Hop]:
        while node in self.effects and self.effects[node].inputs:
            hop = self.effects[node].inputs[0]
            yield hop
            node = hop.sender
