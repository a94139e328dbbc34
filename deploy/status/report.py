"""From what was heard of a swarm to one verdict per process. Pure."""

from collections.abc import Collection, Iterable

from attrs import frozen

from glove_bridge.bridge import GLOVE_THERE
from shared.conditions import conditions
from shared.messages import DroneState, Flag, ProcessStatus
from shared.net.audit import LINKED, REFUSED
from shared.nodes import DRONE, RELAY, WORLD
from shared.plain_text import plain

_LONGEST_STATE = 40
WELL_STATES = ("running", "starting")
WORRYING = (
    Flag.BLOCKED
    | Flag.FENCE
    | Flag.LOW_BATTERY
    | Flag.CRITICAL_BATTERY
    | Flag.OLD_POSE
    | Flag.HAND_STALE
    | Flag.REJECTED_INPUT
    | Flag.WAITING
    | Flag.MISSED
)


@frozen(kw_only=True)
class Heard:
    """What was heard of one process.

    Attributes:
        present: Whether its liveliness token is there.
        status: Its newest health, None if it has said nothing while somebody listened.
        state: Its newest drone state, None for others.
    """

    present: bool = False
    status: ProcessStatus | None = None
    state: DroneState | None = None


@frozen(kw_only=True)
class Row:
    """The verdict on one process.

    Attributes:
        token: For example `drone/2`.
        heard: What it was made from.
        problems: What is wrong, empty if it is well.
    """

    token: str
    heard: Heard
    problems: tuple[str, ...]

    @property
    def links(self) -> dict[str, int]:
        """Who is linked to it, by the name in the certificate, and how often; empty without keys."""
        return self._audited(LINKED)

    @property
    def refused(self) -> dict[str, int]:
        """Whom it has refused, with what, and how often."""
        return self._audited(REFUSED)

    @property
    def rejected(self) -> dict[str, int]:
        """How many messages it has dropped, by reason."""
        rejected = self.heard.status.rejected if self.heard.status else {}
        return {plain(reason): count for reason, count in rejected.items()}

    def _audited(self, prefix: str) -> dict[str, int]:
        metrics = self.heard.status.metrics if self.heard.status else {}
        return {
            plain(name.removeprefix(prefix)): int(n) for name, n in metrics.items() if name.startswith(prefix)
        }

    @property
    def well(self) -> bool:
        """Whether nothing is wrong."""
        return not self.problems


def expected_processes(ids: Iterable[int], *, simulated: bool) -> tuple[str, ...]:
    """Returns the tokens without which a swarm does not fly.

    Args:
        ids: Numbers of the drones.
        simulated: Whether a vehicle is simulated, which takes a world.
    """
    world = (f"{WORLD}/0",) if simulated else ()
    return (f"{RELAY}/0", *world, *(f"{DRONE}/{i}" for i in ids))


def judge(token: str, heard: Heard) -> Row:
    """Judges one process that should be there."""
    problems = []
    if not heard.present:
        problems.append("absent")
    if heard.status is None:
        problems.append("says nothing")
    elif heard.status.state not in WELL_STATES:
        problems.append(plain(heard.status.state, _LONGEST_STATE))
    if heard.status is not None and heard.status.metrics.get(GLOVE_THERE) == 0.0:
        problems.append("no glove that can be felt")
    if token.startswith(f"{DRONE}/") and heard.state is None:
        problems.append("sends no state")
    if heard.state is not None:
        problems += conditions(heard.state, WORRYING)
    return Row(token=token, heard=heard, problems=tuple(problems))


def rows_of(expected: Collection[str], heard: dict[str, Heard], only: Collection[str] = ()) -> list[Row]:
    """Judges everybody who should be there and everybody else who is.

    Args:
        expected: Tokens of those who should be there.
        heard: What was heard, by token.
        only: Tokens that count; empty for all.
    """
    known = [*expected, *sorted(set(heard) - set(expected))]
    unknown = [token for token in only if token not in known]
    return [
        judge(token, heard.get(token, Heard())) for token in [*known, *unknown] if not only or token in only
    ]
