"""Command-line arguments of the console, and the words that they take."""

import argparse
from pathlib import Path

from observer.console import PORT
from shared.nodes import LOOPBACK
from shared.validators import MAX_PORT

TOKEN_VARIABLE = "SWARMTOUCH_CONSOLE_TOKEN"  # noqa: S105  the name of a variable, no token
RANDOM_TOKEN = "random"  # noqa: S105  a word, no token


def _port(text: str) -> int:
    port = int(text)
    if not 0 <= port <= MAX_PORT:
        raise argparse.ArgumentTypeError(f"{text} must be 0 to {MAX_PORT}")
    return port


def add_console_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares where and how to serve."""
    parser.add_argument("--host", default=LOOPBACK, help="address to bind; others want a token (%(default)s)")
    parser.add_argument("--port", type=_port, default=PORT, help="TCP port, 0 for any free one (%(default)s)")
    parser.add_argument(
        "--token",
        metavar="CHOICE",
        help=f"{RANDOM_TOKEN} or @FILE: what a page must know (default: {TOKEN_VARIABLE}, or nothing)",
    )
    parser.add_argument(
        "--tls", type=Path, metavar="DIR", help="HTTPS with DIR/cert.pem and key.pem, made if they are missing"
    )
