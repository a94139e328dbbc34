"""Who is let in to the console: hosts, sites, tokens, certificates."""

import datetime
import ssl
import stat
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from cryptography import x509
from starlette.exceptions import StarletteDeprecationWarning
from starlette.websockets import WebSocketDisconnect

from observer.console.access import is_loopback, is_own_host, is_same_site, is_token
from observer.console.app import make_app
from observer.console.arguments import RANDOM_TOKEN, TOKEN_VARIABLE
from observer.console.console import Console
from observer.console.crowd import KEPT, PAGES_OF_ONE, Guest
from observer.console.scene import HandMap
from observer.console.serve import find_token
from observer.console.swarm_view import SwarmView
from observer.console.tls import certificate
from shared.clock import system_clock
from shared.config import load_scenario
from shared.errors import ConfigError
from shared.formation import build_formation

with warnings.catch_warnings():
    warnings.simplefilter("ignore", StarletteDeprecationWarning)  # it would rather have httpx2
    from starlette.testclient import TestClient

TOKEN = "correct horse battery"  # noqa: S105  of the test
HERE = "http://127.0.0.1:8460"
WS = "ws://127.0.0.1:8460/ws"


def console(unheard: str = "") -> Console:
    scenario = load_scenario("slalom")
    formation = build_formation(scenario)
    hand = HandMap(scenario, formation)
    view = SwarmView(formation, hand, {}, frozenset(), 0)
    return Console(
        scenario, formation, view=view, hand=hand, point=lambda _: unheard, sender=1, clock=system_clock()
    )


@pytest.fixture(params=[None, TOKEN], ids=["open", "token"])
def token(request: pytest.FixtureRequest) -> str | None:
    value: str | None = request.param
    return value


@pytest.fixture
def guarded() -> Iterator[TestClient]:
    with TestClient(make_app(console(), TOKEN), base_url=HERE) as client:
        yield client


@pytest.mark.parametrize(
    ("host", "own"),
    [
        ("127.0.0.1:8460", True),
        ("localhost", True),
        ("LOCALHOST:8460", True),
        ("[::1]:8460", True),
        ("192.168.1.7:8460", True),
        ("lab-laptop:8460", True),
        ("lab-laptop.local", True),
        ("evil.example", False),
        ("127.0.0.1.evil.example", False),
        ("localhost.evil.example:8460", False),
        ("user@127.0.0.1", True),
        ("[::1", False),
        ("", False),
    ],
)
def test_a_host_is_an_address_or_a_name_of_this_machine(host: str, own: bool) -> None:
    assert is_own_host(host, {"lab-laptop"}) is own


@pytest.mark.parametrize(
    ("origin", "same"),
    [
        (None, True),
        ("http://127.0.0.1:8460", True),
        ("https://127.0.0.1:8460", True),
        ("http://127.0.0.1:8461", False),
        ("http://localhost:8460", False),
        ("null", False),
        ("file://127.0.0.1:8460", False),
        ("http://evil.example", False),
    ],
)
def test_an_origin_is_this_very_site(origin: str | None, same: bool) -> None:
    assert is_same_site(origin, "127.0.0.1:8460") is same


def test_tokens_and_loopback() -> None:
    assert is_token(TOKEN, TOKEN)
    assert not any(is_token(wrong, TOKEN) for wrong in (None, "", TOKEN[:-1], f"{TOKEN} ", "ü"))
    assert all(map(is_loopback, ("127.0.0.1", "::1", "localhost", "127.9.9.9")))
    assert not any(map(is_loopback, ("0.0.0.0", "::", "192.168.1.7", "lab-laptop")))  # noqa: S104  not bound


def test_foreign_names_and_sites_are_refused_whatever_they_know(token: str | None) -> None:
    with TestClient(make_app(console(), token), base_url=HERE) as client:
        assert client.get(f"/?token={TOKEN}", headers={"host": "evil.example"}).status_code == 403
        with (
            pytest.raises(WebSocketDisconnect),
            client.websocket_connect(WS, headers={"origin": "http://evil.example"}),
        ):
            pass


def test_stop_is_obeyed_from_this_very_site_and_from_whoever_is_let_in() -> None:
    with TestClient(make_app(console(), TOKEN), base_url=HERE) as client:
        assert client.post("/stop").status_code == 403
        client.get(f"/?token={TOKEN}")
        assert client.post("/stop", headers={"origin": "http://evil.example"}).status_code == 403
        assert client.get("/stop").status_code == 404
        assert client.post("/stop", headers={"origin": HERE}).status_code == 204


def test_a_stop_that_nobody_hears_is_no_success() -> None:
    with TestClient(make_app(console("nobody listens"), None), base_url=HERE) as client:
        answer = client.post("/stop")
        assert (answer.status_code, answer.text) == (503, "nobody listens")


def test_without_a_token_this_machine_is_let_in() -> None:
    with TestClient(make_app(console(), None), base_url=HERE) as client:
        answer = client.get("/")
        assert answer.status_code == 200
        assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
        with client.websocket_connect(WS) as page:
            assert page.receive_json()["type"] == "scene"


@pytest.mark.parametrize("path", ["/", "/?token=wrong", "/index.html", f"/index.html?token={TOKEN}"])
def test_a_page_without_the_token_is_refused(path: str, guarded: TestClient) -> None:
    answer = guarded.get(path)
    assert answer.status_code == 403
    assert "wants its token" in answer.text
    assert "set-cookie" not in answer.headers


