"""What a check finds."""

import enum

from attrs import frozen


class Verdict(enum.StrEnum):
    """How it is."""

    GOOD = "good"
    WARNING = "warning"
    """Something will not work, or not well."""
    BAD = "bad"
    """Nothing will fly."""


@frozen(kw_only=True)
class Finding:
    """One line of the report.

    Attributes:
        subject: What was looked at.
        verdict: How it is.
        found: What was found.
        advice: What to do, empty if all is well.
    """

    subject: str
    verdict: Verdict
    found: str
    advice: str = ""


def good(subject: str, found: str) -> Finding:
    """Makes a finding with nothing to do."""
    return Finding(subject=subject, verdict=Verdict.GOOD, found=found)


def warning(subject: str, found: str, advice: str) -> Finding:
    """Makes a finding about something that will not work, or not well."""
    return Finding(subject=subject, verdict=Verdict.WARNING, found=found, advice=advice)


def bad(subject: str, found: str, advice: str) -> Finding:
    """Makes a finding about something without which nothing flies."""
    return Finding(subject=subject, verdict=Verdict.BAD, found=found, advice=advice)
