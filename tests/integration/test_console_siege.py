"""A console that is besieged: the operator comes in, flies and stops all the same."""

import contextlib
import http.client
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from observer.console.crowd import KEPT_S
from shared.messages import Mode
from tests.integration.console_page import open_page
from tests.integration.recorder import START_S
from tests.integration.swarm import launched
from tests.integration.test_console_flight import REACTION_S, port_of, take_off

pytestmark = pytest.mark.timeout(180)

NOBODY = 65_534
HALF_OPEN, IDLE_PAGES = 1_300, 40
ROOM_S = 6 * KEPT_S
"""Until whoever does not steer has left a kept place, on a busy machine."""


@contextmanager
def siege(port: int, kind: str, count: int, user: int | None = None) -> Iterator[None]:
    """Starts besiegers, and waits until all have knocked."""
    command = [sys.executable, "-m", "tests.integration.siege", str(port), kind, str(count)]
    command += [] if user is None else [str(user)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as besiegers:
        try:
            assert besiegers.stdout is not None
            assert besiegers.stdout.readline() == "there\n"
            yield
        finally:
            besiegers.kill()


def stop(port: int) -> None:
    with contextlib.closing(http.client.HTTPConnection("127.0.0.1", port, timeout=REACTION_S)) as connection:
        connection.request("POST", "/stop")
        assert connection.getresponse().status == http.HTTPStatus.NO_CONTENT


@pytest.mark.parametrize("user", [None, NOBODY], ids=["own programs", "another user"])
def test_the_operator_comes_in_flies_and_stops(user: int | None, tmp_path: Path) -> None:
    if user is not None and os.getuid() != 0:
        pytest.skip("only root can be somebody else")
    with launched("rhombus", "pointer://", tmp_path, arguments=("--console",), flying=False) as flight:
        recorder, port = flight.recorder, port_of(flight)
        recorder.until(lambda: recorder.all_in(Mode.GROUND), START_S)
        with ExitStack() as besieged:
            if user is None:
                with open_page(port) as first, open_page(port) as watching:
                    take_off(first, recorder)
                    with siege(port, "toggling-page", 1):
                        changes = watching.counts["control"]
                        watching.until(lambda: watching.counts["control"] > changes + 20, START_S)
                    besieged.enter_context(siege(port, "half-open", HALF_OPEN))
                    besieged.enter_context(siege(port, "idle-page", IDLE_PAGES))
                    assert not watching.closed, "whatever another page does"
                    assert first.newest["control"]["holder"] == first.newest["scene"]["you"]
                    recorder.until(lambda: recorder.all_in(Mode.FOLLOW), START_S)
            else:
                besieged.enter_context(siege(port, "half-open", HALF_OPEN, user))
                besieged.enter_context(siege(port, "idle-page", IDLE_PAGES, user))
            with open_page(port, ROOM_S) as page:
                take_off(page, recorder)
                x, y, _ = page.newest["snapshot"]["hand"]["point"]
                page.point(x - 0.4, y)
                goal = recorder.latest(1).goal[0] - 0.3
                recorder.until(lambda: recorder.latest(1).goal[0] < goal, START_S)
                if user is None:
                    stop(port)  # as a page does for which there is no place
                else:
                    page.say(type="wish", wish="STOP")
                recorder.until(lambda: recorder.all_in(Mode.STOP), REACTION_S)
                if user is not None:
                    assert page.newest["control"]["pages"] == 1, "no stranger has got in"
        summary = flight.end()
    assert summary["restarts"] == 0
    assert "Traceback" not in flight.logs()
