"""Compiles the modules that `pyproject.toml` lists by mypyc; `shared.compiled` has the result imported."""
