"""The error tree: what went wrong, where, and what to do about it."""


class SwarmTouchError(Exception):
    """Base of every error that SwarmTouch raises on purpose."""


class ConfigError(SwarmTouchError):
    """A configuration that is refused before anything starts: file, key and a hint.

    Args:
        reasons: Everything that is wrong with it, a line each.
    """

    def __init__(self, *reasons: str) -> None:
        super().__init__("\n".join(reasons))
        self.reasons = reasons


class DecodeError(SwarmTouchError):
    """A received payload that is not a valid message; it is counted and dropped.

    Attributes:
        reason: Short, stable word to count by (for example `malformed`, `oversized`, `version`).
        detail: What exactly, for a log.
    """

    def __init__(self, reason: str, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else reason)
        self.reason = reason
        self.detail = detail


class DeviceError(SwarmTouchError):
    """A vehicle, hand source or glove that cannot be reached or does not answer."""
