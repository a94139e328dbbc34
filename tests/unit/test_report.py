"""Reports: one page and files, from any record; what a flight lacks is said."""

import csv
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from deploy.cli import main
from observer.report.figures import FIGURES
from observer.report.figures.base import snapshots
from observer.report.page import page as page_of
from observer.report.record import ROW_HZ, FlightRecord, Played, hold, mapped_hand, resample
from observer.report.source import open_record
from observer.report.tables import REACTION_TIMES, areas, fleet_row, reactions
from observer.report.write import write_report
from observer.trace.write import TraceWriter
from shared.codec import encode
from shared.config import load_scenario
from shared.errors import ConfigError
from shared.formation import build_formation
from shared.messages import DroneState, HandSample, Message, Mode, PatternEvent
from shared.scenario import Clip, Hand, Obstacle
from shared.topics import DRONE_STATE, HAND, PATTERN
from shared.transport import Arrival
from tests.synthetic_swarm import MS, T0, TICK, fly

SCENARIO = load_scenario("rhombus")
FORMATION = build_formation(SCENARIO)
SECONDS = 8.0
T = np.arange(0.0, SECONDS, 1.0 / ROW_HZ)
SPEED = 0.3


def straight_flight() -> FlightRecord:
    """The rest formation behind a hand that moves forward at one speed."""
    hand = np.column_stack([-SPEED * T, np.zeros_like(T), np.full_like(T, 1.2)])
    bodies = hand[:, None] + FORMATION.rest
    return FlightRecord(
        name="straight <1>",
        source="trace",
        formation=FORMATION,
        t=T,
        recorded_t=T,
        hand=hand,
        hand_velocity=np.tile([-SPEED, 0.0, 0.0], (len(T), 1)),
        mapped=hand,
        position=bodies,
        goal=bodies,
        setpoint=bodies,
        displacement={link.name: np.zeros((len(T), 3)) for link in FORMATION.links},
        default_area=0.5,
        obstacles=(Obstacle(name="a", x=-1.0, y=1.0),),
        zones=(0.42,),
        patterns=(Played(1.0, "CR", 0.3), Played(2.0, "EI", 0.7)),
    )


STRAIGHT = straight_flight()


def test_a_straight_flight_has_the_numbers_of_a_straight_flight() -> None:
    row = fleet_row(STRAIGHT)
    assert row.path == pytest.approx(SPEED * T[-1])
    # The causal filter starts from rest.
    assert row.velocity == pytest.approx(SPEED, rel=0.03)
    assert row.area_mean == pytest.approx(0.0, abs=1e-9)
    assert np.allclose(areas(STRAIGHT), 0.5)


def test_acceleration_and_jerk_of_a_circle() -> None:
    radius, omega = 0.5, 1.0
    t = np.arange(0.0, 300.0, 1.0 / ROW_HZ)
    centre = np.column_stack([radius * np.cos(omega * t), radius * np.sin(omega * t), np.ones_like(t)])
    record = evolve(STRAIGHT, t=t, recorded_t=t, position=centre[:, None] + FORMATION.rest)
    row = fleet_row(record)
    # The causal filters start from rest, which the jerk feels longest.
    assert [row.velocity, row.acceleration, row.jerk] == pytest.approx([radius] * 3, rel=0.1)


def moved(side: float, growth: float) -> FlightRecord:
    """One second after a pattern, at 2 s, the formation has moved aside and grown."""
    late = (T > 3.0).astype(float)[:, None, None]
    position = STRAIGHT.position + late * np.array([0.0, side, 0.0])
    centre = position.mean(axis=1, keepdims=True)
    position = centre + (position - centre) * np.sqrt(1.0 + late * growth)
    return evolve(STRAIGHT, position=position)


@pytest.mark.parametrize(
    ("name", "side", "growth", "displacement", "area"),
    [
        ("CR", 0.2, 0.3, 1.0, 1.0),
        ("CL", 0.2, 0.3, 0.0, 1.0),
        ("ER", 0.2, 0.3, 1.0, 0.0),
        ("EL", -0.2, -0.3, 1.0, 1.0),
        ("CR", -0.2, 0.05, 0.0, 0.5),
    ],
)
def test_a_reaction_is_right_if_the_swarm_did_what_the_pattern_advised(
    name: str, side: float, growth: float, displacement: float, area: float
) -> None:
    record = evolve(moved(side, growth), patterns=(Played(2.0, name, 0.3), Played(2.5, "EI", 0.7)))
    curve = reactions([record])
    assert tuple(reaction.after for reaction in curve) == REACTION_TIMES
    assert curve[0].area == 0.5  # nothing had happened yet
    assert all((r.displacement, r.area) == (displacement, area) for r in curve if r.after > 1.0)


