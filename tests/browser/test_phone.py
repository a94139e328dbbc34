"""On a phone: whoever holds the hand sees what it steers; however many fingers there are, there is one hand."""

from typing import Any

import pytest

from tests.browser.conftest import OpenPilot
from tests.browser.flight import ConsoleFlight
from tests.browser.pilot import Pilot
from tests.browser.test_layout import PICTURES
from tests.browser.test_steering import drone_moved

Point = tuple[float, float]

PHONES: dict[str, tuple[int, int]] = {
    "phone": (390, 844),
    "small phone": (320, 568),
    "phone on its side": (844, 390),
    "small phone on its side": (667, 375),
    "tablet": (768, 1024),
}
SEEN_PX = 180
STEADY_M = 0.12

# Height of the part of the view from above that is on the screen and not covered by anything, px.
SEEN = """() => {
    const surface = document.getElementById("surface");
    const { left, top, width, height } = surface.getBoundingClientRect();
    let seen = 0;
    for (let y = Math.max(0, Math.ceil(top)); y < Math.min(innerHeight, top + height); y += 1) {
        seen += document.elementFromPoint(left + width / 2, y) === surface ? 1 : 0;
    }
    return seen;
}"""
ORDERS = """() => [...document.querySelectorAll("[data-order]")].filter((button) => {
    const { left, top, right, bottom } = button.getBoundingClientRect();
    const inside = left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight;
    return !inside || !button.contains(document.elementFromPoint((left + right) / 2, (top + bottom) / 2));
}).map((button) => button.textContent)"""


def phone(open_pilot: OpenPilot, name: str = "phone", **options: Any) -> Pilot:
    width, height = PHONES[name]
    return open_pilot(viewport={"width": width, "height": height}, has_touch=True, is_mobile=True, **options)


class Fingers:
    """Fingers on the screen, each put down, moved and lifted by itself."""

    def __init__(self, pilot: Pilot) -> None:
        self._session = pilot.page.context.new_cdp_session(pilot.page)
        self._down: dict[int, Point] = {}

    def put(self, finger: int, x: float, y: float) -> None:
        self.put_all({finger: (x, y)})

    def put_all(self, fingers: dict[int, Point]) -> None:
        """Puts fingers down one right after the other, however busy the machine is."""
        self._down |= fingers
        self._send("touchStart")

    def move(self, finger: int, x: float, y: float) -> None:
        self._down[finger] = (x, y)
        self._send("touchMove")

    def lift(self, finger: int) -> None:
        """Chromium wants the fingers that are lifted listed, and lifts all if none is."""
        self._send("touchEnd", {finger: self._down.pop(finger)})

    def _send(self, kind: str, fingers: dict[int, Point] | None = None) -> None:
        listed = self._down if fingers is None else fingers
        points = [{"x": x, "y": y, "id": finger} for finger, (x, y) in listed.items()]
        self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


@pytest.mark.parametrize("name", PHONES)
def test_while_it_holds_the_hand_the_map_and_the_orders_stay_in_view(open_pilot: OpenPilot, name: str) -> None:
    pilot = phone(open_pilot, name)
    pilot.until(lambda: pilot.page.is_enabled("#take"))
    pilot.page.evaluate("document.getElementById('take').click()")
    pilot.until(lambda: pilot.text("#hand-state") == "you hold it")
    PICTURES.mkdir(parents=True, exist_ok=True)
    for share in (0.0, 0.5, 1.0):
        pilot.page.evaluate(f"scrollTo(0, {share} * (document.documentElement.scrollHeight - innerHeight))")
        pilot.page.wait_for_timeout(100)
        pilot.page.screenshot(path=PICTURES / f"{name.replace(' ', '-')}-{share:.1f}.png")
        assert pilot.page.evaluate(SEEN) >= SEEN_PX
        assert pilot.page.evaluate(ORDERS) == [] or name == "tablet", "Stop is always under the thumb"
    assert pilot.page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
    pilot.page.evaluate("document.getElementById('take').click()")


@pytest.fixture
def flying(open_pilot: OpenPilot) -> Pilot:
    pilot = phone(open_pilot)
    pilot.take_off()
    pilot.until(lambda: pilot.text("#hand-state") == "you hold it")
    return pilot


def steady(pilot: Pilot, x: float, y: float) -> bool:
    now_x, now_y, _ = pilot.hand()
    return abs(now_x - x) < STEADY_M and abs(now_y - y) < STEADY_M


def rest(pilot: Pilot) -> tuple[float, float, float]:
    """Waits until the hand rests, and the drones, which swing after a take-off; returns where the hand is."""

    def is_resting() -> bool:
        seen = pilot.told("snapshot")
        bodies = [drone["velocity"] for drone in seen["drones"]]
        return max(map(abs, seen["hand"]["velocity"])) < 0.01 and all(
            max(map(abs, velocity)) < 0.05 for velocity in bodies
        )

    pilot.page.wait_for_timeout(600)
    pilot.until(is_resting)
    x, y, z = pilot.hand()
    return x, y, z


