"""Quantiles of a stream of positive numbers in fixed memory."""

import math
from collections import Counter
from typing import NamedTuple

_SMALLEST = 1e-3
_DECADES = 8
_BINS_PER_DECADE = 200
_LAST = _DECADES * _BINS_PER_DECADE - 1


class Quantiles(NamedTuple):
    """Median and 99th percentile; None while nothing has been counted."""

    p50: float | None
    p99: float | None


class Histogram:
    """Counts numbers in logarithmic bins from 1e-3 to 1e5, 1.2 % wide; what lies outside goes to the ends.

    Only bins that hold something take memory: there may be one for every link that anybody claims to have.
    """

    def __init__(self) -> None:
        self._counts: Counter[int] = Counter()
        self._total = 0

    def add(self, value: float) -> None:
        """Counts one finite number."""
        index = 0 if value <= _SMALLEST else int(math.log10(value / _SMALLEST) * _BINS_PER_DECADE)
        self._counts[min(index, _LAST)] += 1
        self._total += 1

    def quantile(self, fraction: float) -> float | None:
        """Returns the number below which `fraction` (0..1) of all lie, None if there are none."""
        wanted = fraction * self._total
        seen = 0
        for index in sorted(self._counts):
            seen += self._counts[index]
            if seen >= wanted:
                return float(_SMALLEST * 10.0 ** ((index + 0.5) / _BINS_PER_DECADE))
        return None

    def quantiles(self) -> Quantiles:
        """Returns the median and the 99th percentile."""
        return Quantiles(self.quantile(0.5), self.quantile(0.99))
