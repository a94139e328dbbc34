"""Starts a whole swarm on this machine, keeps it running, lands it and leaves no process behind."""
