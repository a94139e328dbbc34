"""How a swarm is run: command line, launcher, simulators, scenarios."""
