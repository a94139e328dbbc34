"""`screen://`: a glove made of the console's page, which shows and sounds the pattern events by itself.

It only keeps the time: every pattern starts at once and ends when its frames have passed.
"""

from glove_bridge.gloves.base import CLOSED
from glove_bridge.gloves.timed import TimedGlove
from glove_bridge.patterns.pattern import Frame, Pattern
from shared.uri import Uri


class ScreenGlove(TimedGlove):
    """Keeps the time.

    Args:
        uri: There is nothing to choose in it.
    """

    def __init__(self, uri: Uri | None = None) -> None:
        super().__init__()
        if uri is not None:
            self.check(uri)

    def close(self) -> None:
        """See `Glove.close`."""
        self.fault = CLOSED

    def _show(self, pattern: Pattern | None, frame: Frame | None, now_ns: int) -> None:
        """Whoever watches the pattern events shows them."""
