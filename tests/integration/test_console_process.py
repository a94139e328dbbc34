"""The console as a process of its own: its address, how it ends, who is let in over the wire."""

import os
import re
import ssl
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from observer.console.arguments import TOKEN_VARIABLE
from tests.integration.console_page import open_page

pytestmark = pytest.mark.parallel

DEADLINE_S = 20.0


@contextmanager
def console(*arguments: str, **environment: str) -> Iterator[tuple["subprocess.Popen[str]", str]]:
    """A console of a swarm that is not there, and the address that it prints."""
    command = [
        sys.executable,
        "-P",
        "-m",
        "observer.console",
        "--scenario",
        "slalom",
        "--port",
        "0",
        *arguments,
    ]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, **environment}
    ) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            match = re.search(r"https?://\S+", line)
            assert match, line or (process.stderr and process.stderr.read())
            yield process, match.group(0)
        finally:
            process.kill()


def status_of(url: str, context: ssl.SSLContext | None = None) -> int:
    """Opens an address as a browser would, with cookies."""
    opener = urllib.request.build_opener(
        urllib.request.HTTPCookieProcessor(), urllib.request.HTTPSHandler(context=context)
    )
    try:
        with opener.open(url, timeout=DEADLINE_S) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        error.close()
        return error.code


def port_of(url: str) -> int:
    return int(url.split(":")[2].split("/", maxsplit=1)[0])


def test_it_ends_cleanly_on_sigterm_with_a_page_open() -> None:
    with console() as (process, url):
        assert url.startswith("http://127.0.0.1:")
        with open_page(port_of(url)) as page:
            process.terminate()
            assert process.wait(DEADLINE_S) == 0
            page.until(lambda: page.closed, DEADLINE_S)
        assert process.stderr is not None
        assert "Traceback" not in process.stderr.read()


def test_a_token_opens_the_address_that_carries_it() -> None:
    with console("--token", "random") as (_, url):
        bare, _, token = url.partition("?token=")
        assert len(token) > 16
        assert (status_of(bare), status_of(f"{bare}?token=wrong"), status_of(url)) == (403, 403, 200)


def test_it_serves_https_with_a_certificate_of_its_own(tmp_path: Path) -> None:
    with console("--tls", str(tmp_path / "tls")) as (_, url):
        assert url.startswith("https://127.0.0.1:")
        context = ssl.create_default_context(cafile=str(tmp_path / "tls" / "cert.pem"))
        assert status_of(url, context) == 200


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--host", "0.0.0.0"), "whoever reaches this address could fly; give --token random"),  # noqa: S104
        (("--token", "secret-word"), "others can read command lines"),
        (("--patterns", "/nowhere.json"), "/nowhere.json: no readable pattern file"),
    ],
)
def test_what_it_refuses_it_explains(arguments: tuple[str, ...], expected: str) -> None:
    command = [
        sys.executable,
        "-P",
        "-m",
        "observer.console",
        "--scenario",
        "slalom",
        "--port",
        "0",
        *arguments,
    ]
    environment = {name: value for name, value in os.environ.items() if name != TOKEN_VARIABLE}
    done = subprocess.run(
        command, capture_output=True, text=True, env=environment, timeout=DEADLINE_S, check=False
    )
    assert done.returncode == 2
    assert expected in done.stderr.splitlines()[-1]


def test_on_every_address_it_wants_the_token_of_the_environment() -> None:
    token = "in-the-environment"  # noqa: S105  of the test
    with console("--host", "0.0.0.0", **{TOKEN_VARIABLE: token}) as (_, url):  # noqa: S104  with a token
        port = port_of(url)
        assert status_of(f"http://127.0.0.1:{port}/") == 403
        assert status_of(f"http://127.0.0.1:{port}/?token={token}") == 200
