"""What a terminal and a shell may ask of a flight at once."""

import asyncio
import signal

import pytest

from deploy.terminal.job_control import watch_signals

HUP, INT = signal.SIGHUP, signal.SIGINT


def asked_by(*numbers: signal.Signals) -> list[str]:
    """Returns what a process was asked for by these signals, one after the other."""
    asked = list[str]()

    async def hear() -> None:
        arrived = asyncio.Event()
        with watch_signals(lambda: asked.append("end"), lambda: asked.append("stop")):
            for number in numbers:
                signal.raise_signal(number)
                await asyncio.sleep(0)
            asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, arrived.set)
            signal.raise_signal(signal.SIGUSR1)  # comes after all others
            await asyncio.wait_for(arrived.wait(), 10.0)

    asyncio.run(hear())
    return asked


@pytest.mark.parametrize(
    ("numbers", "wanted"),
    [((HUP,), 1), ((HUP, HUP), 1), ((INT, HUP), 1), ((HUP, INT), 2), ((INT, INT), 2)],
    ids=str,
)
def test_a_closed_window_hurries_no_landing(numbers: tuple[signal.Signals, ...], wanted: int) -> None:
    assert asked_by(*numbers) == ["end"] * wanted
