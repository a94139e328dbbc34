"""How large a swarm can be and still be on time: what that means for agents and bare nodes; a search. Pure."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

from attrs import frozen

from deploy.bench.hop import Token
from observer.agent_log import ON_TIME_NS, AgentSummary
from shared.clock import NS_PER_S

ON_TIME = 0.99
"""The least share of each part of `Punctuality`."""


@frozen(kw_only=True)
class Punctuality:
    """Means over a swarm.

    Attributes:
        on_time: Fraction of the steps, or answers, that started within 4 ms of the last input they needed.
        used: Fraction of the hand samples that were used, or answered.
        rate: Steps, or answers, per sample that the hand should have sent.
    """

    on_time: float
    used: float
    rate: float

    @property
    def keeps_up(self) -> bool:
        """Whether the swarm is on time at the rate of the hand."""
        return min(self.on_time, self.used, self.rate) >= ON_TIME


LOST = Punctuality(on_time=0.0, used=0.0, rate=0.0)
"""Of a swarm that did not come together."""


def of_agents(summaries: Sequence[AgentSummary], hand_hz: float) -> Punctuality:
    """Returns the punctuality of agents; a state that the observer did not receive does not count."""
    received = [s.steps - s.missed for s in summaries]
    on_time = sum(s.on_time * n for s, n in zip(summaries, received, strict=True))
    return Punctuality(
        on_time=on_time / max(sum(received), 1),
        used=_mean(s.hand_used for s in summaries),
        rate=_mean(s.rate_hz for s in summaries) / hand_hz,
    )


def of_bare(answers: Collection[Sequence[Token]], hand_hz: float) -> Punctuality:
    """Returns the punctuality of bare nodes.

    Args:
        answers: What each of them has sent.
        hand_hz: Rate of the hand.
    """
    late_ns = [token.stamp_ns - token.arrival_ns for tokens in answers for token in tokens]
    return Punctuality(
        on_time=_mean(late <= ON_TIME_NS for late in late_ns),
        used=_mean(map(_answered, answers)),
        rate=_mean(map(_rate_hz, answers)) / hand_hz,
    )


def _answered(tokens: Sequence[Token]) -> float:
    """Returns which fraction of the samples a node has answered, by its own count, from its first answer on."""
    samples = tokens[-1].number - tokens[0].number if tokens else 0
    return (tokens[-1].seq - tokens[0].seq) / samples if samples else 0.0


def _rate_hz(tokens: Sequence[Token]) -> float:
    span_ns = tokens[-1].stamp_ns - tokens[0].stamp_ns if tokens else 0
    return (tokens[-1].seq - tokens[0].seq) * NS_PER_S / span_ns if span_ns else 0.0


class Ladder:
    """Looks for the largest size that passes: doubles until one fails, then halves what is between.

    Args:
        largest: No larger one is tried.
    """

    def __init__(self, largest: int) -> None:
        self._largest = largest
        self.tried: dict[int, bool] = {}

    @property
    def reached(self) -> int:
        """The largest size that has passed below every one that failed, 0 if there is none."""
        return max((size for size, passed in self.tried.items() if passed and size < self._failed), default=0)

    @property
    def next(self) -> int | None:
        """The size to try next; None when the largest is known."""
        low, high = self.reached, self._failed
        if high <= self._largest:
            return (low + high) // 2 if high - low > 1 else None
        return min(max(2 * low, 1), self._largest) if low < self._largest else None

    @property
    def _failed(self) -> int:
        """The smallest size that has failed, or one more than the largest."""
        return min((size for size, passed in self.tried.items() if not passed), default=self._largest + 1)


def climb(ladders: Mapping[str, Ladder], probe: Callable[[str, int], None]) -> None:
    """Tries sizes, one of each kind in turns, until the largest of all kinds are known.

    Args:
        ladders: By kind.
        probe: Tries a size of a kind and enters it in `tried`.
    """
    while waiting := {kind: size for kind, ladder in ladders.items() if (size := ladder.next) is not None}:
        for kind, size in waiting.items():
            probe(kind, size)


def _mean(values: Iterable[float]) -> float:
    kept = list(values)
    return sum(kept) / len(kept) if kept else 0.0
