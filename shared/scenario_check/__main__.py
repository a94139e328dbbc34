"""Checks one scenario for a process that flies: `python -m shared.scenario_check rhombus formation.n=8`."""

import sys

from shared.errors import ConfigError
from shared.plain_text import plain
from shared.scenario_check.check import open_scenario
from shared.scenario_check.checked import encode_checked


def main() -> int:
    """Writes the checked scenario to standard output, or what is wrong with it to standard error."""
    _, source, *overrides = sys.argv
    try:
        scenario, _ = open_scenario(source, overrides)
    except ConfigError as error:
        for reason in error.reasons:
            print(plain(reason, sys.maxsize), file=sys.stderr)
        return 2
    sys.stdout.buffer.write(encode_checked(scenario))
    return 0


if __name__ == "__main__":
    sys.exit(main())
