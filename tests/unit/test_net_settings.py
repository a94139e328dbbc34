"""Zenoh's configuration of any node in any profile, and the access rules in it."""

import json
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deploy.cli import main
from deploy.net.authority import create, issue
from shared.codec import MAX_PAYLOAD
from shared.config import load_scenario
from shared.errors import ConfigError, SwarmTouchError
from shared.formation import build_formation
from shared.net.access import access_control, writes
from shared.net.keyring import Keyring
from shared.net.settings import Settings, node_settings
from shared.nodes import all_nodes
from shared.radio_link import radio_group
from shared.scenario import Scenario
from shared.topics import DRONE_STATE, HAND, TOPICS

RHOMBUS = build_formation(load_scenario("rhombus"))
NODES = all_nodes(RHOMBUS)


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> Scenario:
    keyring = Keyring(tmp_path_factory.mktemp("net") / "keys")
    create(keyring, "rhombus")
    for node in NODES:
        issue(keyring, node)
    return load_scenario("rhombus", ["net.profile=field", f"net.keys={keyring.folder}"])


def granted(rules: Settings, subject: str, message: str) -> set[str]:
    """Returns the keys on which a node accepts a kind of message from another."""
    named = {rule["id"]: rule for rule in rules["rules"]}
    subjects = {each["id"] for each in rules["subjects"] if subject in each.get("cert_common_names", [subject])}
    return {
        key
        for policy in rules["policies"]
        if subjects & set(policy["subjects"])
        for rule in policy["rules"]
        if "ingress" in named[rule]["flows"] and message in named[rule]["messages"]
        for key in named[rule]["key_exprs"]
    }


@pytest.mark.parametrize("node", NODES)
def test_everybody_accepts_from_a_member_what_is_its_own_and_nothing_else(node: str) -> None:
    rules = access_control("s", node, NODES)
    assert rules["default_permission"] == "deny"
    for member in set(NODES) - {node}:
        expected = set() if node == "relay" else {f"s/{key}" for key in writes(member)}
        assert granted(rules, member, "put") == expected
    assert granted(rules, "mallory", "put") == set()
    assert granted(rules, "mallory", "declare_subscriber") == set()


def test_only_the_relay_writes_the_hand_and_each_drone_its_own_state() -> None:
    owners = {
        key: [node for node in NODES if key in writes(node)] for key in (HAND.key(), DRONE_STATE.key(id=3))
    }
    assert owners == {"human/hand": ["relay"], "drone/3/state": ["drone/3"]}


def test_every_topic_has_somebody_who_may_write_it() -> None:
    written = {key for node in NODES for key in writes(node)}
    for topic in TOPICS:
        keys = {topic.key(id=1, role="drone"), topic.key(id=0, role="relay"), topic.wildcard}
        assert written & keys, topic.pattern


def test_a_certificate_that_nobody_would_trust_is_refused_with_what_to_do(
    field: Scenario, tmp_path: Path
) -> None:
    folder = shutil.copytree(field.net.keys, tmp_path / "keys")
    for suffix in ("crt", "key"):
        shutil.copy(folder / f"drone-3.{suffix}", folder / f"drone-2.{suffix}")
    scenario = load_scenario("rhombus", ["net.profile=field", f"net.keys={folder}"])
    with pytest.raises(ConfigError, match=r"drone-2\.crt: not issued by .* net keys issue SCENARIO drone/2"):
        node_settings(scenario, RHOMBUS, "drone/2")


def test_the_field_has_certificates_rules_and_guards(field: Scenario) -> None:
    settings = node_settings(field, RHOMBUS, "drone/2")
    tls = settings["transport"]["link"]["tls"]
    assert tls["enable_mtls"]
    assert tls["verify_name_on_connect"]
    assert tls["listen_private_key"].endswith("drone-2.key")
    assert settings["transport"]["link"]["protocols"] == ["quic"]
    assert settings["access_control"]["enabled"]
    assert settings["low_pass_filter"][0]["size_limit"] > MAX_PAYLOAD


@pytest.mark.parametrize("node", NODES)
def test_a_batch_has_room_for_every_message_and_a_stalled_link_holds_little(node: str) -> None:
    tx = node_settings(load_scenario("rhombus"), RHOMBUS, node)["transport"]["link"]["tx"]
    longest = max(len(f"{'s' * 32}/{topic.key(id=99999, role='observer')}") for topic in TOPICS)
    assert MAX_PAYLOAD + longest + 256 <= tx["batch_size"]
    assert tx["batch_size"] * tx["queue"]["size"]["real_time"] <= 2**17