def test_without_advice_there_are_no_reactions() -> None:
    assert reactions([evolve(STRAIGHT, patterns=(Played(2.0, "EI", 0.7),))]) == ()
    assert reactions([]) == ()


def test_a_report_is_one_page_and_the_files_of_every_figure(tmp_path: Path) -> None:
    page = write_report([STRAIGHT], tmp_path / "report")
    text = page.read_text()
    assert text.count("<svg") == len(FIGURES)
    assert "straight &lt;1&gt;" in text
    for foreign in ('src="', "@import", "<script", '<link rel="stylesheet"'):
        assert foreign not in text
    for drawing in FIGURES:
        ElementTree.parse(page.parent / f"{drawing.name}.svg")  # noqa: S314  our own file
        assert (page.parent / f"{drawing.name}.png").stat().st_size > 5_000
        assert drawing.title in text
    with (page.parent / "tracking.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(T)
    assert float(rows[60]["hand_x"]) == pytest.approx(STRAIGHT.hand[60, 0])
    with (page.parent / "formation.csv").open(newline="") as file:
        arrows = list(csv.DictReader(file))
    assert {(row["from"], row["to"]) for row in arrows} == {
        *(("hand", "1"), ("1", "2"), ("1", "3"), ("2", "4"), ("3", "4"))
    }


def test_what_a_flight_lacks_is_said_instead_of_drawn(tmp_path: Path) -> None:
    page = write_report([evolve(STRAIGHT, patterns=(), displacement={}, obstacles=())], tmp_path)
    text = page.read_text()
    assert "Not drawn: no pattern was played in this flight." in text
    assert not (tmp_path / "reactions.csv").exists()
    assert text.count("<svg") == len(FIGURES) - 2


def test_several_flights_have_a_row_each_and_a_mean(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("observer.report.write.FIGURES", FIGURES[:1])
    slow = evolve(STRAIGHT, position=STRAIGHT.position * 0.5)  # of the same name, from another folder
    text = write_report([STRAIGHT, slow], tmp_path).read_text()
    assert f"<td>{SPEED * T[-1] * 0.75:.4f}</td>" in text
    with (tmp_path / "fleet.csv").open(newline="") as file:
        assert [row["flight"] for row in csv.DictReader(file)] == ["straight <1>", "straight <1> (2)"]


def test_every_axis_of_every_figure_says_what_it_shows() -> None:
    from matplotlib.figure import Figure  # noqa: PLC0415

    for drawing in FIGURES:
        figure = Figure(figsize=drawing.size)
        drawing.draw(figure, [STRAIGHT])
        assert all(axes.get_ylabel() for axes in figure.axes), drawing.name
        assert figure.axes[-1].get_xlabel(), drawing.name
        lengths = {len(column) for column in drawing.columns([STRAIGHT]).values()}
        assert len(lengths) == 1, drawing.name


def test_snapshots_are_spread_along_the_way() -> None:
    resting = np.concatenate([np.zeros(300), np.linspace(0.0, 1.0, len(T) - 300)])
    record = evolve(STRAIGHT, position=STRAIGHT.position[:1] + resting[:, None, None] * [1.0, 0.0, 0.0])
    rows = snapshots(record, 5)
    assert (rows[0], rows[-1]) == (0, len(T) - 1)
    assert resting[rows] == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0], abs=0.01)


def test_the_mapping_of_a_scenario_is_applied_without_its_limits_on_the_way() -> None:
    hand = Hand(
        mapping="relative", gain=2.0, offset=(1.0, 0.0, 0.0), height=1.4, clip=Clip(min=(-1, -1), max=(2, 2))
    )
    mapped = mapped_hand(np.array([[0.0, 0.1, 9.0], [5.0, -5.0, 9.0]]), hand)
    assert mapped.tolist() == [[1.0, 0.2, 1.4], [2.0, -1.0, 1.4]]


@given(st.lists(st.floats(-5.0, 5.0), min_size=2, max_size=20))
def test_resampling_stays_within_the_values_and_meets_them(values: list[float]) -> None:
    at, column = np.arange(float(len(values))), np.array(values)[:, None]
    assert np.allclose(resample(at, at, column), column)
    assert np.array_equal(hold(at + 0.5, at, column), column)
    between = resample(np.linspace(-1.0, len(values), 50), at, column)
    assert between.min() >= column.min()
    assert between.max() <= column.max()


def write_trace(folder: Path, messages: list[Message]) -> Path:
    writer = TraceWriter(folder, SCENARIO)
    for message in messages:
        own = HAND.key() if isinstance(message, HandSample) else PATTERN.key()
        key = DRONE_STATE.key(id=message.id) if isinstance(message, DroneState) else own
        writer.add(key, Arrival(encode(message), message.stamp_ns))
    writer.close(0)
    return folder