def test_the_printed_address_lets_in_once_and_for_all(guarded: TestClient) -> None:
    with pytest.raises(WebSocketDisconnect), guarded.websocket_connect(f"{WS}?token={TOKEN}"):
        pass
    answer = guarded.get(f"/?token={TOKEN}", follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert guarded.get("/").status_code == 200
    with guarded.websocket_connect(WS, headers={"origin": HERE}) as page:
        assert page.receive_json()["type"] == "scene"


def closing_reason(client: TestClient) -> str:
    """Opens a page that is closed again, and returns why."""
    with client.websocket_connect(WS) as page:
        while (message := page.receive())["type"] != "websocket.close":
            pass
    return str(message["reason"])


def test_when_all_places_are_taken_only_who_steers_finds_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("observer.console.app.KEPT_S", 1.5)
    monkeypatch.setattr("observer.console.app.LOOK_S", 0.05)
    served = console()
    with TestClient(make_app(served, None), base_url=HERE) as client, ExitStack() as pages:
        watching = [pages.enter_context(client.websocket_connect(WS)) for _ in range(PAGES_OF_ONE)]
        assert "only one that steers" in closing_reason(client)
        steering = pages.enter_context(client.websocket_connect(WS))
        steering.send_json({"type": "take"})
        other = pages.enter_context(client.websocket_connect(WS))
        other.send_json({"type": "take"})
        assert "only one that steers" in closing_reason(client), "both kept places are taken"
        assert client.post("/stop").status_code == 204, "STOP needs no place"
        until(lambda: served.pages == PAGES_OF_ONE + KEPT)
        time.sleep(2.0)
        assert served.pages == PAGES_OF_ONE + KEPT, "one holds the hand, the other asks for it"
        other.send_json({"type": "release"})
        until(lambda: served.pages == PAGES_OF_ONE + 1)
        watching[0].close()
        until(lambda: served.pages == PAGES_OF_ONE)
        with client.websocket_connect(WS) as page:
            assert page.receive_json()["type"] == "scene"


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_another_user_of_this_machine_is_told_how_to_come_in() -> None:
    stranger = Guest("user 1001", 0.0, is_stranger=True)
    with TestClient(make_app(console(), None, lambda _: stranger), base_url=HERE) as client:
        answer = client.get("/")
        assert answer.status_code == 403
        assert "another" not in answer.text
        assert "--token random" in answer.text
        with pytest.raises(WebSocketDisconnect), client.websocket_connect(WS):
            pass


def test_a_page_speaks_and_closing_it_is_noticed() -> None:
    served = console()
    with TestClient(make_app(served, None), base_url=HERE) as client:
        with client.websocket_connect(WS) as page:
            page.send_bytes(b"\xff")
            page.send_json({"type": "take"})
            told: dict[str, Any] = {}
            while told.get("control", {}).get("holder") != 1 or "refused" not in told:
                message = page.receive_json()
                told[message["type"]] = message
        assert served.pages == 0


def test_tokens_come_from_files_or_the_environment_never_from_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(TOKEN_VARIABLE, raising=False)
    assert find_token(None) is None
    one, other = find_token(RANDOM_TOKEN), find_token(RANDOM_TOKEN)
    assert one is not None
    assert len(one) >= 16
    assert one != other
    file = tmp_path / "token"
    file.write_text(f"{TOKEN}\n")
    assert find_token(f"@{file}") == TOKEN
    monkeypatch.setenv(TOKEN_VARIABLE, TOKEN)
    assert find_token(None) == TOKEN
    for wrong in (TOKEN, f"@{tmp_path}/nothing"):
        with pytest.raises(ConfigError, match="--token"):
            find_token(wrong)
    for short in ("", "1234567", "pass\nword", "pässword"):
        monkeypatch.setenv(TOKEN_VARIABLE, short)
        with pytest.raises(ConfigError, match="at least 8"):
            find_token(None)


def test_a_certificate_is_made_once_for_this_machine(tmp_path: Path) -> None:
    folder = tmp_path / "tls"
    pair = certificate(folder, "127.0.0.1")
    made = x509.load_pem_x509_certificate(pair[0].read_bytes())
    names = made.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert "localhost" in names.get_values_for_type(x509.DNSName)
    assert "127.0.0.1" in map(str, names.get_values_for_type(x509.IPAddress))
    assert made.not_valid_after_utc - made.not_valid_before_utc < datetime.timedelta(days=398)
    assert stat.S_IMODE(pair[1].stat().st_mode) == 0o600
    ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(*pair)
    before = pair[0].read_bytes()
    assert certificate(folder, "127.0.0.1") == pair
    assert pair[0].read_bytes() == before


def test_half_a_certificate_and_a_folder_that_is_a_file_are_refused(tmp_path: Path) -> None:
    (tmp_path / "cert.pem").write_text("")
    with pytest.raises(ConfigError, match=r"expected both cert.pem and key.pem"):
        certificate(tmp_path, "127.0.0.1")
    with pytest.raises(ConfigError, match="cannot be written"):
        certificate(tmp_path / "cert.pem" / "x", "127.0.0.1")
