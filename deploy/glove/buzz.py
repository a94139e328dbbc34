"""`swarmtouch glove buzz`: vibrates one finger."""

import argparse

from deploy.glove.device import worn
from deploy.glove.player import play, tell
from glove_bridge.patterns.pattern import Frame, Pattern
from shared.clock import system_clock


def run(arguments: argparse.Namespace) -> int:
    """Plays a pattern of one frame and returns whether it was felt.

    Raises:
        ConfigError: The URI of the glove is refused.
        DeviceError: The glove does not answer.
    """
    frame = Frame(arguments.ms, {arguments.finger: arguments.hz})
    pattern = Pattern(name=f"finger {arguments.finger}", frames=(frame,), gate_ms=arguments.ms)
    with worn(arguments.glove) as glove:
        return tell(pattern, play(glove, pattern, system_clock()))