def test_beside_an_endpoint_of_datagrams_stands_one_of_tcp() -> None:
    scenario = load_scenario("rhombus", ["net.endpoint=udp/{node}.local:7447"])
    settings = node_settings(scenario, RHOMBUS, "drone/1")
    plain = node_settings(load_scenario("rhombus"), RHOMBUS, "drone/1")
    assert settings["listen"]["endpoints"] == ["tcp/drone-1.local:7447?rel=1", "udp/drone-1.local:7447?rel=0"]
    assert settings["connect"]["endpoints"] == ["tcp/relay.local:7447?rel=1", "udp/relay.local:7447?rel=0"]
    assert settings["transport"]["unicast"]["max_links"] == 2
    slow, usual = (each["transport"]["link"]["tx"] for each in (settings, plain))
    assert slow["lease"] > usual["lease"]
    assert slow["lease"] / slow["keep_alive"] == usual["lease"] / usual["keep_alive"]
    assert "max_links" not in plain["transport"]["unicast"]


def test_a_node_without_its_key_is_told_where_to_get_it(field: Scenario, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"net\.keys: profile field needs keys"):
        node_settings(load_scenario("rhombus", ["net.profile=field"]), RHOMBUS, "drone/2")
    absent = load_scenario("rhombus", ["net.profile=field", f"net.keys={tmp_path}"])
    with pytest.raises(
        ConfigError, match=r"drone-2\.crt: missing; issue it with swarmtouch net keys issue drone/2"
    ):
        node_settings(absent, RHOMBUS, "drone/2")
    open_wire = load_scenario(
        "rhombus", ["net.endpoints.relay=tcp/10.0.0.1:7447", f"net.keys={field.net.keys}"]
    )
    with pytest.raises(ConfigError, match=r"net\.endpoints: with net\.keys every endpoint is quic/ or tls/"):
        node_settings(open_wire, RHOMBUS, "drone/2")


@pytest.mark.parametrize("node", NODES)
def test_the_relay_takes_no_sample_in_any_profile(field: Scenario, node: str) -> None:
    for scenario in (load_scenario("rhombus"), load_scenario("rhombus", ["net.profile=compose"]), field):
        rules = node_settings(scenario, RHOMBUS, "relay")["access_control"]
        for message in ("put", "delete", "query", "reply", "liveliness_token", "declare_queryable"):
            assert granted(rules, node, message) == set()


def test_on_the_radio_the_relay_has_no_session_and_nobody_dials_it() -> None:
    radio = load_scenario("rhombus", ["net.profile=radio"])
    with pytest.raises(ConfigError, match="the relay has no Zenoh session"):
        node_settings(radio, RHOMBUS, "relay")
    mesh = node_settings(radio, RHOMBUS, "drone/2")
    assert mesh["listen"]["endpoints"] == ["tcp/127.0.0.1:7462"]
    assert mesh["connect"]["endpoints"] == ["tcp/127.0.0.1:7461"]


def test_the_command_writes_what_the_process_uses(field: Scenario, capsys: pytest.CaptureFixture[str]) -> None:
    keys = f"net.keys={field.net.keys}"
    assert main(["net", "config", "rhombus", "--profile", "field", "--node", "drone/2", "--set", keys]) == 0
    assert json.loads(capsys.readouterr().out) == node_settings(field, RHOMBUS, "drone/2")
    assert main(["net", "config", "rhombus", "--node", "drone/9"]) == 2


@given(
    profile=st.sampled_from(["laptop", "compose", "field", "radio"]) | st.text(max_size=8),
    endpoint=st.text(max_size=40),
    multicast=st.text(max_size=40),
    interface=st.text(max_size=12),
)
def test_no_input_of_a_profile_does_more_than_be_refused(
    field: Scenario, profile: str, endpoint: str, multicast: str, interface: str
) -> None:
    def quoted(text: str) -> str:
        return json.dumps(text)

    overrides = [f"net.profile={quoted(profile)}", f"net.multicast={quoted(multicast)}"]
    overrides += [f"net.interface={quoted(interface)}", f"net.endpoints.relay={quoted(endpoint)}"]
    try:
        scenario = load_scenario("rhombus", [*overrides, f"net.keys={field.net.keys}"])
        settings = node_settings(scenario, RHOMBUS, "drone/2")
        radio_group(scenario.net)
    except SwarmTouchError:
        return
    assert json.loads(json.dumps(settings)) == settings


def test_observers_and_consoles_share_a_name_and_may_be_many() -> None:
    rules = access_control("s", "drone/1", NODES)
    assert {"s/status/observer/*", "s/status/console/*"} <= granted(rules, "observer", "put")
    assert granted(rules, "observer", "liveliness_token") == {"s/alive/observer/*", "s/alive/console/*"}
    assert granted(rules, "drone/2", "liveliness_token") == {"s/alive/drone/2"}
