"""URIs by which backends are chosen: `scheme:path?key=value&...`, or `scheme://path?...`.

A path is what the user would type at a prompt, with `#`, `%`, `[` and blanks in it; only what follows its last
`?` is taken for options, where it looks like some. `%20` and its like stand for their characters, but `%25`
does not: a percent sign is one. A file that is there under the literal name goes before.
"""

import math
import re
from collections.abc import Mapping
from urllib.parse import unquote

from attrs import field, frozen

from shared.errors import ConfigError

_SCHEME = re.compile(r"([a-z][a-z0-9+.-]*):(?://)?", re.IGNORECASE)
_OPTIONS = re.compile(r"[a-z_]+=[^&]*(?:&[a-z_]+=[^&]*)*")
_WORDS = re.compile(r"[a-z_&=]*")


@frozen(kw_only=True)
class Uri:
    """A parsed URI.

    Attributes:
        text: As the user gave it.
        scheme: Names the backend.
        literal: What follows the scheme (and `//`), as it is.
        options: What follows the last `?`, as it is.
    """

    text: str
    scheme: str
    literal: str
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

    @property
    def path(self) -> str:
        """What follows the scheme (and `//`), percent-decoded but for `%25`."""
        return unquote(self.literal.replace("%25", "%2525"))


def parse_uri(text: str, *, example: str) -> Uri:
    """Splits a URI.

    Args:
        text: As the user gave it.
        example: A good one, for the message.

    Raises:
        ConfigError: It has no scheme, or an option without a value.
    """
    found = _SCHEME.match(text)
    if not found:
        raise ConfigError(f"{text}: no scheme; for example {example}")
    rest = text[found.end() :]
    path, mark, tail = rest.rpartition("?")
    if mark and _OPTIONS.fullmatch(tail):
        pairs = (pair.partition("=") for pair in tail.split("&"))
        options = {name: value for name, _, value in pairs}
    elif mark and _WORDS.fullmatch(tail):
        raise ConfigError(f"{text}: not a URI: options are key=value; for example {example}")
    else:
        path, options = rest, {}
    return Uri(text=text, scheme=found[1].lower(), literal=path, options=options)
