"""`swarmtouch doctor` on keys: what ends, what others may read, what is missing."""

import datetime
from pathlib import Path

import pytest

from deploy.cli import main
from deploy.doctor.finding import Finding, Verdict
from deploy.doctor.keys import check_keys
from deploy.net.authority import AUTHORITY_DAYS, NODE_DAYS, create, issue
from shared.config import load_scenario
from shared.net.keyring import Keyring

NOW = datetime.datetime.now(datetime.UTC)


@pytest.fixture
def keyring(tmp_path: Path) -> Keyring:
    made = Keyring(tmp_path / "secrets")
    create(made, "rhombus")
    for node in ("relay", "drone/1"):
        issue(made, node)
    return made


def findings(keyring: Keyring | None, days: int = 0) -> dict[str, Finding]:
    named = [f"net.keys={keyring.folder}"] if keyring else []
    found = check_keys(load_scenario("rhombus", named), NOW + datetime.timedelta(days=days))
    return {finding.subject: finding for finding in found}


def test_fresh_keys_are_good(keyring: Keyring) -> None:
    (finding,) = findings(keyring).values()
    assert finding.verdict is Verdict.GOOD


@pytest.mark.parametrize(("left", "verdict"), [(31, None), (29, Verdict.WARNING), (-1, Verdict.BAD)])
def test_certificates_are_told_30_days_before_they_end(
    keyring: Keyring, left: int, verdict: Verdict | None
) -> None:
    found = findings(keyring, NODE_DAYS - left)
    told = {subject: finding for subject, finding in found.items() if subject.startswith("certificate")}
    assert {finding.verdict for finding in told.values()} == ({verdict} if verdict else set())
    if verdict:
        assert set(told) == {"certificate relay", "certificate drone/1"}
        assert "net keys issue SCENARIO drone/1" in told["certificate drone/1"].advice


def test_an_authority_that_ends_takes_every_certificate_along(keyring: Keyring) -> None:
    authority = findings(keyring, AUTHORITY_DAYS - 10)["certificate SwarmTouch rhombus"]
    assert authority.verdict is Verdict.WARNING
    assert "anew" in authority.advice


def test_a_certificate_that_nobody_would_trust_is_told(keyring: Keyring) -> None:
    issue(keyring, "drone/2")
    other = Keyring(keyring.folder.parent / "others")
    create(other, "line")
    issue(other, "drone/2")
    keyring.certificate("drone/2").write_bytes(other.certificate("drone/2").read_bytes())
    told = findings(keyring)["certificate drone/2"]
    assert told.verdict is Verdict.BAD
    assert "issue it anew" in told.found


def test_secrets_that_others_may_read_are_told_one_by_one(keyring: Keyring) -> None:
    keyring.hand_private.chmod(0o640)
    keyring.folder.chmod(0o755)
    found = findings(keyring)
    assert {finding.advice for finding in found.values()} == {
        f"chmod 600 {keyring.hand_private}",
        f"chmod 700 {keyring.folder}",
    }
    assert {finding.verdict for finding in found.values()} == {Verdict.WARNING}


def test_without_its_members_nothing_flies(keyring: Keyring) -> None:
    (keyring.folder / "members.toml").unlink()
    (finding,) = findings(keyring).values()
    assert finding.verdict is Verdict.BAD
    assert "members.toml" in finding.found


def test_keys_that_are_not_there_are_bad(tmp_path: Path) -> None:
    (finding,) = findings(Keyring(tmp_path / "nowhere")).values()
    assert finding.verdict is Verdict.BAD


def test_a_scenario_without_keys_is_told_of_those_in_the_default_place(
    keyring: Keyring, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(keyring.folder.parent)
    assert findings(None) == {}
    keyring.folder.rename("keys")
    assert {finding.verdict for finding in findings(None, NODE_DAYS + 1).values()} == {Verdict.WARNING}


def test_the_command_looks_at_keys(
    keyring: Keyring, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    (keyring.folder / "members.toml").unlink()
    assert main(["doctor", "--set", f"net.keys={keyring.folder}"]) == 1
    assert str(keyring.folder / "members.toml") in capsys.readouterr().out
