"""Simulated bodies, one at a time: pure, explicit state (DESIGN section 7); written as `agents.control` is."""
