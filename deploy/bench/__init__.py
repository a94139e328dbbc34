"""The bench: what the swarm costs, measured against the floor of its transport in the same run."""
