"""An agent whose every step takes longer, to see whether the bench sees it.

`python tests/slow_agent.py MILLISECONDS [arguments of agents]`
"""

import sys
import time
from typing import Any

from agents import __main__ as agents
from agents.agent import Agent
from shared.messages import DroneState

QUICK_STEP = Agent.step


def main() -> int:
    extra_s = float(sys.argv.pop(1)) / 1e3

    def slow_step(agent: Agent, *arguments: Any) -> DroneState:
        state = QUICK_STEP(agent, *arguments)
        time.sleep(extra_s)
        return state

    Agent.step = slow_step  # type: ignore[assignment,method-assign]
    return agents.main()


if __name__ == "__main__":
    sys.exit(main())
