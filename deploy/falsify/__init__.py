"""Looks for the worst flight of a scenario: hands, faults and weather, flown in lockstep by real agents."""
