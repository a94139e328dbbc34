"""Who may say what, as Zenoh access rules (DESIGN section 8).

Every node enforces the same table on what it receives; nothing relies on the sender's good will. A member is
known by the common name of its certificate, which is its node name. Zenoh's rules match by inclusion: a
subscription is let through if its whole key expression lies within an allowed one.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from shared.nodes import BRIDGE, CONSOLE, OBSERVER, RELAY, WORLD
from shared.topics import ALIVE, DRONE_STATE, FORMATION_STATE, HAND, OBSTACLE, PATTERN, PLACES, STATUS, TOPICS

Rules = dict[str, Any]

OBSERVING_ROLES = (OBSERVER, CONSOLE)
HEARING = ("declare_subscriber", "liveliness_query", "declare_liveliness_subscriber")
"""Messages by which a node says what it wants to hear; nothing in flight depends on their content."""


def writes(node: str) -> tuple[str, ...]:
    """Returns the keys that a node may publish on, without the swarm's name."""
    said = {
        RELAY: (HAND.key(),),
        BRIDGE: (FORMATION_STATE.key(), PATTERN.key()),
        WORLD: (OBSTACLE.wildcard,),
        OBSERVER: (),
    }
    number = node.partition("/")[2]
    states = said[node] if node in said else (DRONE_STATE.key(id=number), PLACES.key(id=number))
    return (*states, *(STATUS.key(role=role, id=ident) for role, ident in _names(node)))


def presence(node: str) -> tuple[str, ...]:
    """Returns the keys of a node's liveliness tokens, without the swarm's name."""
    return tuple(ALIVE.format(role=role, id=ident) for role, ident in _names(node))


def _names(node: str) -> list[tuple[str, str]]:
    """Returns the roles and numbers that a node goes by."""
    if node == OBSERVER:
        # There may be any number of observers, each with a number of its own; a console is one.
        return [(role, "*") for role in OBSERVING_ROLES]
    role, _, number = node.partition("/")
    return [(role, number or "0")]


def others(node: str, members: Iterable[str]) -> list[str]:
    """Returns the members that a node has to do with: there may be several observers, and one of all else."""
    return [member for member in members if member != node or node == OBSERVER]


def access_control(swarm: str, node: str, members: Iterable[str]) -> Rules:
    """Builds the access rules that one node enforces.

    Args:
        swarm: Name of the swarm, prefix of every key on the wire.
        node: The node that enforces them.
        members: Every node that belongs to the swarm, by common name; whoever is not named is refused.

    Returns:
        Zenoh's `access_control` section. What is not allowed is dropped on arrival.
    """
    speakers = others(node, members)
    rules = [_rule("out", ["**"], [*HEARING, "put", "reply", "liveliness_token"], "egress")]
    policies = [{"rules": ["out"], "subjects": ["anyone"]}]
    heard = [f"{swarm}/{key}" for key in (*(topic.wildcard for topic in TOPICS), "alive/**")]
    rules.append(_rule("hear", heard, list(HEARING), "ingress"))
    for member in speakers:
        granted = ["hear"] if member != RELAY else []
        if node != RELAY:
            granted += [f"put {member}", f"alive {member}"]
            said = [f"{swarm}/{key}" for key in writes(member)]
            alive = [f"{swarm}/{key}" for key in presence(member)]
            rules.append(_rule(f"put {member}", said, ["put"], "ingress"))
            rules.append(_rule(f"alive {member}", alive, ["liveliness_token", "reply"], "ingress"))
        if granted:
            policies.append({"rules": granted, "subjects": [member]})
    subjects: list[Mapping[str, Any]] = [{"id": "anyone"}]
    subjects += [{"id": member, "cert_common_names": [member]} for member in speakers]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def deaf(swarm: str, *, adminspace: bool = False) -> Rules:
    """Builds the relay's own simplex for links without certificates.

    The relay takes no sample, token, query or reply from anyone. The one thing that may reach it is which of
    its own keys others want to hear, because a unicast link carries nothing that nobody has asked for.

    Args:
        swarm: Name of the swarm.
        adminspace: Whether Zenoh's own state may be asked for, to inspect the relay; off by default.
    """
    inspect = []
    if adminspace:  # which no `**` covers
        inspect = [_rule("ask", ["@/**"], ["query"], "ingress"), _rule("tell", ["@/**"], ["reply"], "egress")]
    own = [f"{swarm}/{HAND.key()}", f"{swarm}/{STATUS.wildcard}", f"{swarm}/alive/**"]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [
            _rule("out", ["**"], [*HEARING, "put", "reply", "liveliness_token"], "egress"),
            _rule("wanted", own, list(HEARING), "ingress"),
            *inspect,
        ],
        "subjects": [{"id": "anyone"}],
        "policies": [{"rules": ["out", "wanted", *(rule["id"] for rule in inspect)], "subjects": ["anyone"]}],
    }


def _rule(name: str, keys: list[str], messages: list[str], flow: str) -> Rules:
    return {"id": name, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys}
