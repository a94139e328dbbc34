"""Neighbour search with a cell list: who is nearer than a reach, without looking at all pairs."""

import math
from typing import Final, Generic, TypeVar, cast, final


class Place:
    """Where something is in the plane, m, and who comes after it in its cell.

    The collector knows of these, although they are in no cycle: only then does Python let go of a long chain
    without a call within a call for each, and without writing over memory.
    """

    def __init__(self, x: float, y: float) -> None:
        self.x: Final = x
        self.y: Final = y
        self.after: Place | None = None


P = TypeVar("P", bound=Place)


@final
class Cells(Generic[P]):
    """Places in square cells at least as wide as the reach, so that neighbours are in the nine around one.

    The places of a cell are a chain through the places themselves: lists would be as large as what is in them.

    Args:
        places: Who is where; in no other cells from now on.
        reach: m, > 0.

    Attributes:
        cells: The first place in each cell, column by column.
    """

    def __init__(self, places: list[P], reach: float) -> None:
        low_x = low_y = math.inf
        high_x = high_y = -math.inf
        for place in places:
            low_x, high_x = min(low_x, place.x), max(high_x, place.x)
            low_y, high_y = min(low_y, place.y), max(high_y, place.y)
        width, height, count = max(high_x - low_x, 0.0), max(high_y - low_y, 0.0), max(float(len(places)), 1.0)
        # However far apart they are, there are no more than a few cells for each of them.
        side = max(reach, math.sqrt(width * height / count), max(width, height) / count)
        self._reach, self._side = reach, side
        self._low_x, self._low_y = low_x, low_y
        self._columns = math.floor(width / side) + 1
        self._rows = math.floor(height / side) + 1
        self.cells: list[Place | None] = [None] * (self._columns * self._rows)
        for place in reversed(places):
            cell = self._column(place) * self._rows + self._row(place)
            place.after = self.cells[cell]
            self.cells[cell] = place

    def near(self, own: P) -> list[P]:
        """Returns who else is within reach of one of the places."""
        column, row = self._column(own), self._row(own)
        x, y, squared = own.x, own.y, self._reach * self._reach
        found: list[Place] = []
        for i in range(max(column - 1, 0), min(column + 2, self._columns)):
            for j in range(max(row - 1, 0), min(row + 2, self._rows)):
                place = self.cells[i * self._rows + j]
                while place is not None:
                    dx, dy = place.x - x, place.y - y
                    if dx * dx + dy * dy <= squared and place is not own:
                        found.append(place)
                    place = place.after
        return cast("list[P]", found)

    def _column(self, place: Place) -> int:
        return math.floor((place.x - self._low_x) / self._side)

    def _row(self, place: Place) -> int:
        return math.floor((place.y - self._low_y) / self._side)


@final
class _Numbered(Place):
    def __init__(self, number: int, x: float, y: float) -> None:
        super().__init__(x, y)
        self.number: Final = number


def near_pairs(points: list[tuple[float, float]], reach: float) -> list[tuple[int, int]]:
    """Returns the pairs of points (m) within reach, by their numbers in the list, each once."""
    places = [_Numbered(number, x, y) for number, (x, y) in enumerate(points)]
    cells = Cells(places, reach)
    return [
        (one.number, other.number) for one in places for other in cells.near(one) if one.number < other.number
    ]
