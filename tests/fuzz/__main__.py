"""Fuzzes one parser with coverage: `python -m tests.fuzz NAME [options of libFuzzer] FOLDER...`."""

import sys

import atheris

with atheris.instrument_imports(
    include=["agents", "human_relay", "glove_bridge", "observer", "shared", "mcap"]
):
    from tests.fuzz.parsers import PARSERS

NAME = sys.argv.pop(1)
PARSER = next(parser for parser in PARSERS if parser.name == NAME)

atheris.Setup(sys.argv, PARSER.accepts)
atheris.Fuzz()
