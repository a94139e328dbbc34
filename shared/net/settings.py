"""Zenoh's configuration of any node in any profile, generated from the scenario.

The facts behind the settings are measured: links found by gossip never heal after a partition, so every link is
static; best effort over QUIC with `mixed_rel` keeps 0.5 ms under 20 % loss where TCP needs 30; over UDP a lost
declaration is never repeated and leaves a node deaf for good, so TCP goes beside it. The hand's radio is not
Zenoh's: one malformed datagram in the group ends a multicast session of Zenoh for good (`shared.radio`).
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shared.errors import ConfigError
from shared.formation import Formation
from shared.net.access import access_control, deaf, others
from shared.net.anchors import check_issued, trust_anchors
from shared.net.keyring import Keyring, require
from shared.nodes import RELAY, dials, endpoint
from shared.scenario import Scenario

Settings = dict[str, Any]

LEASE_MS = 1000
KEEP_ALIVES = 10
"""How often per lease an idle link says so: with four, a datagram link that loses a fifth ends in minutes."""
STATES_QUEUED = 16
"""Samples that wait on a link while Zenoh's sending thread does not get the processor: a quarter of a second of
them. With the default of two, a machine that is busy for three periods loses some, and `put` waits besides."""
BATCH_BYTES = 8192
"""Room for the largest message, the codec's 4 KiB, and its key. With Zenoh's 64 KiB so many samples are a
megabyte of memory, which every link that stalls takes and gives back when it is gone."""
MAX_PUT_BYTES = 16_384
"""Zenoh drops larger ones uncounted; what is over the codec's 4 KiB but under this is counted as oversized."""
MAX_MESSAGE_BYTES = 65_536
MAX_SESSIONS = 64
ROUTER_TIMEOUT_MS = 3000
OPEN_TIMEOUT_MS = 4000
"""How long one attempt to dial somebody may take: time for two repetitions of what was lost. A QUIC listener
whose handshake the other side gives up half way waits for it, and lets nobody else in, for a minute or two."""


def node_settings(
    scenario: Scenario, formation: Formation, node: str, *, listening: bool = True, only: str | None = None
) -> Settings:
    """Builds the configuration of one node's Zenoh session.

    Args:
        scenario: The scenario; `net` says how.
        formation: Its formation.
        node: Name of the node (`shared.nodes`).
        listening: False for a node that nobody dials, as any number of observers are.
        only: The one node to dial, for a second session that hears that one.

    Raises:
        ConfigError: The profile wants keys that are not there, or the node has no session.
    """
    net = scenario.net
    if net.profile == "radio" and node == RELAY:
        raise ConfigError(
            "net.profile: in radio the relay has no Zenoh session, it sends to net.multicast only"
        )
    if net.router is not None:
        if net.keys:
            raise ConfigError(
                "net.router: a router would speak for everybody; with net.keys nodes link directly"
            )
        return client_settings(scenario.swarm.name, net.router, adminspace=net.adminspace)
    own, others = endpoint(scenario, formation, node), dials(scenario, formation, node)
    # Who listens in the same place, as the launcher does in an observer's, is heard as well.
    listen, connect = (own, others) if listening else ("", [*others, own])
    if only is not None:
        listen, connect = "", [endpoint(scenario, formation, only)]
    mesh = peer_settings(scenario.swarm.name, listen, connect, adminspace=net.adminspace)
    if net.keys:
        _secure(mesh, Keyring(Path(net.keys)), scenario.swarm.name, node)
    elif net.profile == "field":
        raise ConfigError("net.keys: profile field needs keys; make them with swarmtouch net keys init")
    elif node == RELAY:
        mesh["access_control"] = deaf(scenario.swarm.name, adminspace=net.adminspace)
    return mesh


