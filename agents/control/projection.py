"""Keeps set-points out of columns by moving them radially: the rule of the recorded flights.

`project_exact` is that rule, reproduced to the digits of the recordings. It jumps from one side of a column
to the other as a goal passes its centre, up to 0.64 m in one tick, so it is for replay only; `project_swept`
is the rule that a vehicle may fly. Planar: columns are vertical and of unlimited height.
"""

import numpy as np
import numpy.typing as npt

Vec = npt.NDArray[np.float64]

SWEPT_MARGIN = 0.06
"""Clearance of a swept set-point beyond the flights' circle, m: room for the vehicle's tracking error."""

TOLERANCE = 1e-9
"""Depth inside a circle that counts as on it, m."""

CENTRE = 1e-12
"""A point this near to a centre is on it: it has no radial direction, m."""


def project_exact(points: Vec, columns: Vec, radius: float) -> Vec:
    """Moves points radially out of every circle that they are in, one circle after the other, in order.

    The order matters: leaving one circle may enter the next, and an earlier one is not looked at again.

    Args:
        points: (..., 2) wanted set-points, m.
        columns: (m, 2) centres, m.
        radius: Radius of the circles, m.

    Returns:
        (..., 2) m. A point exactly on a centre has no radial direction and leaves towards +x.
    """
    points = np.array(points, dtype=np.float64)
    for centre in columns:
        away = points - centre
        distance = np.hypot(away[..., :1], away[..., 1:])
        off_centre = distance > CENTRE
        direction = np.where(off_centre, away / np.where(off_centre, distance, 1.0), (1.0, 0.0))
        points = np.where(distance < radius, centre + radius * direction, points)
    return points


def project_swept(
    previous: Vec, targets: Vec, columns: Vec, radius: float, step: float, *, margin: float = SWEPT_MARGIN
) -> Vec:
    """Moves set-points towards their projected targets without ever crossing a column.

    The target is projected out of the circles of `radius + margin` like in `project_exact`. The way there is
    straight; where it would enter a circle only its tangential part is kept, so the set-point slides around
    the column, or waits where sliding does not bring it nearer. A set-point that starts inside a circle first
    leaves it radially.

    Args:
        previous: (..., 2) set-points of the previous tick, m.
        targets: (..., 2) wanted set-points, m.
        columns: (m, 2) centres, m.
        radius: Radius of the flights' circle, m.
        step: Longest move in this tick, m.
        margin: Added to the radius, m.

    Returns:
        (..., 2) m: at most `step` from `previous`, and the move comes no nearer to any centre than the
        smaller of `radius + margin` and the distance it starts at.
    """
    previous = np.asarray(previous, dtype=np.float64)
    clearance = radius + margin
    # The tolerance keeps a set-point that slides on a circle from counting as inside it by rounding.
    outside = project_exact(previous, columns, clearance - TOLERANCE)
    trapped = np.any(outside != previous, axis=-1, keepdims=True)
    move = _shorten(np.where(trapped, outside, project_exact(targets, columns, clearance)) - previous, step)
    for centre in columns:
        move = np.where(_enters(previous, move, centre, clearance), _tangential(previous, move, centre), move)
    for centre in columns:
        # Sliding past one column may have turned the move into another: then it waits.
        move = np.where(_enters(previous, move, centre, clearance), 0.0, move)
    return previous + move


def _shorten(move: Vec, longest: float) -> Vec:
    length = np.linalg.norm(move, axis=-1, keepdims=True)
    shortened: Vec = move * np.minimum(1.0, longest / np.where(length > 0.0, length, 1.0))
    return shortened


def _tangential(start: Vec, move: Vec, centre: Vec) -> Vec:
    """Removes the part of the moves that points towards the centre, (..., 2)."""
    away = start - centre
    distance = np.hypot(away[..., :1], away[..., 1:])
    outwards = away / np.where(distance > 0.0, distance, 1.0)
    tangential: Vec = move - np.minimum(0.0, np.sum(move * outwards, axis=-1, keepdims=True)) * outwards
    return tangential


def _enters(start: Vec, move: Vec, centre: Vec, clearance: float) -> npt.NDArray[np.bool_]:
    """Says whether a move comes nearer to the centre than `clearance` and than where it starts, (..., 1)."""
    to_centre = centre - start
    squared = np.sum(move * move, axis=-1, keepdims=True)
    along = np.sum(to_centre * move, axis=-1, keepdims=True) / np.where(squared > 0.0, squared, 1.0)
    nearest = np.linalg.norm(to_centre - np.clip(along, 0.0, 1.0) * move, axis=-1, keepdims=True)
    allowed = np.minimum(clearance, np.linalg.norm(to_centre, axis=-1, keepdims=True))
    entering: npt.NDArray[np.bool_] = nearest < allowed - TOLERANCE
    return entering
