"""Pattern sets are the tables of the design, frame by frame; a wrong file is refused with file and key."""

from pathlib import Path

import pytest

from glove_bridge.patterns import load_patterns, shipped_sets
from glove_bridge.patterns.pattern import Pattern
from glove_bridge.patterns.schema import FINGERS, VOCABULARIES
from shared.errors import ConfigError

STATE = VOCABULARIES["state"]
Rows = list[tuple[dict[int, float], int]]

HAND = dict.fromkeys(FINGERS, 250.0)
TABLES: dict[str, dict[str, Rows]] = {
    "paper": {
        "EI": [({3: 150}, 200), ({2: 200, 4: 200}, 200), ({1: 250, 5: 250}, 300)],
        "RI": [({3: 200}, 200), ({2: 200, 4: 200}, 200), ({1: 200, 5: 200}, 200)],
        "CI": [({3: 250}, 300), ({2: 200, 4: 200}, 200), ({1: 150, 5: 150}, 200)],
        "ED": [({1: 250, 5: 250}, 300), ({2: 200, 4: 200}, 200), ({3: 150}, 200)],
        "RD": [({1: 200, 5: 200}, 200), ({2: 200, 4: 200}, 200), ({3: 200}, 200)],
        "CD": [({1: 150, 5: 150}, 200), ({2: 200, 4: 200}, 200), ({3: 250}, 300)],
        "R": [({finger: 250}, 200) for finger in (1, 2, 3, 4, 5)],
        "L": [({finger: 250}, 200) for finger in (5, 4, 3, 2, 1)],
    },
    "distinct": {
        "EI": [
            ({1: 250, 3: 250, 5: 250}, 150),
            ({1: 250, 2: 250, 4: 250, 5: 250}, 150),
            ({1: 250, 5: 250}, 300),
        ],
        "RI": [({3: 250}, 200), ({2: 250, 4: 250}, 200), ({1: 250, 5: 250}, 200)],
        "CI": [({3: 250}, 300), ({2: 250, 3: 250, 4: 250}, 300)],
        "ED": [
            ({1: 250, 5: 250}, 300),
            ({1: 250, 2: 250, 4: 250, 5: 250}, 150),
            ({1: 250, 3: 250, 5: 250}, 150),
        ],
        "RD": [({1: 250, 5: 250}, 200), ({2: 250, 4: 250}, 200), ({3: 250}, 200)],
        "CD": [({2: 250, 3: 250, 4: 250}, 300), ({3: 250}, 300)],
        "R": [({finger: 250}, 150) for finger in (1, 2, 3, 4, 5)],
        "L": [({finger: 250}, 150) for finger in (5, 4, 3, 2, 1)],
    },
    "flight": {
        "CR": [({finger: 250}, 100) for finger in (2, 3, 4)],
        "CL": [({finger: 250}, 100) for finger in (4, 3, 2)],
        "ER": [({5: 250}, 200)],
        "EL": [({1: 250}, 200)],
    },
    "flight-2018": {
        "CR": [({finger: 250}, 400) for finger in (2, 3, 4)],
        "CL": [({finger: 250}, 400) for finger in (4, 3, 2)],
        "ER": [({5: 250}, 400)],
        "EL": [({1: 250}, 400)],
    },
}


def rows(pattern: Pattern) -> Rows:
    return [(dict(frame.hz), frame.ms) for frame in pattern.frames]


@pytest.mark.parametrize("name", TABLES)
def test_a_set_is_its_table_frame_by_frame(name: str) -> None:
    patterns = load_patterns(name).patterns
    assert {key: rows(pattern) for key, pattern in patterns.items()} == TABLES[name]


def test_the_durations_of_the_paper() -> None:
    patterns = load_patterns("paper").patterns
    assert [patterns[name].length_ms for name in STATE] == [700, 700, 600, 600, 700, 700, 1000, 1000]


def test_the_gates_of_2018() -> None:
    patterns = load_patterns("flight-2018")
    assert {name: p.gate_ms for name, p in patterns.patterns.items()} == {
        "CR": 1400,
        "CL": 1400,
        "ER": 800,
        "EL": 800,
    }
    assert (patterns.rule, patterns.silent_gate, patterns.thresholds.side_m) == ("flight-2018", True, 0.01)


