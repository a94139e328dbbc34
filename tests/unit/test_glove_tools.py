"""`swarmtouch glove ...` on a simulated device: the first evening with a soldered glove."""

import builtins
import os
import pty
import re
import stat
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest
from serial.tools import list_ports_common

from deploy.cli import main
from deploy.glove import buzz, calibrate, device, flash, ports
from glove_bridge.calibration import wire_duty
from glove_bridge.calibration_file import load_calibration
from glove_bridge.protocol import PROTOCOL
from shared.clock import Clock, system_clock
from tests.simulated_glove import OFF, SimulatedGlove, simulated_glove


@pytest.fixture
def glove(tmp_path: Path) -> Iterator[SimulatedGlove]:
    with simulated_glove(tmp_path / "port") as simulated:
        yield simulated


def uri(glove: SimulatedGlove) -> str:
    return f"serial://{glove.path}"


def port(name: str, *, usb: bool) -> list_ports_common.ListPortInfo:
    info = list_ports_common.ListPortInfo(name)
    info.description = f"port {name}"
    if usb:
        info.vid, info.pid = 0x2341, 0x0043
    return info


def found(monkeypatch: pytest.MonkeyPatch, *listed: list_ports_common.ListPortInfo) -> None:
    for module in (device, ports):
        monkeypatch.setattr(module, "comports", lambda: list(listed))


def test_hello_tells_what_the_device_is(glove: SimulatedGlove, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["glove", "hello", "--glove", uri(glove)]) == 0
    rows = dict(
        line.split(maxsplit=1) for line in capsys.readouterr().out.replace("round trip", "round").splitlines()
    )
    assert rows["firmware"] == f"0.9, protocol {PROTOCOL}"
    assert rows["motors"] == "5"
    assert rows["dead-man"] == "350 ms"
    assert re.fullmatch(r"\d+\.\d ms \(worst of 10: \d+\.\d\)", rows["round"])


def test_buzz_vibrates_one_finger_as_calibrated(
    glove: SimulatedGlove, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["glove", "buzz", "4", "200", "120", "--glove", uri(glove)]) == 0
    assert re.search(r"finger 4: started after \d+\.\d ms, finished", capsys.readouterr().out)
    calibration = load_calibration()
    kick, run = (wire_duty(duty) for duty in (calibration.limit(4), calibration.duty(4, 200.0)))
    assert [duties for _, duties in glove.device.log] == [(0, 0, 0, kick, 0), (0, 0, 0, run, 0), OFF]