def peer_settings(
    namespace: str, listen: str, connect: Sequence[str] = (), *, adminspace: bool = False
) -> Settings:
    """Builds the configuration of a peer with static links and no discovery.

    Args:
        namespace: Name of the swarm, prefix of every key.
        listen: Own endpoint, empty to listen nowhere; with `udp/` goes `tcp/` on the same port.
        connect: Endpoints to dial, again and again until they answer; the same holds for them.
        adminspace: Whether to answer adminspace queries.
    """
    heard, dialled = _links(listen), [link for endpoint in connect for link in _links(endpoint)]
    settings = _member(namespace, _node("peer", heard, dialled), adminspace=adminspace)
    if any(link.startswith("udp/") for link in (*heard, *dialled)):
        # Only here: the key pair by which links prove that they belong together takes 20 ms to make.
        settings["transport"]["unicast"]["max_links"] = 2
        # What TCP repeats in bad weather may take longer than the usual lease, and a link that comes back to a
        # transport which only one side has given up leaves both deaf.
        settings["transport"]["link"]["tx"] |= {"lease": 4 * LEASE_MS, "keep_alive": 4 * KEEP_ALIVES}
    return settings


def client_settings(namespace: str, router: str, *, adminspace: bool = False) -> Settings:
    """Builds the configuration of a client of one router; arguments as for `peer_settings`."""
    return _member(namespace, _node("client", (), (router,)), adminspace=adminspace)


def router_settings(listen: str) -> Settings:
    """Builds the configuration of a router that forwards between its clients, of all swarms."""
    return _node("router", (listen,), ())


def _links(endpoint: str) -> tuple[str, ...]:
    """Returns the links behind an endpoint: with UDP for samples goes TCP, on the same port, for all else."""
    protocol, _, address = endpoint.partition("/")
    if protocol == "udp":
        return f"tcp/{address}?rel=1", f"udp/{address}?rel=0"
    return (endpoint,) if endpoint else ()


def _member(namespace: str, node: Settings, *, adminspace: bool = False) -> Settings:
    return node | {
        "namespace": namespace,
        "adminspace": {"enabled": adminspace, "permissions": {"read": True, "write": False}},
    }


def _node(mode: str, listen: Sequence[str], connect: Sequence[str]) -> Settings:
    return {
        "mode": mode,
        "listen": {"endpoints": list(listen), "exit_on_failure": True},
        "connect": {
            "endpoints": list(connect),
            # Peers dial in the background for ever; a client can only wait, and is deaf to signals meanwhile.
            "timeout_ms": ROUTER_TIMEOUT_MS if mode == "client" else -1,
            "exit_on_failure": False,
            # A swarm's processes start together and in any order: who was too early asks again soon.
            "retry": {"period_init_ms": 100, "period_max_ms": 250, "period_increase_factor": 1.5},
        },
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {
            "unicast": {"open_timeout": OPEN_TIMEOUT_MS, "max_sessions": MAX_SESSIONS},
            "link": {
                "tx": {
                    "lease": LEASE_MS,
                    "keep_alive": KEEP_ALIVES,
                    "batch_size": BATCH_BYTES,
                    "queue": {"size": {"real_time": STATES_QUEUED}},
                }
            },
            "shared_memory": {"enabled": False},
        },
    }


def _secure(settings: Settings, keyring: Keyring, swarm: str, node: str) -> None:
    """Adds mutual TLS, access rules and guards."""
    hint = f"issue it with swarmtouch net keys issue {node}, or copy it here from where keys are issued"
    certificate, key = require(keyring.certificate(node), hint), require(keyring.key(node), hint)
    authority, members = Path(require(keyring.authority, hint)), keyring.members()
    check_issued(Path(certificate), authority, node)
    settings["transport"]["link"]["tls"] = {
        "root_ca_certificate_base64": trust_anchors(authority, others(node, members)),
        "enable_mtls": True,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
        "listen_certificate": certificate,
        "listen_private_key": key,
        "connect_certificate": certificate,
        "connect_private_key": key,
    }
    protocols = {address.split("/", maxsplit=1)[0] for address in settings["listen"]["endpoints"]}
    protocols |= {address.split("/", maxsplit=1)[0] for address in settings["connect"]["endpoints"]}
    if protocols - {"quic", "tls"}:
        raise ConfigError(
            f"net.endpoints: with net.keys every endpoint is quic/ or tls/, not {sorted(protocols)}"
        )
    settings["transport"]["link"]["protocols"] = sorted(protocols)
    settings["transport"]["link"]["rx"] = {"max_message_size": MAX_MESSAGE_BYTES}
    settings["access_control"] = access_control(swarm, node, members)
    settings["low_pass_filter"] = [
        {
            "id": "small",
            "messages": ["put"],
            "flows": ["ingress"],
            "key_exprs": ["**"],
            "size_limit": MAX_PUT_BYTES,
        }
    ]
