"""The swarm on a virtual clock, in one process: agents in lockstep, or all drones as one batch."""
