"""The swarm's own authority: what is issued, who may read it, who is a member."""

import base64
import datetime
import stat
from pathlib import Path

import pytest
from cryptography import x509

from deploy.cli import main
from deploy.net.authority import NODE_DAYS, WARN_DAYS, create, issue, issued, remove
from shared.errors import ConfigError
from shared.net.anchors import trust_anchors
from shared.net.keyring import Keyring


@pytest.fixture
def keyring(tmp_path: Path) -> Keyring:
    made = Keyring(tmp_path / "keys")
    create(made, "swarm")
    return made


def test_private_keys_are_readable_by_their_owner_only(keyring: Keyring) -> None:
    issue(keyring, "drone/2")
    modes = {file.name: stat.S_IMODE(file.stat().st_mode) for file in keyring.folder.iterdir()}
    assert {name for name, mode in modes.items() if mode == 0o600} == {"ca.key", "hand.key", "drone-2.key"}
    assert {mode for name, mode in modes.items() if not name.endswith(".key")} == {0o644}
    assert stat.S_IMODE(keyring.folder.stat().st_mode) == 0o700


def test_a_certificate_names_its_node_and_its_hosts_and_is_signed_by_the_authority(keyring: Keyring) -> None:
    issue(keyring, "drone/2", ["10.0.0.2", "drone2.local"])
    certificate, issuer = x509.load_pem_x509_certificates(keyring.certificate("drone/2").read_bytes())
    authority = x509.load_pem_x509_certificate(keyring.authority.read_bytes())
    certificate.verify_directly_issued_by(issuer)
    issuer.verify_directly_issued_by(authority)
    _, drone = issued(keyring)
    assert (drone.name, drone.is_member, drone.has_key) == ("drone/2", True, True)
    assert set(drone.hosts) == {"localhost", "127.0.0.1", "10.0.0.2", "drone2.local"}


def test_a_node_trusts_the_authority_in_the_names_of_the_members_only(keyring: Keyring) -> None:
    for node in ("drone/1", "drone/2"):
        issue(keyring, node)
    pem = base64.b64decode(trust_anchors(keyring.authority, ["drone/2", "relay"]))
    authority = x509.load_pem_x509_certificate(keyring.authority.read_bytes())
    anchors = x509.load_pem_x509_certificates(pem)
    assert all(anchor.public_key() == authority.public_key() for anchor in anchors)
    trusted = {anchor.subject for anchor in anchors}
    leaves = {
        node: x509.load_pem_x509_certificate(keyring.certificate(node).read_bytes())
        for node in ("drone/1", "drone/2")
    }
    assert {node: leaf.issuer in trusted for node, leaf in leaves.items()} == {
        "drone/1": False,
        "drone/2": True,
    }
    assert authority.subject not in trusted


def test_an_ending_certificate_is_noticed(keyring: Keyring) -> None:
    issue(keyring, "relay")
    now = datetime.datetime.now(datetime.UTC)
    _, relay = issued(keyring)
    assert relay.days_left(now) >= NODE_DAYS - 1
    assert relay.days_left(now + datetime.timedelta(days=NODE_DAYS - WARN_DAYS + 1)) < WARN_DAYS


def test_removing_a_node_strikes_it_from_the_members_and_deletes_its_key(keyring: Keyring) -> None:
    for node in ("drone/1", "drone/2"):
        issue(keyring, node)
    remove(keyring, "drone/1")
    assert keyring.members() == ("drone/2",)
    assert not keyring.key("drone/1").exists()
    with pytest.raises(ConfigError, match="drone/1 is no member"):
        remove(keyring, "drone/1")


def test_an_authority_is_never_overwritten(keyring: Keyring) -> None:
    before = keyring.authority_key.read_bytes()
    with pytest.raises(ConfigError, match="there already"):
        create(keyring, "swarm")
    assert keyring.authority_key.read_bytes() == before


def test_issuing_needs_the_authority(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="net keys init"):
        issue(Keyring(tmp_path), "drone/1")


@pytest.mark.parametrize("text", ["", "members = 3", "members = [1]", "\0"])
def test_a_broken_list_of_members_is_refused_by_file(keyring: Keyring, text: str) -> None:
    (keyring.folder / "members.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"members\.toml"):
        keyring.members()


def test_the_command_makes_issues_shows_and_removes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    where = ["--keys", str(tmp_path / "keys")]
    assert main(["net", "keys", "init", "rhombus", *where]) == 0
    assert main(["net", "keys", "issue", "rhombus", *where]) == 0
    assert main(["net", "keys", "remove", "rhombus", "drone/3", *where]) == 0
    capsys.readouterr()
    assert main(["net", "keys", "show", "rhombus", *where]) == 0
    shown = capsys.readouterr().out
    assert "drone/2" in shown
    assert "drone/3" not in shown
    assert main(["net", "keys", "init", "rhombus", *where]) == 2


def test_certificates_name_the_hosts_under_which_the_scenario_has_nodes_dialled(tmp_path: Path) -> None:
    where = ["--keys", str(tmp_path / "keys"), "--set", "net.endpoint=quic/{node}.mesh:7447?mixed_rel=1"]
    assert main(["net", "keys", "init", "rhombus", *where]) == 0
    relay = ["--set", "net.endpoints.relay=quic/relay.hand:7447"]
    assert main(["net", "keys", "issue", "rhombus", *where, *relay]) == 0
    hosts = {
        each.name: set(each.hosts) - {"localhost", "127.0.0.1"} for each in issued(Keyring(tmp_path / "keys"))
    }
    assert (hosts["drone/2"], hosts["relay"]) == ({"drone-2.mesh"}, {"relay.hand"})
