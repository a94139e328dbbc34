"""A process whose wall clock steps: `python tests/chaos/stepped_clock.py SECONDS MODULE [arguments]`

It starts that far off, and SIGUSR1 steps it by as much again, as a time service does that corrects it.
"""

import runpy
import signal
import sys
import time

TRUE_TIME, TRUE_TIME_NS = time.time, time.time_ns


def main() -> None:
    _, text, module, *arguments = sys.argv
    step = float(text)
    offset = step

    def jump(*_: object) -> None:
        nonlocal offset
        offset += step

    signal.signal(signal.SIGUSR1, jump)
    time.time = lambda: TRUE_TIME() + offset
    time.time_ns = lambda: TRUE_TIME_NS() + round(offset * 1e9)
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
