"""Listens to everything, commands nothing: trace, live view, statistics, report."""
