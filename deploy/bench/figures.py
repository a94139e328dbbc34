"""Numbers that can be trusted: how many, the median, and how far they spread."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from attrs import frozen


@frozen(kw_only=True)
class Spread:
    """Quantiles of a measurement.

    Attributes:
        n: How many values.
        p10: 10 % lie below.
        p50: Median.
        p90: 90 % lie below.
        p99: 99 % lie below.
    """

    n: int
    p10: float
    p50: float
    p90: float
    p99: float

    def text(self, digits: int = 2) -> tuple[str, str, str, str]:
        """Returns median, spread (p10 to p90), p99 and n as cells of a table."""
        low, high = f"{self.p10:.{digits}f}", f"{self.p90:.{digits}f}"
        return f"{self.p50:.{digits}f}", f"{low} to {high}", f"{self.p99:.{digits}f}", str(self.n)


TEXT_COLUMNS = ("median", "p10 to p90", "p99", "n")
"""Headings of `Spread.text`."""


def spread(values: Sequence[float]) -> Spread:
    """Returns the quantiles of at least one value.

    Raises:
        ValueError: There is none.
    """
    if not values:
        raise ValueError("nothing was measured")
    p10, p50, p90, p99 = np.percentile(values, (10, 50, 90, 99)).tolist()
    return Spread(n=len(values), p10=p10, p50=p50, p90=p90, p99=p99)


def ratio_by_round(above: Sequence[Sequence[float]], below: Sequence[Sequence[float]]) -> list[float]:
    """Returns the ratio of the medians, round by round: its spread says how far the ratio can be trusted."""
    return [float(np.median(a) / np.median(b)) for a, b in zip(above, below, strict=True)]


def draw_shares(figure: Any, values: Mapping[str, Sequence[float]], xlabel: str) -> None:
    """Draws the share of values below each value, one line per name, into a `matplotlib` figure."""
    axes = figure.subplots()
    for name, each in values.items():
        axes.plot(np.sort(each), np.arange(1, len(each) + 1) / len(each), label=name)
    axes.set(xscale="log", xlabel=xlabel, ylabel="share below")
    axes.legend()
