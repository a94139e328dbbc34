"""Keys: certificates that end, secrets that others may read, the list of members."""

import datetime
from collections.abc import Callable, Iterator
from pathlib import Path

from deploy.doctor.finding import Finding, bad, good, warning
from deploy.net import FOLDER
from shared.errors import ConfigError
from shared.net.anchors import check_issued
from shared.net.keyring import Keyring
from shared.scenario import Scenario

_OTHERS = 0o077
"""Permissions of a group and of everybody."""


def check_keys(scenario: Scenario, now: datetime.datetime) -> Iterator[Finding]:
    """Looks at the keys that the scenario names, or else at those in the default place, if there are any.

    Args:
        scenario: What is to fly; without keys of its own nothing that is wrong here keeps it on the ground.
        now: The time, with its zone.
    """
    folder = Path(scenario.net.keys or FOLDER)
    if not scenario.net.keys and not folder.is_dir():
        return
    grave = bad if scenario.net.keys else warning
    findings = [*_certificates(folder, now, grave), *_modes(folder)]
    yield from findings or [
        good(f"keys in {folder}", "members, certificates and permissions are as they should be")
    ]


def _certificates(
    folder: Path, now: datetime.datetime, grave: Callable[[str, str, str], Finding]
) -> Iterator[Finding]:
    try:
        from deploy.net.authority import WARN_DAYS, issued  # noqa: PLC0415  cryptography is an extra

        keyring = Keyring(folder)
        certificates = issued(keyring)
    except ConfigError as error:
        yield grave(f"keys in {folder}", str(error), "swarmtouch net keys init, then issue; or copy them here")
        return
    if not certificates:
        yield grave(f"keys in {folder}", "no certificate", "copy ca.crt and the node's own pair here")
    for each in certificates:
        left = each.days_left(now)
        if left < WARN_DAYS:
            ends = f"{'ended' if left < 0 else 'ends'} on {each.expires:%Y-%m-%d}"
            again = f"swarmtouch net keys issue SCENARIO {each.name}, then copy it to its node"
            whole = "make the swarm's keys anew: swarmtouch net keys init with another --keys"
            finding = grave if left < 0 else warning
            yield finding(f"certificate {each.name}", ends, again if each.is_member else whole)
        elif each.is_member:
            try:
                check_issued(keyring.certificate(each.name), keyring.authority, each.name)
            except ConfigError as error:
                yield grave(f"certificate {each.name}", str(error), "as it says")


def _modes(folder: Path) -> Iterator[Finding]:
    for path in (folder, *sorted(folder.glob("*.key"))):
        if path.exists() and path.stat().st_mode & _OTHERS:
            mode = 700 if path == folder else 600
            yield warning(
                f"permissions of {path}", "others on this machine may read it", f"chmod {mode} {path}"
            )
