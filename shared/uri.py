"""URIs by which backends are chosen: `scheme:path?key=value&...`."""

import math
from collections.abc import Mapping
from urllib.parse import parse_qsl, unquote, urlsplit

from attrs import field, frozen

from shared.errors import ConfigError


@frozen(kw_only=True)
class Uri:
    """A parsed URI.

    Attributes:
        text: As the user gave it.
        scheme: Names the backend.
        path: What follows the scheme (and `//`), percent-decoded.
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
            hint = f"known ones: {', '.join(known)}" if known else "there are none"
            raise ConfigError(f"{self.text}: unknown option {unknown[0]!r}; {hint}")

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


def parse_uri(text: str, *, example: str) -> Uri:
    """Splits a URI.

    Args:
        text: As the user gave it.
        example: A good one, for the message.

    Raises:
        ConfigError: It has no scheme, or an option without a value.
    """
    try:
        parts = urlsplit(text)
        options = dict(parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query)))
    except ValueError as error:
        raise ConfigError(f"{text}: not a URI: {error}; for example {example}") from error
    if not parts.scheme:
        raise ConfigError(f"{text}: no scheme; for example {example}")
    path = unquote(parts.netloc + parts.path)
    return Uri(text=text, scheme=parts.scheme, path=path, options=options)
