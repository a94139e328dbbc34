"""`swarmtouch doctor`: it looks for real, and every fault says what to do."""

import importlib.metadata
import os
import socket
from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace

import pytest
from serial.tools import list_ports

from deploy.cli import main
from deploy.compile.toolchain import COST
from deploy.doctor import hardware, network, software
from deploy.doctor.finding import Finding, Verdict
from shared.compiled import PURE, Form
from shared.config import load_scenario


def verdicts(findings: Iterable[Finding]) -> list[Verdict]:
    kept = list(findings)
    assert all(bool(finding.advice) == (finding.verdict is not Verdict.GOOD) for finding in kept)
    return [finding.verdict for finding in kept]


def test_this_python_and_its_packages_are_good() -> None:
    findings = [finding for finding in software.all_software() if finding.subject != "control law"]
    assert set(verdicts(findings)) == {Verdict.GOOD}


def test_a_compiled_law_is_good() -> None:
    law = Form("3f2a91c0d1e2f3a4", "mypyc 2.4.1 -O3")
    finding = software.check_law(law)
    assert (finding.verdict, finding.advice) == (Verdict.GOOD, "")
    assert finding.found == "compiled 3f2a91c0 by mypyc 2.4.1 -O3"


@pytest.mark.parametrize("law", [Form(reason="not compiled for cpython"), Form(reason="damaged", refused=True)])
def test_a_pure_law_says_why_what_it_costs_and_what_is_missing(
    law: Form, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    finding = software.check_law(law)
    assert finding.verdict is Verdict.WARNING
    assert law.reason in finding.found
    assert COST in finding.found
    assert "no-such-compiler" in finding.advice
    assert "make compile" in finding.advice


def test_a_law_that_was_asked_to_be_pure_needs_no_compiler() -> None:
    assert software.check_law(Form(reason=f"{PURE} is set")).advice == f"unset {PURE}"


def test_an_old_python_is_bad() -> None:
    assert software.check_python((3, 10, 2)).verdict is Verdict.BAD


def test_missing_packages_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    requirements = ["numpy>=2.0", "nosuchpackage>=1", "othermissing>=2; extra == 'plot'"]
    monkeypatch.setattr(importlib.metadata, "requires", lambda _: requirements)
    findings = {finding.subject: finding for finding in software.check_packages()}
    assert findings["packages"].verdict is Verdict.BAD
    assert findings["packages"].found == "missing: nosuchpackage"
    assert findings["extra plot"].verdict is Verdict.WARNING
    assert "swarmtouch[plot]" in findings["extra plot"].advice
    assert findings["extra secure"].verdict is Verdict.GOOD


def test_a_taken_port_is_found() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        finding = network.check_ports(load_scenario("rhombus", [f"net.base_port={port}"]))
    assert finding.verdict is Verdict.WARNING
    assert str(port) in finding.found


def test_a_real_link_is_measured() -> None:
    finding = network.check_link()
    assert finding.verdict in (Verdict.GOOD, Verdict.WARNING)
    assert "ms one way" in finding.found


def test_a_link_that_cannot_be_is_bad(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(network, "LINK_S", 0.0)
    finding = network.check_link()
    assert finding.verdict is Verdict.BAD
    assert "firewall" in finding.advice


def test_multicast_comes_through_or_says_what_needs_it() -> None:
    assert len(verdicts([network.check_multicast(load_scenario("rhombus"))])) == 1
    absent = network.check_multicast(load_scenario("rhombus", ["net.interface=absent0"]))
    assert absent.verdict is Verdict.WARNING
    assert "set net.interface" in absent.found


def test_serial_devices_and_their_permissions(monkeypatch: pytest.MonkeyPatch) -> None:
    def ports() -> list[SimpleNamespace]:
        return [SimpleNamespace(device=name, hwid="USB") for name in ("/dev/null", "/dev/nowhere")]

    monkeypatch.setattr(list_ports, "comports", ports)
    findings = {finding.subject: finding for finding in hardware.check_serial()}
    assert findings["serial /dev/null"].verdict is Verdict.GOOD
    assert "usermod -aG dialout" in findings["serial /dev/nowhere"].advice
    monkeypatch.setattr(list_ports, "comports", list)
    assert verdicts(hardware.check_serial()) == [Verdict.GOOD]


def test_the_clock_is_measured() -> None:
    assert len(verdicts([hardware.check_clock()])) == 1


@pytest.mark.parametrize(
    ("drones", "load", "verdict"), [(4, 0.0, Verdict.GOOD), (4, 1.9, Verdict.WARNING), (64, 0.0, Verdict.BAD)]
)
def test_the_processor_must_be_large_and_free_enough(
    drones: int, load: float, verdict: Verdict, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    monkeypatch.setattr(os, "getloadavg", lambda: (load, 0.0, 0.0))
    monkeypatch.setattr(hardware, "_GOVERNOR", Path("/nowhere"))
    assert verdicts(hardware.check_processor(drones)) == [verdict]


def test_the_command_prints_every_finding_and_its_code_follows_the_worst(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hardware, "CORES_PER_AGENT", 0.0)
    assert main(["doctor"]) == 0
    shown = capsys.readouterr().out
    assert all(word in shown for word in ("Python", "link", "multicast", "clock", "processor"))
    monkeypatch.setattr(hardware, "CORES_PER_AGENT", 100.0)
    assert main(["doctor", "grid"]) == 1
    assert "fly fewer drones" in " ".join(capsys.readouterr().out.split())
