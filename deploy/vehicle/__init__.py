"""Vehicles: what one can do, measured (`swarmtouch vehicle`)."""
