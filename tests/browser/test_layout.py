"""The page fits desktop and phone, can be used by keyboard, and can be read (WCAG 2.1 AA)."""

from pathlib import Path
from typing import Any

import pytest

from tests.browser.conftest import OpenPilot

PICTURES = Path("runs/browser")
VIEWPORTS: dict[str, dict[str, Any]] = {
    "desktop": {"viewport": {"width": 1440, "height": 900}},
    "tablet": {"viewport": {"width": 1024, "height": 768}},
    "phone": {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True},
}

# Contrast of every visible text with what lies behind it, after WCAG 2.1: [{text, contrast}, ...], worst first.
CONTRASTS = """() => {
    const pen = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
    const rgba = (colour) => {
        pen.clearRect(0, 0, 1, 1);
        pen.fillStyle = colour;
        pen.fillRect(0, 0, 1, 1);
        return [...pen.getImageData(0, 0, 1, 1).data];
    };
    const luminance = ([r, g, b]) => [r, g, b].map((part) => part / 255)
        .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
        .reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
    const behind = (element) => {
        for (let one = element; one; one = one.parentElement) {
            const colour = rgba(getComputedStyle(one).backgroundColor);
            if (colour[3] === 255) return colour;
        }
    };
    const texts = [...document.querySelectorAll("body *")].filter((element) =>
        [...element.childNodes].some((node) => node.nodeType === 3 && node.data.trim()) &&
        element.checkVisibility({ visibilityProperty: true }) && !element.closest("noscript, script, .unseen"));
    return texts.map((element) => {
        const style = getComputedStyle(element);
        const ink = luminance(rgba(element instanceof SVGElement ? style.fill : style.color));
        const paper = luminance(behind(element));
        const contrast = (Math.max(ink, paper) + 0.05) / (Math.min(ink, paper) + 0.05);
        return { text: element.textContent.trim(), contrast };
    }).sort((a, b) => a.contrast - b.contrast);
}"""
LEAST_CONTRAST = 4.5

TOO_SMALL = """() => [...document.querySelectorAll("button")].filter((button) => {
    const { width, height } = button.getBoundingClientRect();
    return width > 0 && (width < 40 || height < 40);
}).map((button) => button.textContent)"""


COUNT_LINES = """
    const pen = CanvasRenderingContext2D.prototype;
    const draw = pen.lineTo;
    window.lines = 0;
    pen.lineTo = function (x, y) { window.lines += 1; draw.call(this, x, y); };
"""
LINES_PER_FRAME = """() => new Promise((done) => requestAnimationFrame(() => {
    window.lines = 0;
    requestAnimationFrame(() => done(window.lines));
}))"""


@pytest.mark.parametrize("scheme", ["dark", "light"])
@pytest.mark.parametrize("device", VIEWPORTS)
def test_it_fits_and_can_be_read(open_pilot: OpenPilot, device: str, scheme: str) -> None:
    pilot = open_pilot(color_scheme=scheme, **VIEWPORTS[device])
    pilot.told("health")
    pilot.page.wait_for_timeout(500)
    PICTURES.mkdir(parents=True, exist_ok=True)
    pilot.page.screenshot(path=PICTURES / f"{device}-{scheme}.png")
    contrasts = pilot.page.evaluate(CONTRASTS)
    assert len(contrasts) > 20
    assert [one for one in contrasts if one["contrast"] < LEAST_CONTRAST] == []
    assert pilot.page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
    assert pilot.page.evaluate(TOO_SMALL) == []


def test_everything_is_reached_by_keyboard(open_pilot: OpenPilot) -> None:
    pilot = open_pilot()
    pilot.until(lambda: pilot.page.is_enabled("#take"))
    reached = set()
    for _ in range(20):
        pilot.page.keyboard.press("Tab")
        reached.add(pilot.page.evaluate("document.activeElement.id || document.activeElement.dataset.order"))
    buttons = {"theme", "take", "fly", "HOLD", "GROUND", "STOP", "tilt", "sound", "rumble", "tactile"}
    assert buttons | {"surface"} <= reached

    pilot.page.focus("#take")
    pilot.page.keyboard.press("Enter")
    pilot.until(lambda: pilot.text("#hand-state") == "you hold it")
    pilot.page.keyboard.press("Enter")
    pilot.until(lambda: pilot.text("#hand-state") == "free")


@pytest.mark.parametrize(("motion", "trails"), [("no-preference", True), ("reduce", False)])
def test_reduced_motion_draws_no_trails(open_pilot: OpenPilot, motion: str, trails: bool) -> None:
    pilot = open_pilot(reduced_motion=motion, init_script=COUNT_LINES)
    pilot.take_off()
    pilot.page.wait_for_timeout(3000)
    assert (pilot.page.evaluate(LINES_PER_FRAME) > 60) is trails


def test_the_theme_is_kept(open_pilot: OpenPilot) -> None:
    pilot = open_pilot()
    pilot.press("Switch between dark and light")
    pilot.page.reload()
    assert pilot.page.get_attribute("html", "data-theme") == "light"
