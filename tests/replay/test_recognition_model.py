"""The model of perception is the one that fits the answers of the 12 public subjects."""

import csv

import numpy as np
import numpy.typing as npt
import pytest
from attrs import evolve
from scipy.optimize import minimize

from glove_bridge.distinctiveness import Perception, confuse, information_bits, pattern_distances
from glove_bridge.patterns import load_patterns
from glove_bridge.patterns.schema import STATE_PATTERNS
from glove_bridge.perception import load_perception
from tests.replay.flights import ABSENT, DATA

Vec = npt.NDArray[np.float64]

ANSWERS = DATA / "recognition" / "responses.csv"
RIDGE = 0.5

pytestmark = pytest.mark.skipif(not ANSWERS.is_file(), reason=ABSENT)


def count_answers() -> Vec:
    """(8, 8): how often the pattern of a row was answered as that of a column."""
    counts = np.zeros((8, 8))
    with ANSWERS.open(newline="") as file:
        for row in csv.DictReader(file):
            counts[STATE_PATTERNS.index(row["presented"]), STATE_PATTERNS.index(row["response"])] += 1
    return counts


def biases(model: Perception) -> Vec:
    return np.array([model.bias[name] for name in STATE_PATTERNS])


def unlikelihood(counts: Vec, confusion: Vec, bias: Vec) -> float:
    return float(RIDGE * bias @ bias - np.sum(counts * np.log(confusion)))


def distances(model: Perception) -> Vec:
    return pattern_distances(list(load_patterns("paper").patterns.values()), model)


def test_the_model_describes_the_answers() -> None:
    model, counts = load_perception(), count_answers()
    assert counts.sum() == 770
    observed = counts / counts.sum(axis=1, keepdims=True)
    predicted = confuse(distances(model), biases(model), model)
    unbiased = confuse(distances(model), np.zeros(8), model)
    r, r_unbiased = (np.corrcoef(observed.ravel(), p.ravel())[0, 1] for p in (predicted, unbiased))
    print(f"{model}\nr = {r:.4f}, without biases {r_unbiased:.4f}")
    print(
        f"correct: observed {np.mean(np.diag(observed)):.1%}, model {np.mean(np.diag(predicted)):.1%};"
        f" bits: observed {information_bits(observed):.2f}, model {information_bits(predicted):.2f}"
    )
    assert r >= 0.99
    assert r_unbiased >= 0.95
    assert np.mean(np.diag(predicted)) == pytest.approx(np.mean(np.diag(observed)), abs=0.005)


def test_fitting_again_finds_nothing_more_likely() -> None:
    model, counts = load_perception(), count_answers()
    apart = distances(model)

    def cost(x: Vec) -> float:
        tried = evolve(model, scale=np.exp(x[0]), exponent=np.exp(x[1]), lapse=1.0 / (1.0 + np.exp(-x[2])))
        return unlikelihood(counts, confuse(apart, x[3:], tried), x[3:])

    elsewhere = np.array([np.log(8.0), np.log(2.0), -2.0, *np.zeros(8)])
    fitted = minimize(cost, elsewhere, method="BFGS")
    shipped = unlikelihood(counts, confuse(apart, biases(model), model), biases(model))
    print(f"scale {np.exp(fitted.x[0]):.3f}, exponent {np.exp(fitted.x[1]):.4f}, cost {fitted.fun:.3f}")
    assert shipped == pytest.approx(fitted.fun, abs=0.01)
    assert np.exp(fitted.x[0]) == pytest.approx(model.scale, rel=0.02)
    assert fitted.x[3:] == pytest.approx(biases(model), abs=0.05)