def test_two_fingers_anywhere_lift_the_hand_where_it_is(flying: Pilot, flight: ConsoleFlight) -> None:
    x, y, z = rest(flying)
    fingers, (px, py) = Fingers(flying), flying.spot([x + 1.0, y, 0.0])
    fingers.put_all({0: (px - 60, py), 1: (px + 60, py)})
    lifted = drone_moved(flight, 2, 0.12)
    for up in range(5, 65, 5):
        fingers.move(0, px - 60, py - up)
        fingers.move(1, px + 60, py - up)
        assert steady(flying, x, y), "a first finger that is soon followed by a second one calls nobody"
    flying.until(lifted)
    fingers.lift(0)
    flying.page.wait_for_timeout(600)
    assert steady(flying, x, y), "the finger that is left holds the hand where it is"
    fingers.move(1, px + 60 + 30, py - 60)
    flying.until(lambda: flying.hand()[1] > y + STEADY_M)
    fingers.lift(1)
    assert abs(rest(flying)[0] - x) < STEADY_M
    assert flying.hand()[2] > z + 0.1


@pytest.mark.parametrize(("order", "mode"), [("HOLD", "HOLD"), ("GROUND", "GROUND")])
def test_a_second_finger_presses_a_button_while_the_first_one_steers(
    flying: Pilot, order: str, mode: str
) -> None:
    fingers = Fingers(flying)
    box = flying.page.locator(f"[data-order={order}]").bounding_box()
    assert box
    fingers.put(0, *flying.spot(flying.hand()))
    fingers.put(1, box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    flying.page.wait_for_timeout(100)
    fingers.lift(1)
    flying.until_mode(mode)
    fingers.put(1, box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    fingers.move(1, box["x"] + box["width"] / 2, box["y"] - 200)
    fingers.lift(1)
    fingers.lift(0)


CALLED = """async () => {
    const { Steering } = await import("./hand/steering.js");
    const steering = new Steering();
    steering.limit({ low: [-2, -2, 0], high: [2, 2, 2], max_speed: 1 });
    steering.lift(0.5); // a wheel takes no hand
    steering.goTo(1, -1);
    steering.lift(0.2);
    steering.lift(0.1);
    steering.begin([0, 0, 1], 0);
    const { point } = steering;
    steering.end();
    steering.begin([0, 0, 1], 0);
    return [...point, ...steering.point];
}"""
WATCHED = """async () => {
    const { Drag } = await import("./hand/drag.js");
    const [surface, called] = [document.createElement("div"), []];
    const camera = { toScreen: () => [0, 0], toWorld: () => [1, 1] };
    new Drag(surface, {
        camera: () => camera, hand: () => [0, 0, 1], wanted: () => [0, 0, 1], take: () => false,
        goTo: (...where) => called.push(where), lift: (metres) => called.push(metres),
    });
    for (const kind of ["pointerdown", "pointermove", "pointerup"]) {
        surface.dispatchEvent(new PointerEvent(kind, { pointerId: 1, button: 0 }));
    }
    return called;
}"""


def test_a_drag_counts_from_where_it_took_the_hand_and_only_then(open_pilot: OpenPilot) -> None:
    pilot = open_pilot()
    assert pilot.page.evaluate(CALLED) == pytest.approx([1.0, -1.0, 1.3, 0.0, 0.0, 1.0])
    assert pilot.page.evaluate(WATCHED) == [], (
        "who watches and drags calls nobody, not even once it is given the hand"
    )


WAKE = """
    window.awake = 0;
    const lock = () => ({ released: false, release: async () => { window.awake -= 1; } });
    Object.defineProperty(navigator, "wakeLock", {
        value: { request: async (what) => { window.awake += what === "screen"; return lock(); } },
    });
"""


def test_the_screen_stays_on_while_the_page_is_the_hand(open_pilot: OpenPilot) -> None:
    pilot = phone(open_pilot, init_script=WAKE)
    pilot.until(lambda: pilot.page.is_enabled("#take"))
    for awake in (1, 0):
        pilot.page.evaluate("document.getElementById('take').click()")
        pilot.until(lambda awake=awake: pilot.page.evaluate("window.awake") == awake)  # type: ignore[misc]


UNFELT = """async (event) => {
    const { GlovePanel } = await import("./panels/glove.js");
    const panel = new GlovePanel();
    panel.hear(event, performance.now());
    panel.show(performance.now());
    return [
        document.querySelectorAll(".finger[data-hz]").length,
        document.getElementById("pattern-name").textContent,
        document.getElementById("pattern-meaning").textContent,
    ];
}"""


@pytest.mark.parametrize(
    ("cue", "expected"), [(True, [1, "FENCE", "at the fence, not felt: no glove"]), (False, [0, "at rest", ""])]
)
def test_a_cue_that_no_glove_has_played_is_seen(
    open_pilot: OpenPilot, cue: bool, expected: list[object]
) -> None:
    pilot = open_pilot()
    pilot.told("health")
    frames = [{"ms": 5000, "hz": {"2": 250.0}}]
    event = {"name": "FENCE", "outcome": "failed", "cue": cue, "frames": frames, "elapsed": 0}
    assert pilot.page.evaluate(UNFELT, event) == expected
