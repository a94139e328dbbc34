"""Traces: every message of a flight in MCAP files, byte by byte as it was sent."""
