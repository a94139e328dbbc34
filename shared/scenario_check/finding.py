"""What a cross-check finds."""

from attrs import frozen

ROUNDING = 1e-9
"""What is too far by less than this fits, m."""


@frozen
class Finding:
    """One thing that does not go together.

    Attributes:
        key: The key to change, as the scenario file writes it.
        what: What is wrong, with numbers.
        advice: What to do.
    """

    key: str
    what: str
    advice: str

    def __str__(self) -> str:
        """Returns it in one line."""
        return f"at key {self.key}: {self.what}; {self.advice}"
