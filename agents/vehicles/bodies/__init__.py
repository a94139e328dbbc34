"""Simulated bodies: pure, vectorised over drones, explicit state (DESIGN section 7)."""