def test_every_set_that_ships_loads_and_no_pattern_is_another_one() -> None:
    assert shipped_sets() == ["cues", "distinct", "flight", "flight-2018", "paper"]
    cues = load_patterns("cues").patterns
    assert len({tuple(map(str, rows(pattern))) for pattern in cues.values()}) == len(cues)
    for name in TABLES:
        others = [rows(pattern) for pattern in load_patterns(name).patterns.values()]
        assert not [cue for cue in cues.values() if rows(cue) in others]


ADVICE = """
about = "x"
meaning = "advice"
[patterns.CR]
frames = [{ ms = 100, hz = { 2 = 250 } }]
[patterns.CL]
reverse_of = "CR"
[patterns.ER]
frames = [{ ms = 200, hz = { 5 = 250 } }]
[patterns.EL]
frames = [{ ms = 200, hz = { 1 = 250 } }, { ms = 50 }]
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_of_ones_own(tmp_path: Path) -> None:
    patterns = load_patterns(write(tmp_path, ADVICE))
    assert patterns.name == "mine"
    assert patterns.rule == "paper"
    assert rows(patterns.patterns["EL"]) == [({1: 250}, 200), ({}, 50)]
    assert patterns.patterns["EL"].gate_ms == 750


@pytest.mark.parametrize(
    ("wrong", "right", "expected"),
    [
        (
            "2 = 250",
            "6 = 250",
            "finger '6' must be 1 (thumb) to 5 (little) at key patterns['CR'].frames[0]",
        ),
        ("2 = 250", "2 = 900", "finger 2: 900 Hz must be 50 to 300"),
        ("2 = 250", '2 = "250"', "a finite number is expected, not '250'"),
        ("2 = 250", "2 = nan", "a finite number is expected, not nan"),
        ("ms = 100", "ms = 5", "ms must be 20 to 2000, not 5"),
        ("ms = 100", "ms = 100.5", "a whole number is expected, not 100.5"),
        ("ms = 100", "hertz = 3", "unknown key 'hertz'"),
        ("{ ms = 100, hz = { 2 = 250 } }", "{ ms = 100 }", "at key patterns.CR: no finger vibrates in it"),
        (
            "{ ms = 100, hz = { 2 = 250 } }",
            "{ ms = 2000, hz = { 2 = 250 } }, " * 3,
            "6000 ms long; at most 5000",
        ),
        ("{ ms = 100, hz = { 2 = 250 } }", "", "a pattern has either frames or reverse_of"),
        ("[{ ms = 100, hz = { 2 = 250 } }]", '"CR"', "a list is expected"),
        (
            'reverse_of = "CR"',
            'reverse_of = "CL"',
            "reverse_of 'CL' must name a pattern of this file that has frames",
        ),
        ("[patterns.CL]", "gate_ms = 50\n[patterns.CL]", "gate_ms 50 is shorter than the pattern, 100 ms"),
        ("[patterns.CR]", "[patterns.RC]", "missing: CR; unknown: RC"),
        ('"advice"', '"feelings"', "meaning"),
        ('about = "x"', "", "missing key 'about'"),
        ('about = "x"', 'about = "x"\nrule = "2018"', "unknown rule '2018'; rules: paper, flight-2018"),
        ('about = "x"', 'about = "x"\nthresholds = { extended = 0.5 }', "extended"),
        (
            'about = "x"',
            'about = "x"\nthresholds = { trend_on = 0.01 }',
            "trend_off 0.03 must not exceed trend_on",
        ),
        ('about = "x"', "about = ", "not valid TOML"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path: Path, wrong: str, right: str, expected: str) -> None:
    assert wrong in ADVICE
    path = write(tmp_path, ADVICE.replace(wrong, right, 1))
    with pytest.raises(ConfigError) as refused:
        load_patterns(path)
    assert expected in str(refused.value)
    assert str(path) in str(refused.value)


@pytest.mark.parametrize(
    ("name", "hint"), [("papr", "did you mean 'paper'?"), ("xyz", "sets that ship: cues, distinct, flight")]
)
def test_an_unknown_set_is_refused_with_a_hint(name: str, hint: str) -> None:
    with pytest.raises(ConfigError) as refused:
        load_patterns(name)
    assert hint in str(refused.value)
