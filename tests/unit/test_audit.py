"""Who is linked and who is refused, from Zenoh's events and its own log."""

from shared.clock import NS_PER_S
from shared.codec import MAX_PAYLOAD, encode
from shared.messages import ProcessStatus
from shared.net.audit import MAX_NAMES, OTHERS, Audit

ZID = "3551f63a5eee554bf53356f9eeea927f"
DECIDED = (
    f"TRACE ThreadId(14) zenoh::access_control: Using cached result: {ZID} is unauthorized to Put (ingress) on"
    " s/human/hand"
)
FIRST = (
    f"TRACE rx-1 ThreadId(14) zenoh::access_control: {ZID} on Interface(lo)+CertCommonName(drone/2)+{ZID}"
    " is unauthorized to Put (ingress) on s/human/hand"
)
DROPPED = "TRACE rx-1 ThreadId(14) zenoh::net::routing::interceptor: Msg intercepted!"
REFUSED = f"{DECIDED}\n{DROPPED}"
STRANGER_LOG = (
    'WARN acc-0 zenoh_link_commons: QUIC acceptor failed: TransportError(Error { reason: "invalid'
    ' peer certificate: BadSignature" })'
)


def audit() -> Audit:
    return Audit(["drone/1", "drone/2"])


def test_links_are_told_by_name_until_they_go() -> None:
    watched = audit()
    watched.linked(ZID, "drone/2", present=True)
    assert watched.metrics() == {"linked drone/2": 1.0}
    watched.linked(ZID, "drone/2", present=False)
    assert watched.metrics() == {}


def test_a_link_of_two_streams_is_one_link() -> None:
    watched = audit()
    for _ in range(2):
        watched.linked(ZID, "mallory", present=True)
    assert watched.metrics() == {"linked mallory": 1.0, "refused mallory": 1.0}


def test_refused_messages_are_counted_under_the_name_in_the_certificate() -> None:
    watched = audit()
    watched.linked(ZID, "drone/2", present=True)
    watched.linked(ZID, "drone/2", present=False)  # the log comes a little later than the end of the link
    watched.read(f"{FIRST}\n{FIRST}\n{DROPPED}\n{REFUSED}\n{REFUSED}")
    assert watched.metrics() == {"refused drone/2 put s/human/hand": 3.0}


def test_a_decision_without_a_message_is_not_counted() -> None:
    watched = audit()
    watched.read(f"{FIRST}\n{DROPPED.replace('(14)', '(15)')}")
    assert watched.metrics() == {}


def test_what_the_rules_allow_and_is_dropped_all_the_same_was_too_large() -> None:
    watched = audit()
    watched.linked(ZID, "drone/2", present=True)
    allowed = FIRST.replace("unauthorized", "authorized")
    watched.read(f"{FIRST}\n{allowed}\n{DROPPED}\n{allowed}\n{allowed}")
    assert watched.metrics() == {"linked drone/2": 1.0, "refused drone/2 put s/human/hand, too large": 1.0}


def test_what_is_authorized_or_leaves_is_not_counted() -> None:
    watched = audit()
    watched.read(FIRST.replace("unauthorized", "authorized"))
    watched.read(f"{FIRST}\n{FIRST.replace('ingress', 'egress')}\n{DROPPED}")
    watched.read(REFUSED.replace("ingress", "egress"))
    watched.read(REFUSED.replace("Put", "Query"))
    assert watched.metrics() == {}


def test_strangers_are_counted_by_reason() -> None:
    watched = audit()
    watched.read(STRANGER_LOG)
    assert watched.metrics() == {
        "refused a node without a certificate of ours (invalid peer certificate: BadSignature)": 1.0
    }


def test_refusals_are_reported_once_a_second_and_only_the_news() -> None:
    watched = audit()
    watched.read(REFUSED)
    assert watched.report(NS_PER_S) == f"{ZID} put s/human/hand (1 times)"
    watched.read(f"{REFUSED}\n{REFUSED}")
    assert watched.report(NS_PER_S + NS_PER_S // 2) is None
    assert watched.report(2 * NS_PER_S) == f"{ZID} put s/human/hand (2 times)"
    assert watched.report(3 * NS_PER_S) is None


def test_whoever_knocks_cannot_fill_the_memory() -> None:
    watched = audit()
    for number in range(1000):
        watched.linked(f"{number:x}", f"mallory-{number}", present=True)
        watched.linked(f"{number:x}", f"mallory-{number}", present=False)
    refused = watched.metrics()
    assert len(refused) == MAX_NAMES + 1
    assert refused[f"refused {OTHERS}"] == 1000.0 - MAX_NAMES


def test_whoever_knocks_cannot_make_a_status_too_large_to_be_heard() -> None:
    watched = audit()
    for number in range(2 * MAX_NAMES):
        watched.linked(f"{number:x}", f"{number}" + "m" * 62, present=True)
        watched.read(REFUSED.replace("s/human/hand", f"s/{number}/" + "x" * 4000))
    status = ProcessStatus(
        epoch=1,
        seq=1,
        stamp_ns=1,
        role="drone",
        id=1,
        pid=1,
        host="h" * 64,
        state="running",
        metrics=watched.metrics(),
    )
    assert len(encode(status)) <= MAX_PAYLOAD - 500  # what else an agent tells of itself
