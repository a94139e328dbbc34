"""`swarmtouch status`: the verdicts, and what it says of a swarm that is not there."""

import json
import re
from io import StringIO

import msgspec
import pytest
from msgspec.structs import replace
from rich.console import Console

from deploy.cli import main
from deploy.status.report import Heard, expected_processes, judge, rows_of
from deploy.status.show import audit_table, status_json, status_table
from glove_bridge.bridge import GLOVE_THERE
from shared.messages import NO_FLAGS, DroneState, Flag, Mode, ProcessStatus
from shared.net.audit import Audit


def status(state: str = "running") -> ProcessStatus:
    return ProcessStatus(
        epoch=1, seq=1, stamp_ns=1, role="drone", id=1, pid=1, host="h", state=state, rate_hz=60.0
    )


def drone(flags: Flag = NO_FLAGS) -> DroneState:
    return DroneState(
        epoch=1,
        seq=1,
        stamp_ns=1,
        id=1,
        position=(0.0, 0.0, 1.2),
        velocity=(0.0, 0.0, 0.0),
        goal=(0.0, 0.0, 1.2),
        goal_velocity=(0.0, 0.0, 0.0),
        setpoint=(0.0, 0.0, 1.2),
        mode=Mode.FOLLOW,
        flags=flags,
    )


def test_a_simulated_swarm_needs_a_world() -> None:
    assert expected_processes((1, 2), simulated=True) == ("relay/0", "world/0", "drone/1", "drone/2")
    assert expected_processes((1,), simulated=False) == ("relay/0", "drone/1")


@pytest.mark.parametrize(
    ("heard", "problems"),
    [
        (Heard(present=True, status=status(), state=drone()), ()),
        (Heard(), ("absent", "says nothing", "sends no state")),
        (Heard(present=True, status=status("degraded"), state=drone()), ("degraded",)),
        (Heard(present=True, status=status("ending"), state=drone()), ("ending",)),
        (
            Heard(present=True, status=status(), state=drone(Flag.BLOCKED | Flag.HAND_STALE | Flag.AVOIDING)),
            ("blocked", "hand stale"),
        ),
    ],
)
def test_a_drone_is_judged_by_presence_health_and_flags(heard: Heard, problems: tuple[str, ...]) -> None:
    row = judge("drone/1", heard)
    assert row.problems == problems
    assert row.well is not bool(problems)


def test_what_others_say_of_themselves_leaves_the_table_its_columns() -> None:
    said = "\x1b[31m[/x]" * 20
    row = judge("drone/1", Heard(present=True, status=replace(status(said), form=said), state=drone()))
    out = StringIO()
    Console(file=out, width=100, markup=False).print(status_table([row], "swarm x"))
    told = out.getvalue()
    assert "\x1b" not in told
    assert re.search(r"drone/1 +FOLLOW +1.20 m +60 Hz", told)
    assert len([line for line in told.splitlines() if line.strip()]) <= 6


def test_a_bridge_without_a_glove_says_so() -> None:
    for there, problems in ((1.0, ()), (0.0, ("no glove that can be felt",))):
        health = msgspec.structs.replace(status(), role="bridge", id=0, metrics={GLOVE_THERE: there})
        assert judge("bridge/0", Heard(present=True, status=health)).problems == problems


def test_everybody_expected_and_everybody_heard_gets_a_row() -> None:
    well = Heard(present=True, status=status())
    rows = rows_of(("relay/0", "drone/1"), {"bridge/0": well, "relay/0": well})
    assert [(row.token, row.well) for row in rows] == [
        ("relay/0", True),
        ("drone/1", False),
        ("bridge/0", True),
    ]
    assert [row.token for row in rows_of(("relay/0",), {}, only=("bridge/0",))] == ["bridge/0"]


def test_the_table_and_the_json_say_the_same() -> None:
    rows = [judge("drone/1", Heard(present=True, status=status(), state=drone())), judge("relay/0", Heard())]
    assert status_table(rows, "swarm").row_count == 2
    assert [(line["process"], line["well"], line["problems"]) for line in status_json(rows)] == [
        ("drone/1", True, []),
        ("relay/0", False, ["absent", "says nothing"]),
    ]


def test_who_does_not_believe_what_it_hears_is_not_well_and_says_how_often() -> None:
    seen = replace(status(), rejected={"jump": 3, "[/x]\x1b[31m": 1})
    (row,) = rows_of(
        ("drone/1",), {"drone/1": Heard(present=True, status=seen, state=drone(Flag.REJECTED_INPUT))}
    )
    assert row.problems == ("rejected input",)
    assert status_json([row])[0]["rejected"] == {"jump": 3, r"[/x]\x1b[31m": 1}


def test_who_is_linked_and_who_was_refused_is_shown_by_name_and_is_no_illness() -> None:
    audit = Audit(["relay", "drone/2"])
    audit.linked("3551f63a5eee", "relay", present=True)
    audit.linked("7777", "mallory", present=True)
    seen = replace(status(), metrics={"late": 1.0, **audit.metrics()})
    rows = [judge("drone/1", Heard(present=True, status=seen, state=drone())), judge("relay/0", Heard())]
    assert rows[0].well
    assert [(line["links"], line["refused"]) for line in status_json(rows)] == [
        ({"relay": 1, "mallory": 1}, {"mallory": 1}),
        ({}, {}),
    ]
    table = audit_table(rows)
    assert table is not None
    shown = StringIO()
    Console(width=120, file=shown).print(table)
    assert {"mallory, relay", "mallory: 1 times"} <= set(re.split(r"\s{2,}|\n", shown.getvalue()))


def test_a_swarm_without_keys_has_no_table_of_links() -> None:
    assert audit_table([judge("drone/1", Heard(present=True, status=status(), state=drone()))]) is None


def test_a_swarm_that_is_not_there_is_not_well(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deploy.status.listen.LONGEST_S", 0.2)
    assert main(["status", "rhombus", "--json", "--set", "net.base_port=52000"]) == 1
    rows = json.loads(capsys.readouterr().out)
    assert {row["process"] for row in rows} == {"relay/0", "world/0", *(f"drone/{i}" for i in range(1, 5))}
    assert not any(row["well"] for row in rows)


def test_no_flight_at_all_is_refused(
    tmp_path: object, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(str(tmp_path))
    assert main(["status"]) == 2
    assert "no flight yet" in capsys.readouterr().err
