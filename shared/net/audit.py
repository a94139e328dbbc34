"""Who is linked to this node, and who was refused (DESIGN section 8).

Zenoh tells of links as events, but of refusals only in its own log, in the words below. The log names a node by
its Zenoh identity, the link by the name in its certificate.
"""

import re
import threading
from collections import Counter
from collections.abc import Iterable

from shared.clock import NS_PER_S
from shared.nodes import OBSERVER

LOG_FILTER = "error,zenoh::net::routing::interceptor=trace,zenoh_link_commons=warn,zenoh_link_tls=warn"
"""Zenoh's log level under which refusals are told."""
REPORT_NS = NS_PER_S
"""Refusals are logged at most this often."""
MAX_NAMES = 16
"""Names are chosen by whoever knocks: more than this many are counted together."""
MAX_NAME = 70
"""So is the key that they try: longer ones are cut, for a status has to stay small enough to be heard."""
MAX_IDENTITIES = 256
MOST_SESSIONS = 8
"""At once, of one member with one node: one is in use, and those of processes that were killed go within the
lease. Who has more is about to take all the places that a node has, and is told of."""
MOST_OBSERVERS = 32
"""Any number of observers share one name."""
OTHERS = "others"
LINKED, REFUSED = "linked ", "refused "
"""What the numbers begin with; the rest is the name."""
TOO_LARGE = "too large"
CROWD = "more links than one node needs"
STRANGER = "a node without a certificate of ours"

_DECISION = re.compile(
    r"ThreadId\((\d+)\).* ([0-9a-f]{1,32}) (?:on \S+ )?is (un)?authorized to (\w+) \((\w+)\) on (\S+)"
)
_COUNTED = (("Put", "ingress"), ("Delete", "ingress"))
_DROPPED = re.compile(r"ThreadId\((\d+)\).* Msg intercepted")
_REJECTED = re.compile(r"acceptor failed.*?(peer sent no certificates|invalid peer certificate: \w+)")


class Audit:
    """Counts; thread-safe, because links, log and status live on different threads.

    Args:
        members: Who belongs to the swarm, by the name in the certificate.
    """

    def __init__(self, members: Iterable[str]) -> None:
        self._members = frozenset(members)
        self._lock = threading.Lock()
        self._names: dict[str, str] = {}
        self._present: dict[str, str] = {}
        self._decided: dict[str, str] = {}
        self._refused: Counter[str] = Counter()
        self._told: Counter[str] = Counter()
        self._told_ns = 0

    def linked(self, identity: str, name: str | None, *, present: bool) -> None:
        """Takes in that a link has come up or gone.

        Args:
            identity: Zenoh identity of the other node.
            name: Common name of its certificate, None without one.
            present: Whether the link is there.
        """
        name = name or STRANGER
        with self._lock:
            if not present:
                self._present.pop(identity, None)
                return
            is_new = identity not in self._present
            self._present[identity] = name
            self._remember(identity, name)
            if is_new and name not in self._members:
                self._count(name)
            most = MOST_OBSERVERS if name == OBSERVER else MOST_SESSIONS
            if is_new and list(self._present.values()).count(name) > most:
                self._count(f"{name}, {CROWD}")

    def read(self, text: str) -> None:
        """Takes in a piece of Zenoh's log, whole lines."""
        if "intercepted" not in text and "acceptor failed" not in text:
            return
        with self._lock:
            for line in text.splitlines():
                self._read_line(line)

    def report(self, now_ns: int) -> str | None:
        """Returns one line about what was refused since the last report, None if nothing or too early."""
        with self._lock:
            if now_ns - self._told_ns < REPORT_NS or self._told == self._refused:
                return None
            news = self._refused - self._told
            self._told, self._told_ns = self._refused.copy(), now_ns
        return ", ".join(f"{who} ({n} times)" for who, n in news.items())

    def metrics(self) -> dict[str, float]:
        """Returns who is linked and how often whom was refused, as numbers for a process's status."""
        with self._lock:
            links = Counter(self._present.values())
            named = {f"{LINKED}{name}": float(n) for name, n in links.most_common(MAX_NAMES)}
            return named | {f"{REFUSED}{who}": float(n) for who, n in self._refused.items()}

    def _read_line(self, line: str) -> None:
        # A decision may be made ahead of any message, and on each of several grounds: what is dropped counts,
        # for the reason that the same thread told last. What the rules allow is dropped for its size alone.
        if decision := _DECISION.search(line):
            thread, identity, refused, verb, flow, key = decision.groups()
            self._decided.pop(thread, None)
            if (verb, flow) in _COUNTED:
                what = f"{self._names.get(identity, identity)} {verb.lower()} {key}"
                self._decided[thread] = what if refused else f"{what[:MAX_NAME]}, {TOO_LARGE}"
        elif (dropped := _DROPPED.search(line)) and (decided := self._decided.pop(dropped[1], None)):
            self._count(decided)
        elif rejected := _REJECTED.search(line):
            self._count(f"{STRANGER} ({rejected[1]})")

    def _remember(self, identity: str, name: str) -> None:
        """Keeps the name beyond the end of the link: the log tells of it a little later."""
        self._names.pop(identity, None)
        self._names[identity] = name
        if len(self._names) > MAX_IDENTITIES:
            del self._names[next(iter(self._names))]

    def _count(self, who: str) -> None:
        who = who[: MAX_NAME + len(f", {TOO_LARGE}")]
        self._refused[who if who in self._refused or len(self._refused) < MAX_NAMES else OTHERS] += 1
