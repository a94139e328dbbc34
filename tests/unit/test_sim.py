"""`swarmtouch sim`: it leaves what was asked for, and says what is wrong."""

import csv
import json
from pathlib import Path

import pytest

from deploy.cli import main
from shared.messages import Wish
from tests.hands import still

HAND = "scripted:sweep?stroke=0.5&peak=0.4&lead=0.2"


def test_the_command_writes_csv_plot_and_summary(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table, plot = tmp_path / "flight.csv", tmp_path / "flight.svg"
    command = ["sim", "rhombus", "--hand", HAND, "--seconds", "1", "--csv", str(table), "--plot", str(plot)]
    assert main([*command, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (summary["ok"], summary["faults"]) == (True, [])
    assert (summary["drones"], summary["followed"]) == (4, 4)
    assert summary["collisions"] == 0
    assert summary["realtime_factor"] > 0
    with table.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == round(summary["seconds"] * 60)
    assert float(rows[0]["p4_x"]) == pytest.approx(-1.5)
    assert {"hand_x", "mapped_x", "g1_y", "s2_z", "d2-4_x"} <= set(rows[0])
    assert plot.read_text(encoding="utf-8").count("drone") >= 4


def test_central_flies_many_drones(capsys: pytest.CaptureFixture[str]) -> None:
    command = [
        "sim",
        "grid",
        "--set",
        "formation.n=400",
        "--law",
        "central",
        "--hand",
        HAND,
        "--seconds",
        "0.5",
    ]
    assert main([*command, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert summary["drones"] == 400
    assert summary["min_distance_m"] > 0.3


def test_a_picture_in_an_unknown_format_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["sim", "rhombus", "--hand", HAND, "--seconds", "0.2", "--plot", str(tmp_path / "flight.xyz")]
    assert main(command) == 2
    assert "flight.xyz" in capsys.readouterr().err


def test_a_flight_of_no_length_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["sim", "rhombus", "--seconds", "-1"])
    assert end.value.code == 2
    assert "must be 0.001 to 3,600" in capsys.readouterr().err


def recording(folder: Path, rows: list[str]) -> str:
    path = folder / "hand.csv"
    path.write_text("\n".join(["t,x,y,z", *rows]) + "\n", encoding="ascii")
    return f"recording:{path}"


def test_a_hand_in_millimetres_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    hand = recording(tmp_path, [f"{k / 60},{1000 + k},{2000 - k},1200" for k in range(90)])
    assert main(["sim", "rhombus", "--hand", hand]) == 2
    assert "are they millimetres?" in capsys.readouterr().err


def test_what_was_left_out_of_a_recorded_hand_is_in_the_summary(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [f"{k / 60},0,0,1.2" for k in range(90)]
    rows[40] = rows[40].replace("1.2", "nan")
    assert main(["sim", "rhombus", "--hand", recording(tmp_path, rows), "--seconds", "1", "--json"]) == 0
    output = capsys.readouterr()
    said = "1 of 90 poses left out: 1 not a number (the first: line 42)"
    assert json.loads(output.out)["remarks"] == [said]
    assert said in output.err


def test_a_hand_that_jumps_says_why_it_was_not_followed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [f"{k / 60},{0.0 if k < 60 else 1.5},0,1.2" for k in range(120)]
    hand = f"{recording(tmp_path, rows)}?lead=0"
    main(["sim", "rhombus", "--hand", hand, "--seconds", "2", "--json"])
    summary = json.loads(capsys.readouterr().out)
    assert summary["without_hand"] > 0
    assert summary["remarks"] == ["the hand jumped once, further than a hand can: it held, and was walked to"]


@pytest.mark.parametrize("option", ["--csv", "--plot"])
def test_a_full_disk_is_named_with_the_file(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sim", "rhombus", "--seconds", "0.5", option, "/dev/full"]) == 2
    assert "/dev/full: cannot be written: No space left on device" in capsys.readouterr().err


def test_a_picture_gets_the_name_that_was_asked_for(tmp_path: Path) -> None:
    assert main(["sim", "rhombus", "--seconds", "0.5", "--plot", str(tmp_path / "flight")]) == 0
    assert (tmp_path / "flight").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("law", ["paper", "central"])
def test_a_flight_in_which_nobody_flew_is_not_ok(
    law: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("deploy.lockstep.simulate.relayed", lambda *_: still(1.0, wish=Wish.HOLD))
    command = ["sim", "rhombus", "--law", law, "--seconds", "1", "--json", "--hand", "scripted:hold"]
    assert main(command) == 1
    output = capsys.readouterr()
    summary = json.loads(output.out)
    assert (summary["ok"], summary["asked"]) == (False, False)
    assert summary["without_hand"] > 50
    assert "poses of the hand are impossible" in summary["faults"][0]
    assert summary["faults"][0] in output.err


def test_a_pointer_has_nobody_in_a_simulation(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sim", "rhombus", "--hand", "pointer://"]) == 2
    assert "swarmtouch up" in capsys.readouterr().err
