"""Every way to move the hand on the page moves the drones."""

from collections.abc import Callable

import pytest

from tests.browser.conftest import OpenPilot
from tests.browser.flight import ConsoleFlight
from tests.browser.pilot import Pilot

STEP_M = 0.6

GAMEPAD = """
    window.pad = {
        id: "test pad", index: 0, connected: true, mapping: "standard", axes: [0, 0, 0, 0],
        buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })),
        played: [],
        vibrationActuator: {
            playEffect: async (kind, how) => { window.pad.played.push({ kind, ...how }); return "complete"; },
        },
    };
    navigator.getGamepads = () => [null, window.pad];
"""


def drone_moved(flight: ConsoleFlight, axis: int, metres: float) -> Callable[[], bool]:
    """Says whether drone 1 has moved by so much, from now on, as it says itself."""
    flight.recorder.drain()
    start = flight.recorder.latest(1).position[axis]

    def moved() -> bool:
        flight.recorder.drain()
        return (flight.recorder.latest(1).position[axis] - start) / metres >= 1.0

    return moved


@pytest.fixture
def pilot(open_pilot: OpenPilot) -> Pilot:
    pilot = open_pilot(init_script=GAMEPAD)
    pilot.take_off()
    return pilot


def test_four_drones_move_and_a_drag_makes_drone_1_follow(pilot: Pilot, flight: ConsoleFlight) -> None:
    before = {drone["id"]: drone["position"] for drone in pilot.told("snapshot")["drones"]}
    arrived = drone_moved(flight, 1, 0.8 * STEP_M)
    x, y, _ = pilot.hand()
    pilot.drag_hand(x, y + STEP_M)
    pilot.until(arrived)
    assert len(before) == 4
    pilot.until(
        lambda: all(
            drone["position"][1] - before[drone["id"]][1] > 0.5 * STEP_M
            for drone in pilot.told("snapshot")["drones"]
        )
    )
    assert pilot.hand()[1] == pytest.approx(y + STEP_M, abs=0.05)


@pytest.mark.parametrize(
    ("key", "axis", "metres"),
    [("ArrowLeft", 1, -0.3), ("ArrowUp", 0, -0.3), ("ArrowDown", 0, 0.3), ("PageUp", 2, 0.2)],
)
def test_keys_move_the_hand(pilot: Pilot, flight: ConsoleFlight, key: str, axis: int, metres: float) -> None:
    moved = drone_moved(flight, axis, metres)
    pilot.page.keyboard.down(key)
    pilot.until(moved)
    pilot.page.keyboard.up(key)


def test_the_wheel_lifts_the_hand(pilot: Pilot, flight: ConsoleFlight) -> None:
    lowered = drone_moved(flight, 2, -0.15)
    pilot.page.mouse.move(*pilot.spot(pilot.hand()))
    for _ in range(5):
        pilot.page.mouse.wheel(0, 100)
    pilot.until(lowered)


def test_a_gamepad_moves_the_hand_and_its_buttons_are_orders(pilot: Pilot, flight: ConsoleFlight) -> None:
    moved = drone_moved(flight, 1, 0.3)
    pilot.page.evaluate("pad.axes = [0.9, 0, 0, 0]")
    pilot.until(moved)
    pilot.page.evaluate("pad.axes = [0.05, -0.05, 0, 0]; pad.buttons[2] = { pressed: true, value: 1 }")
    pilot.until_mode("HOLD")
    pilot.until(lambda: "test pad" in pilot.text("#gamepad"))


def test_tilting_the_device_moves_the_hand(pilot: Pilot, flight: ConsoleFlight) -> None:
    session = pilot.page.context.new_cdp_session(pilot.page)

    def tilt(beta: float, gamma: float) -> None:
        turn = {"alpha": 0, "beta": beta, "gamma": gamma}
        session.send("DeviceOrientation.setDeviceOrientationOverride", turn)

    tilt(40, 0)  # as one holds a phone: that is level from now on
    pilot.press("Tilt")
    moved = drone_moved(flight, 1, -0.3)
    pilot.page.wait_for_timeout(100)
    tilt(40, -20)
    pilot.until(moved)
    pilot.press("Tilt")
    pilot.page.wait_for_timeout(100)
    still = pilot.page.evaluate("document.getElementById('tilt').getAttribute('aria-pressed')")
    assert still == "false"


def test_two_fingers_lift_and_one_drags(open_pilot: OpenPilot, flight: ConsoleFlight) -> None:
    pilot = open_pilot(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    pilot.take_off()
    session = pilot.page.context.new_cdp_session(pilot.page)

    def touch(kind: str, *points: tuple[float, float]) -> None:
        spots = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": spots})

    start = pilot.spot(pilot.hand())
    x, y, _ = pilot.hand()
    aim = pilot.spot([x + STEP_M, y, 0.0])
    moved = drone_moved(flight, 0, 0.5 * STEP_M)
    touch("touchStart", start)
    touch("touchMove", aim)
    touch("touchEnd")
    pilot.until(moved)

    lifted = drone_moved(flight, 2, 0.15)
    left, right = (aim[0] - 40, aim[1]), (aim[0] + 40, aim[1])
    touch("touchStart", left, right)
    for up in range(10, 70, 10):
        touch("touchMove", (left[0], left[1] - up), (right[0], right[1] - up))
    touch("touchEnd")
    pilot.until(lifted)
