"""Swarm state to tactile pattern to glove."""
