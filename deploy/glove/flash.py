"""`swarmtouch glove flash`: puts the firmware on an Arduino UNO, through its bootloader, with avrdude."""

import argparse
import shutil
import subprocess
from pathlib import Path

import glove_bridge
from deploy.glove.device import only_port
from shared.errors import ConfigError, DeviceError

FIRMWARE = Path(glove_bridge.__file__).parent / "firmware"
IMAGE = FIRMWARE / "glove.hex"
"""Built from the sketch beside it."""
_UNO = ("-p", "atmega328p", "-c", "arduino", "-b", "115200", "-D")


def run(arguments: argparse.Namespace) -> int:
    """Writes and verifies it.

    Raises:
        ConfigError: No firmware, no avrdude, or no telling which port.
        DeviceError: avrdude failed; what it says is on the terminal.
    """
    image: Path = arguments.hex or IMAGE
    if not image.is_file():
        raise ConfigError(f"{image}: there is no such file; `make -C {FIRMWARE}` builds {IMAGE.name}")
    avrdude = shutil.which("avrdude")
    if avrdude is None:
        raise ConfigError("avrdude is missing; on Debian: apt install avrdude")
    command = [avrdude, *_UNO, "-P", arguments.port or only_port(), "-U", f"flash:w:{image}:i"]
    code = subprocess.run(command, check=False).returncode
    if code:
        raise DeviceError(f"avrdude ended with {code}; is the board's switch or XBee off its serial pins?")
    print(f"{image.name} is on the board; next: swarmtouch glove hello")
    return 0
