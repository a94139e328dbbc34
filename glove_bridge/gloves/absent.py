"""`none://`: no glove. The state of the formation is still published, and every pattern fails."""

from collections import Counter

from glove_bridge.gloves.base import Outcome, Report
from glove_bridge.patterns.pattern import Pattern
from shared.uri import Uri


class AbsentGlove:
    """A glove that is not there; see `Glove`."""

    connected = False
    fault = "none was chosen"

    def __init__(self, uri: Uri) -> None:
        """Takes a URI without options."""
        self.check(uri)
        self._reports: list[Report] = []
        self.rejected: Counter[str] = Counter()

    @staticmethod
    def check(uri: Uri) -> None:
        """See `GloveBackend.check`."""
        uri.refuse_unknown()

    def play(self, pattern: Pattern, now_ns: int) -> None:  # noqa: ARG002  interface
        """See `Glove.play`."""
        self._reports.append(Report(Outcome.FAILED, now_ns, self.fault))

    def poll(self, now_ns: int) -> list[Report]:  # noqa: ARG002  interface
        """See `Glove.poll`."""
        reports, self._reports = self._reports, []
        return reports

    def next_ns(self) -> int | None:
        """See `Glove.next_ns`."""
        return None

    def stop(self, now_ns: int) -> None:
        """See `Glove.stop`."""

    def close(self) -> None:
        """See `Glove.close`."""
