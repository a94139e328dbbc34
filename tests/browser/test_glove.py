"""What the glove plays is seen and heard finger by finger."""

import json
import math

import numpy as np
import numpy.typing as npt
import pytest

from glove_bridge.patterns import load_patterns
from glove_bridge.patterns.pattern import Pattern
from tests.browser.conftest import OpenPilot
from tests.browser.pilot import Json, Pilot
from tests.browser.test_steering import GAMEPAD

Samples = npt.NDArray[np.float64]

# What is lit, and the name of the pattern, after each change: [["{finger: Hz}", name], ...].
WATCH_FINGERS = """
    window.lit = [];
    const look = () => {
        const fingers = [...document.querySelectorAll(".finger[data-hz]")];
        const pairs = fingers.map(({ dataset }) => [dataset.finger, Number(dataset.hz)]);
        const now = JSON.stringify(Object.fromEntries(pairs));
        const name = document.getElementById("pattern-name").textContent;
        if (now !== window.lit.at(-1)?.[0]) window.lit.push([now, name]);
    };
    new MutationObserver(look).observe(document.getElementById("fingers"), { subtree: true, attributes: true });
"""

RENDER = """async (frames) => {
    const { schedule } = await import("./glove/tones.js");
    const seconds = frames.reduce((sum, frame) => sum + frame.ms, 0) / 1000;
    const context = new OfflineAudioContext(2, 44100 * seconds, 44100);
    schedule(context, frames, 0);
    const sound = await context.startRendering();
    return [[...sound.getChannelData(0)], [...sound.getChannelData(1)]];
}"""

RATE_HZ = 44100


def frames_of(pattern: Pattern) -> list[Json]:
    """Writes a pattern as the page is told."""
    return [{"ms": f.ms, "hz": {str(finger): hz for finger, hz in f.hz.items()}} for f in pattern.frames]


@pytest.fixture
def felt(open_pilot: OpenPilot) -> Pilot:
    """A pilot whose page has played at least one pattern to its end."""
    pilot = open_pilot(init_script=GAMEPAD)
    pilot.page.evaluate(WATCH_FINGERS)
    pilot.press("Rumble")
    pilot.take_off()
    x, y, _ = pilot.hand()
    pilot.drag_hand(x, 0.9 if y < 0 else -0.9)
    pilot.until(lambda: played_whole(pilot))
    return pilot


def played_whole(pilot: Pilot) -> Json | None:
    """Returns the start of the first pattern that the page has heard from its beginning to its end."""
    begun = None
    for event in pilot.patterns:
        if event["outcome"] == "started" and event["elapsed"] < 0.05:
            begun = event
        elif event["outcome"] == "finished" and begun:
            return begun
    return None


def test_a_pattern_lights_its_fingers_and_says_its_name(felt: Pilot) -> None:
    event = played_whole(felt)
    assert event is not None
    expected = [(frame["hz"], event["name"]) for frame in event["frames"]]
    assert event["frames"] == frames_of(load_patterns("paper").patterns[event["name"]])
    lit = [(json.loads(now), name) for now, name in felt.page.evaluate("window.lit")]
    assert any(lit[k : k + len(expected)] == expected for k in range(len(lit)))


def test_the_gamepad_rumbles_with_the_pattern(felt: Pilot) -> None:
    played = felt.page.evaluate("pad.played")
    assert played
    assert {effect["kind"] for effect in played} == {"dual-rumble"}
    assert max(max(effect["strongMagnitude"], effect["weakMagnitude"]) for effect in played) > 0.5


@pytest.mark.parametrize("name", ["EI", "CD", "R", "L"])
def test_every_frame_sounds_at_its_frequency_and_side(open_pilot: OpenPilot, name: str) -> None:
    pilot = open_pilot()
    frames = frames_of(load_patterns("paper").patterns[name])
    left, right = (np.array(side) for side in pilot.page.evaluate(RENDER, frames))
    start = 0
    for frame in frames:
        end = start + frame["ms"] * RATE_HZ // 1000
        for hz in (150.0, 200.0, 250.0):
            heard = strength(left[start:end], hz) + strength(right[start:end], hz)
            sounding = hz in frame["hz"].values()
            assert heard > 0.1 if sounding else heard < 0.03
        fingers = [int(finger) for finger in frame["hz"]]
        balance = level(right[start:end]) - level(left[start:end])
        side = sum(fingers) / len(fingers) - 3
        assert math.isclose(balance, 0, abs_tol=0.01) if side == 0 else balance * side > 0
        start = end


def test_sound_is_off_until_asked_for(open_pilot: OpenPilot) -> None:
    count = """
        window.contexts = 0;
        window.AudioContext = class extends AudioContext { constructor() { super(); window.contexts += 1; } };
    """
    pilot = open_pilot(init_script=count)
    pilot.told("snapshot")
    assert pilot.page.evaluate("contexts") == 0
    pilot.press("Sound")
    assert pilot.page.evaluate("contexts") == 1
    assert pilot.page.get_attribute("#sound", "aria-pressed") == "true"


def test_tactile_only_hides_drones_and_obstacles(open_pilot: OpenPilot) -> None:
    pilot = open_pilot()
    pilot.take_off()
    count = """() => {
        const canvas = document.getElementById("surface");
        const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        const colour = getComputedStyle(document.documentElement).getPropertyValue("--accent");
        const accent = colour.match(/[0-9a-f]{2}/g).map((part) => parseInt(part, 16));
        let count = 0;
        for (let k = 0; k < data.length; k += 4) count += accent.every((part, c) => data[k + c] === part);
        return count;
    }"""
    pilot.until(lambda: pilot.page.evaluate(count) > 100)
    pilot.press("Tactile only")
    pilot.until(lambda: pilot.page.evaluate(count) == 0)
    pilot.until(lambda: "Drone" not in (pilot.page.text_content("#swarm-text") or ""), limit_s=5.0)


def strength(sound: Samples, hz: float) -> float:
    """Amplitude of one frequency (a single Fourier coefficient under a Hann window)."""
    window = np.hanning(len(sound))
    turns = np.exp(-2j * np.pi * hz * np.arange(len(sound)) / RATE_HZ)
    return float(2 * abs(np.sum(sound * window * turns)) / np.sum(window))


def level(sound: Samples) -> float:
    """Effective value."""
    return float(np.sqrt(np.mean(sound**2)))