def test_a_trace_becomes_a_record_of_the_time_in_formation(tmp_path: Path) -> None:
    messages = fly(300)
    on_ground = 20
    first = next(m for m in messages if isinstance(m, DroneState) and (m.id, m.seq) == (4, on_ground))
    early = [
        replace(m, mode=Mode.TAKEOFF) if isinstance(m, DroneState) and m.stamp_ns < first.stamp_ns else m
        for m in messages
    ]
    begun = first.stamp_ns + 200 * MS
    felt = PatternEvent(
        epoch=1,
        seq=0,
        stamp_ns=begun + 300 * MS,
        pattern="CR",
        outcome="finished",
        state_seq=0,
        started_ns=begun,
        finished_ns=begun + 300 * MS,
    )
    record = open_record(write_trace(tmp_path / "run", [*early, felt]))
    assert record.source == "trace"
    assert record.ids == (1, 2, 3, 4)
    assert record.t[-1] == pytest.approx((299 - on_ground) * TICK / 1e9, abs=0.05)
    assert record.position.shape == (len(record.t), 4, 3)
    assert record.default_area == pytest.approx(0.5)
    (played,) = record.patterns
    assert played.name == "CR"
    assert played.t == pytest.approx(0.2, abs=0.02)
    assert played.length == pytest.approx(0.3)


NAMES = ("$\\frac{$", "a\0b", "<b>&", "_x", "模式", "x" * 200, "=1+1", "\x1b[2J")


def test_names_are_shown_as_they_are_whatever_they_are(tmp_path: Path) -> None:
    felt = [
        PatternEvent(
            epoch=1,
            seq=seq,
            stamp_ns=T0 + 60 * TICK,
            pattern=pattern,
            outcome="finished",
            state_seq=0,
            started_ns=T0 + 50 * TICK,
            finished_ns=T0 + 60 * TICK,
        )
        for seq, pattern in enumerate([*NAMES, *(f"made up {n}" for n in range(200))])
    ]
    messages = [*fly(300), *felt]
    flights = [open_record(write_trace(tmp_path / name.replace("\0", ""), messages)) for name in NAMES]
    named = [evolve(record, name=name) for record, name in zip(flights, NAMES, strict=True)]
    report = write_report(named, tmp_path / "report")
    pages = [report.read_text(encoding="utf-8"), *(page_of([record], {}, []) for record in named)]
    for text in pages:
        assert "\0" not in text
        assert "\x1b" not in text
        assert "<b>&" not in text
    ElementTree.parse(report.parent / "patterns.svg")  # noqa: S314  our own file
    for table, column, rows in (("patterns", "pattern", len(felt)), ("fleet", "flight", len(NAMES))):
        with (report.parent / f"{table}.csv").open(newline="", encoding="utf-8") as file:
            names = [row[column] for row in csv.DictReader(file)]
        assert len(names) == rows
        assert not any(name.startswith("=") for name in names)


def test_what_cannot_be_reported_is_refused_with_the_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    short = write_trace(tmp_path / "short", fly(100))
    with pytest.raises(ConfigError, match=r"flew for 1\.\d s; a report needs at least 3 s"):
        open_record(short)
    grounded = [replace(m, mode=Mode.GROUND) if isinstance(m, DroneState) else m for m in fly(20)]
    with pytest.raises(ConfigError, match="the whole formation never flew"):
        open_record(write_trace(tmp_path / "ground", grounded))
    assert main(["trace", "report", str(tmp_path / "nothing"), "-o", str(tmp_path / "out")]) == 2
    assert "no trace" in capsys.readouterr().err


def test_without_the_extra_the_command_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [name for name in sys.modules if name.startswith("observer.report")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["trace", "report", "runs/latest", "-o", str(tmp_path)]) == 2
    assert "swarmtouch[plot]" in capsys.readouterr().err


def test_the_commands_show_and_write(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = write_trace(tmp_path / "run", fly(260))
    picture, perfetto = tmp_path / "path.svg", tmp_path / "path.json"
    assert main(["trace", "path", "30", str(run), "--svg", str(picture), "--perfetto", str(perfetto)]) == 0
    assert "drone 3 -> drone 4" in capsys.readouterr().out
    assert picture.read_text().startswith("<svg")
    assert perfetto.read_text().startswith("{")
    assert main(["trace", "path", "999", str(run)]) == 2
    assert "it holds 0 to 259" in capsys.readouterr().err
    assert main(["trace", "report", str(run), "-o", str(tmp_path / "report")]) == 0
    assert (tmp_path / "report" / "report.html").is_file()
