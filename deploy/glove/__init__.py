"""Showing, playing and drawing tactile patterns."""
