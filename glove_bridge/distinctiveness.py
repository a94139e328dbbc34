"""How well patterns can be told apart: a fitted model of perception, so every number here is a prediction.

Pure. The drive of each finger (frequency over 250 Hz) passes the lag of the vibration motor, then a blur over
time and neighbouring fingers; the distance d of two patterns is the L2 distance of what is left, over fingers
and seconds. Pattern i is answered as j with probability (1 - lapse) softmax_j(bias_j - (c d_ij)^p) + lapse / n.

The parameters ship as data (`glove_bridge.perception`). They were fitted to eight stimuli: trust comparisons,
not decimals.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from attrs import Factory, field, frozen

from glove_bridge.patterns.pattern import Pattern
from glove_bridge.patterns.schema import FINGERS, LONGEST_PATTERN_MS
from shared.arrays import Vec

FULL_HZ = 250.0
"""Frequency that counts as full drive."""
TICK_S = 0.01
_CUT = 4.0
"""Standard deviations after which a blur is cut off."""


@frozen(kw_only=True)
class Perception:
    """The parameters of the model.

    Attributes:
        motor_s: Lag of the vibration motor, s.
        blur_s: Standard deviation of the blur over time, s.
        blur_fingers: Standard deviation of the blur over fingers, fingers.
        scale: c, per unit of distance.
        exponent: p.
        lapse: Share of answers at random.
        bias: Preference for answering a pattern by its name; others have none.
    """

    motor_s: float
    blur_s: float
    blur_fingers: float
    scale: float
    exponent: float
    lapse: float
    bias: Mapping[str, float] = Factory(dict)


@frozen(kw_only=True)
class Prediction:
    """What the model says of n patterns.

    Attributes:
        names: Names of the patterns.
        distances: (n, n) distances.
        confusion: (n, n) probability that the pattern of a row is answered as that of a column.
    """

    names: tuple[str, ...]
    distances: Vec = field(eq=False)
    confusion: Vec = field(eq=False)

    @property
    def accuracy(self) -> float:
        """Share of correct answers if every pattern is equally frequent."""
        return float(np.mean(np.diag(self.confusion)))

    @property
    def bits(self) -> float:
        """Information that an answer carries, bits."""
        return information_bits(self.confusion)

    @property
    def closest(self) -> tuple[float, str, str]:
        """The smallest distance of two patterns, and which they are."""
        rows, columns = np.triu_indices(len(self.names), k=1)
        nearest = int(np.argmin(self.distances[rows, columns]))
        i, j = int(rows[nearest]), int(columns[nearest])
        return float(self.distances[i, j]), self.names[i], self.names[j]


def predict(patterns: Sequence[Pattern], perception: Perception) -> Prediction:
    """Predicts how two or more patterns are recognised among each other."""
    names = tuple(pattern.name for pattern in patterns)
    distances = pattern_distances(patterns, perception)
    biases = np.array([perception.bias.get(name, 0.0) for name in names])
    return Prediction(names=names, distances=distances, confusion=confuse(distances, biases, perception))


def pattern_distances(patterns: Sequence[Pattern], perception: Perception) -> Vec:
    """Returns the (n, n) distances of n patterns that start at the same time."""
    felt = np.array([feel(pattern, perception).ravel() for pattern in patterns])
    distances: Vec = np.sqrt(TICK_S * np.sum((felt[:, None] - felt[None]) ** 2, axis=2))
    return distances


def confuse(distances: Vec, biases: Vec, perception: Perception) -> Vec:
    """Returns the (n, n) probabilities of answering column j to pattern i, rows sum to 1.

    Args:
        distances: (n, n).
        biases: (n,) of the answers.
        perception: Scale, exponent and lapse count.
    """
    preference = biases - (perception.scale * distances) ** perception.exponent
    weight = np.exp(preference - preference.max(axis=1, keepdims=True))
    chosen: Vec = weight / weight.sum(axis=1, keepdims=True)
    return (1.0 - perception.lapse) * chosen + perception.lapse / len(distances)


def feel(pattern: Pattern, perception: Perception) -> Vec:
    """Returns what is felt of a pattern, (5, T) at `TICK_S`, T the same for every pattern."""
    moving = _motor(_drive(pattern), perception.motor_s)
    half = round(_CUT * perception.blur_s / TICK_S)
    over_time = _bell(TICK_S * np.arange(-half, half + 1.0), perception.blur_s)
    over_time /= over_time.sum()
    fingers = np.array(FINGERS, dtype=np.float64)
    over_fingers = _bell(fingers[:, None] - fingers, perception.blur_fingers)
    over_fingers /= over_fingers.sum(axis=1, keepdims=True)
    felt: Vec = over_fingers @ np.array([np.convolve(row, over_time) for row in moving])
    return felt


def information_bits(confusion: Vec) -> float:
    """Mutual information of pattern and answer for equally frequent patterns, bits.

    Args:
        confusion: (n, n) probabilities, rows sum to 1.
    """
    answers = np.broadcast_to(confusion.mean(axis=0), confusion.shape)
    possible = confusion > 0.0
    gain = confusion[possible] * np.log2(confusion[possible] / answers[possible])
    return float(gain.sum() / len(confusion))


def _drive(pattern: Pattern) -> Vec:
    ticks = round(LONGEST_PATTERN_MS / 1000.0 / TICK_S)
    drive, start_ms = np.zeros((len(FINGERS), ticks)), 0
    for frame in pattern.frames:
        first, last = (round(ms / 1000.0 / TICK_S) for ms in (start_ms, start_ms + frame.ms))
        for finger, hz in frame.hz.items():
            drive[finger - 1, first:last] = hz / FULL_HZ
        start_ms += frame.ms
    return drive


def _motor(drive: Vec, lag: float) -> Vec:
    """First-order lag, as a vibration motor spins up and down."""
    share = 1.0 - np.exp(-TICK_S / lag)
    response = share * np.power(1.0 - share, np.arange(drive.shape[1]))
    return np.array([np.convolve(row, response)[: len(row)] for row in drive])


def _bell(x: Vec, deviation: float) -> Vec:
    bell: Vec = np.exp(-0.5 * np.square(x / deviation))
    return bell
