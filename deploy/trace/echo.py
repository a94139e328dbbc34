"""`swarmtouch trace echo`: print what is said on a key."""

import json
import os
import sys
from collections.abc import Iterator
from itertools import islice

from deploy.trace.listen import listen
from observer.swarm import running_scenario
from observer.trace.replay import PREFIX
from observer.trace.schemas import json_fields
from shared.clock import system_clock
from shared.codec import decode_on
from shared.errors import ConfigError, DecodeError
from shared.process import prepare_process
from shared.transport import Arrival

_PERIOD_S = 0.02
_SHOWN_BYTES = 32


def main(*, key: str, source: str | None, count: int | None) -> int:
    """Prints one line of JSON per message until Ctrl-C or `count`; returns the exit code, 1 if none came."""
    _check(key)
    scenario = running_scenario(source)
    stopping = prepare_process("echo")
    batches = listen(scenario, [key], system_clock(), stopping, _PERIOD_S)
    heard = (line(*item) for batch in batches for item in batch)
    return 0 if _print(islice(heard, count)) else 1


def _check(key: str) -> None:
    """Refuses what is no key expression.

    Raises:
        ConfigError: A part is empty, or has `*` beside other characters or one of `#?$`.
    """
    for part in key.split("/"):
        if part not in ("*", "**") and (not part or any(character in part for character in "*#?$")):
            raise ConfigError(f"trace echo {key}: not a key; for example human/hand or drone/*/state")


def _print(lines: Iterator[str]) -> int:
    """Prints until there is nothing more to print, or nobody who reads it; returns how many."""
    said = 0
    try:
        for text in lines:
            print(text, flush=True)
            said += 1
    except BrokenPipeError:
        # What is still buffered would fail once more when the interpreter exits.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return said


def line(key: str, arrival: Arrival) -> str:
    """Writes one message as JSON: key, arrival, and the message or why it is none."""
    content: dict[str, object]
    try:
        content = {"message": json_fields(decode_on(key.removeprefix(PREFIX), arrival.payload))}
    except DecodeError as error:
        content = {"rejected": str(error), "bytes": arrival.payload[:_SHOWN_BYTES].hex()}
    return json.dumps({"key": key, "arrival_ns": arrival.arrival_ns, **content})