def test_play_plays_one_or_all_of_a_set(glove: SimulatedGlove, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("--patterns", "flight", "--glove", uri(glove))
    assert main(["glove", "play", "ER", *arguments]) == 0
    assert main(["glove", "play", "all", *arguments]) == 0
    told = [line.partition(":")[0] for line in capsys.readouterr().out.splitlines()]
    assert told == ["ER", "CR", "CL", "ER", "EL"]
    assert main(["glove", "play", "XX", *arguments]) == 2
    assert "no such pattern in set 'flight'; it has CR, CL, ER, EL; or all" in capsys.readouterr().err


def test_a_pattern_that_is_lost_is_told(glove: SimulatedGlove, capsys: pytest.CaptureFixture[str]) -> None:
    def begin_to_lose() -> Clock:
        glove.lose = 3
        return system_clock()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(buzz, "system_clock", begin_to_lose)
        assert main(["glove", "buzz", "1", "150", "50", "--glove", uri(glove)]) == 1
    assert "finger 1: never started, failed: no answer to PLAY, asked 3 times; see" in capsys.readouterr().out
    assert glove.device.plays == []


def test_patterns_play_on_a_terminal_too(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["glove", "buzz", "2", "250", "30", "--glove", "terminal://"]) == 0
    assert "··· ███ ··· ··· ···" in capsys.readouterr().out


def test_without_a_glove_the_only_usb_port_is_taken(
    glove: SimulatedGlove, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found(monkeypatch, port("/dev/ttyS0", usb=False), port(str(glove.path), usb=True))
    assert main(["glove", "buzz", "1", "150", "30"]) == 0
    found(monkeypatch, port("/dev/ttyUSB0", usb=True), port("/dev/ttyACM0", usb=True))
    assert main(["glove", "buzz", "1", "150", "30"]) == 2
    assert "several USB serial ports: /dev/ttyACM0, /dev/ttyUSB0" in capsys.readouterr().err
    assert main(["glove", "ports"]) == 0
    assert "serial:///dev/ttyACM0  port /dev/ttyACM0  USB 2341:0043" in capsys.readouterr().out
    found(monkeypatch)
    assert main(["glove", "ports"]) == 1
    assert "no serial ports" in capsys.readouterr().out
    assert main(["glove", "hello"]) == 2
    assert "no USB serial port; name the glove" in capsys.readouterr().err


def test_who_does_not_answer_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(device, "ANSWER_S", 0.3)
    assert main(["glove", "hello", "--glove", f"serial://{tmp_path}/nothing"]) == 1
    assert "nothing: cannot be used: " in (said := capsys.readouterr().err)
    assert "No such file" in said
    with simulated_glove(tmp_path / "port", PROTOCOL + 1) as other:
        assert main(["glove", "hello", "--glove", uri(other)]) == 1
    assert f"speaks protocol {PROTOCOL + 1}, not {PROTOCOL}; flash it" in capsys.readouterr().err
    assert main(["glove", "hello", "--glove", "terminal://"]) == 2
    assert "not a glove on a serial line" in capsys.readouterr().err


def test_a_port_of_something_else_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(device, "ANSWER_S", 2.0)
    master, slave = pty.openpty()
    tty.setraw(slave)
    (tmp_path / "gps").symlink_to(os.ttyname(slave))
    talking = threading.Event()

    def talk() -> None:
        while not talking.wait(0.05):
            os.write(master, b"$GPGGA,092750.000,5321.6802,N,00630.3372,W,1,8,1.03*76\r\n")

    thread = threading.Thread(target=talk)
    thread.start()
    try:
        assert main(["glove", "hello", "--glove", f"serial://{tmp_path}/gps"]) == 1
    finally:
        talking.set()
        thread.join()
        os.close(master)
        os.close(slave)
    assert "answers, but not as a glove: wrong port or baud?" in capsys.readouterr().err


@pytest.mark.parametrize(
    "wrong", [["6", "200", "100"], ["1", "900", "100"], ["1", "200", "5"], ["1", "x", "100"]]
)
def test_what_no_motor_can_do_is_refused(wrong: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as refused:
        main(["glove", "buzz", *wrong])
    assert refused.value.code == 2
    assert "error: argument" in capsys.readouterr().err


class Person:
    """Someone whose motors start at `STARTS` and run at 300 Hz times their duty; the rest is left as it is."""

    STARTS = (0.22, 0.31, 0.44, 0.27, 0.6)

    def __init__(self, glove: SimulatedGlove) -> None:
        self.glove = glove
        self.questions: list[str] = []

    def answer(self, question: str) -> str:
        self.questions.append(question)
        if "did it turn" in question:
            tried = [duties for _, duties in self.glove.device.log if duties != OFF][-1]
            finger = max(range(5), key=lambda k: tried[k])
            assert sum(map(bool, tried)) == 1
            return "y" if tried[finger] >= wire_duty(self.STARTS[finger]) else "n"
        if "frequency" in question:
            until = time.monotonic() + 5.0
            while self.glove.device.duties == OFF and time.monotonic() < until:
                time.sleep(0.001)
            return str(round(300 * max(self.glove.device.duties) / 255))
        return ""


def test_calibrating_finds_what_the_motors_need(
    glove: SimulatedGlove,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    person = Person(glove)
    monkeypatch.setattr(builtins, "input", person.answer)
    written = tmp_path / "mine.toml"
    arguments = ["--glove", uri(glove), "--turn", "0.02", "--output", str(written)]
    assert main(["glove", "calibrate", *arguments]) == 0
    assert f"calibration={written}" in capsys.readouterr().out
    assert len(person.questions) < 60
    calibration = load_calibration(written)
    for finger, start in enumerate(person.STARTS, 1):
        motor = calibration.motors[str(finger)]
        assert start - 0.01 <= motor.start_duty <= start + calibrate.RESOLUTION + 0.01
        for duty, hz in motor.duty_hz:
            assert hz == pytest.approx(300 * duty, abs=1.7)
    assert glove.device.duties == OFF
    assert main(["glove", "buzz", "1", "150", "60", "--glove", f"{uri(glove)}?calibration={written}"]) == 0
    assert wire_duty(0.5) == pytest.approx(glove.device.log[-2][1][0], abs=2)


def test_an_interrupted_calibration_writes_nothing_and_leaves_no_motor_on(
    glove: SimulatedGlove, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    person = Person(glove)

    def answer(question: str) -> str:
        if "frequency" in question:
            person.answer(question)
            raise KeyboardInterrupt
        return person.answer(question)

    monkeypatch.setattr(builtins, "input", answer)
    written = tmp_path / "mine.toml"
    arguments = ["--glove", uri(glove), "--turn", "0.02", "--output", str(written)]
    assert main(["glove", "calibrate", *arguments]) == 1
    assert not written.exists()
    assert glove.device.log[-1][1] == OFF


def test_a_motor_that_never_turns_is_named(
    glove: SimulatedGlove, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(builtins, "input", lambda question: "n" if "turn" in question else "")
    assert main(["glove", "calibrate", "--glove", uri(glove), "--turn", "0.02"]) == 2
    assert "finger 1: does not turn at its largest voltage" in capsys.readouterr().err


def fake_avrdude(folder: Path, code: int) -> Path:
    program = folder / "avrdude"
    program.write_text(f'#!/bin/sh\necho "$@" > {folder}/called\nexit {code}\n')
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    return program


def test_flash_calls_avrdude_for_an_uno(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    image = tmp_path / "glove.hex"
    image.write_text(":00000001FF\n")
    arguments = ["glove", "flash", "--port", "/dev/ttyACM0", "--hex", str(image)]
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(arguments) == 2
    assert "avrdude is missing" in capsys.readouterr().err
    fake_avrdude(tmp_path, 0)
    assert main(arguments) == 0
    called = (tmp_path / "called").read_text().split()
    assert called[:6] == ["-p", "atmega328p", "-c", "arduino", "-b", "115200"]
    assert called[-4:] == ["-P", "/dev/ttyACM0", "-U", f"flash:w:{image}:i"]
    fake_avrdude(tmp_path, 3)
    assert main(arguments) == 1
    assert "avrdude ended with 3" in capsys.readouterr().err


def test_flash_takes_the_firmware_that_ships(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    fake_avrdude(tmp_path, 0)
    assert main(["glove", "flash", "--port", "/dev/ttyACM0"]) == 0
    assert (tmp_path / "called").read_text().endswith(f"flash:w:{flash.IMAGE}:i\n")
    assert flash.IMAGE.read_text().endswith(":00000001FF\n")


def test_flash_without_firmware_says_how_to_build_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["glove", "flash", "--port", "/dev/ttyACM0", "--hex", str(tmp_path / "none.hex")]) == 2
    assert f"make -C {flash.FIRMWARE}" in capsys.readouterr().err
    assert (flash.FIRMWARE / "glove" / "glove.ino").is_file()
