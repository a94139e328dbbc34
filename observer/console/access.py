"""Who may open the console: checks of a request's Host, Origin and token. Pure.

A page of a foreign site can make a browser open any address, also a WebSocket and also one behind a name that
it has rebound to this machine. Therefore the Host must be an address or a name of this machine, which no
foreign site can rebind, and a request that states an Origin must come from this very site.
"""

import hmac
import ipaddress
from collections.abc import Collection
from urllib.parse import urlsplit

LOCALHOST = "localhost"


def is_own_host(host: str, names: Collection[str]) -> bool:
    """Says whether a Host header names an address, `localhost` or this machine.

    Args:
        host: The header, with or without a port.
        names: Names of this machine, lower case.
    """
    name = _hostname(f"//{host}")
    if name is None:
        return False
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return name in (LOCALHOST, *names) or name.removesuffix(".local") in names
    return True


def is_same_site(origin: str | None, host: str) -> bool:
    """Says whether an Origin header is this site's; programs that are no browser send none."""
    if origin is None:
        return True
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    return parts.scheme in ("http", "https") and parts.netloc.lower() == host.lower()


def is_token(given: str | None, token: str) -> bool:
    """Compares in constant time."""
    return given is not None and hmac.compare_digest(given.encode(errors="replace"), token.encode())


def is_loopback(address: str) -> bool:
    """Says whether an address to bind stays on this machine."""
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return address == LOCALHOST


def _hostname(url: str) -> str | None:
    try:
        return urlsplit(url).hostname
    except ValueError:
        return None
