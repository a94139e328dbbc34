"""What a hand source is: poses with the operator's wish, at the source's own pace."""

import math
from collections.abc import Mapping
from typing import Protocol
from urllib.parse import parse_qsl, unquote, urlsplit

from attrs import field, frozen

from shared.errors import ConfigError
from shared.messages import Vector, Wish


@frozen(kw_only=True)
class HandPose:
    """One sample of the hand.

    Attributes:
        position: World frame, m.
        yaw: Heading about z relative to the first sample, rad.
        mode: The wish that the source itself expresses.
        t_ns: When the sample was taken, on the clock of the process.
    """

    position: Vector
    yaw: float
    mode: Wish
    t_ns: int


@frozen(kw_only=True)
class SourceUri:
    """A parsed `scheme:path?key=value&...`.

    Attributes:
        text: As the user gave it.
        scheme: Names the backend.
        path: What follows the scheme, percent-decoded.
        options: The query.
    """

    text: str
    scheme: str
    path: str
    options: Mapping[str, str] = field(factory=dict)

    def refuse_unknown(self, *known: str) -> None:
        """Raises `ConfigError` if there is an option that the backend does not know."""
        unknown = sorted(set(self.options) - set(known))
        if unknown:
            raise ConfigError(f"{self.text}: unknown option {unknown[0]!r}; known ones: {', '.join(known)}")

    def number(self, name: str, default: float, *, low: float, high: float) -> float:
        """Returns an option as a number.

        Raises:
            ConfigError: It is not a number in [low, high].
        """
        text = self.options.get(name)
        if text is None:
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise ConfigError(f"{self.text}: {name}={text} must be a number from {low:g} to {high:g}")
        return value


class HandSource(Protocol):
    """A hand, polled by one loop. `poll` never blocks and never raises for bad data."""

    def poll(self, now_ns: int) -> HandPose | None:
        """Returns the newest sample up to now; None while there is no hand (released, not yet seen).

        The same sample again (same `t_ns`) means that there is no new one.
        """
        ...

    def next_ns(self, now_ns: int) -> int:
        """Returns when to poll again: the time of the next sample where it is known."""
        ...

    @property
    def finished(self) -> bool:
        """Whether a recording or a bounded script has ended; stays true."""
        ...

    def close(self) -> None:
        """Releases what the source holds; further calls do nothing."""
        ...


class HandBackend(Protocol):
    """A class of sources, as the backend table loads it."""

    def __call__(self, uri: SourceUri, start_ns: int) -> HandSource:
        """Opens a source whose own time starts at `start_ns` (clock of the process)."""
        ...

    def hints(self, uri: SourceUri) -> dict[str, object]:
        """Returns what the source knows about the mapping: dotted scenario keys and their values."""
        ...


def parse_uri(text: str) -> SourceUri:
    """Splits a source URI.

    Raises:
        ConfigError: It has no scheme, or an option without a value.
    """
    try:
        parts = urlsplit(text)
        options = dict(parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query)))
    except ValueError as error:
        raise ConfigError(f"{text}: not a source URI: {error}; for example scripted:tour?peak=0.4") from error
    if not parts.scheme:
        raise ConfigError(f"{text}: no scheme; for example scripted:tour or recording:{text}")
    path = unquote(parts.netloc + parts.path)
    return SourceUri(text=text, scheme=parts.scheme, path=path, options=options)
