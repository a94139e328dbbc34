"""Looks whether this machine can fly a swarm, and says what to do if it cannot."""
