"""Neighbour search with a cell list: who is nearer than a reach, without looking at all pairs."""

import math
from typing import Final, final


class Place:
    """Where something is in the plane, m."""

    __slots__ = ("x", "y")

    def __init__(self, x: float, y: float) -> None:
        self.x: Final = x
        self.y: Final = y


@final
class Cells:
    """Places in square cells at least as wide as the reach, so that neighbours are in the nine around one.

    Args:
        places: Who is where; afterwards called by their numbers in this list.
        reach: m, > 0.

    Attributes:
        cells: Numbers of the places in each cell, column by column.
    """

    __slots__ = ("_columns", "_low_x", "_low_y", "_places", "_reach", "_rows", "_side", "cells")

    def __init__(self, places: list[Place], reach: float) -> None:
        low_x = low_y = math.inf
        high_x = high_y = -math.inf
        for place in places:
            low_x, high_x = min(low_x, place.x), max(high_x, place.x)
            low_y, high_y = min(low_y, place.y), max(high_y, place.y)
        width, height, count = max(high_x - low_x, 0.0), max(high_y - low_y, 0.0), max(float(len(places)), 1.0)
        # However far apart they are, there are no more than a few cells for each of them.
        side = max(reach, math.sqrt(width * height / count), max(width, height) / count)
        self._places, self._reach, self._side = places, reach, side
        self._low_x, self._low_y = low_x, low_y
        self._columns = math.floor(width / side) + 1
        self._rows = math.floor(height / side) + 1
        self.cells: list[list[int]] = [[] for _ in range(self._columns * self._rows)]
        for number, place in enumerate(places):
            self.cells[self._column(place) * self._rows + self._row(place)].append(number)

    def near(self, number: int) -> list[int]:
        """Returns the numbers of those within reach of one of them."""
        own = self._places[number]
        column, row = self._column(own), self._row(own)
        squared = self._reach * self._reach
        found = []
        for i in range(max(column - 1, 0), min(column + 2, self._columns)):
            for j in range(max(row - 1, 0), min(row + 2, self._rows)):
                for other in self.cells[i * self._rows + j]:
                    place = self._places[other]
                    dx, dy = place.x - own.x, place.y - own.y
                    if dx * dx + dy * dy <= squared and other != number:
                        found.append(other)
        return found

    def _column(self, place: Place) -> int:
        return math.floor((place.x - self._low_x) / self._side)

    def _row(self, place: Place) -> int:
        return math.floor((place.y - self._low_y) / self._side)


def near_pairs(points: list[tuple[float, float]], reach: float) -> list[tuple[int, int]]:
    """Returns the pairs of points (m) within reach, by their numbers in the list, each once."""
    cells = Cells([Place(x, y) for x, y in points], reach)
    return [(one, other) for one in range(len(points)) for other in cells.near(one) if one < other]
