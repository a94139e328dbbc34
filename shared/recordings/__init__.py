"""Recorded motion in files: one reader per format, and one check for whatever they have read."""
