"""Files from anywhere: as people name them, in whatever encoding, and no more of them than a stated size."""

import codecs
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import unquote

from shared.errors import ConfigError

LARGEST = 1 << 24
"""Bytes of the largest file that is read at once: no configuration of ours is nearly as long."""

_MARKS = (
    # The mark of UTF-32 begins with that of UTF-16.
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def named(text: str) -> Path:
    """Returns the file or folder of a name, or of the percent-decoded name if only that is there."""
    path, decoded = (Path(name).expanduser() for name in (text, unquote(text)))
    return decoded if not path.exists() and decoded.exists() else path


@contextmanager
def writing(path: Path) -> Generator[None]:
    """Names a file, or folder, that cannot be written; a full disk says so only as the file is closed.

    Raises:
        ConfigError: It cannot.
    """
    try:
        yield
    except OSError as error:
        where = path if error.filename is None else error.filename
        raise ConfigError(f"{where}: cannot be written: {error.strerror or error}") from error


def encoding_of(head: bytes) -> str:
    """Tells the encoding of a text by its first bytes: by its mark, or by the zeros of UTF-16; else UTF-8.

    Args:
        head: At least four bytes, if there are so many.
    """
    for mark, encoding in _MARKS:
        if head.startswith(mark):
            return encoding
    if len(head) > 1 and 0 in head[:2]:
        return "utf-16-le" if head[0] else "utf-16-be"
    return "utf-8"


def read_bytes(path: Path, most: int = LARGEST) -> bytes:
    """Reads a whole file.

    Raises:
        OSError: It cannot be read.
        ValueError: It is larger than `most`, whatever it says about its size.
    """
    with path.open("rb") as stream:
        data = stream.read(most + 1)
    if len(data) > most:
        raise ValueError(f"larger than {most >> 20} MiB")
    return data


def read_text(path: Path, most: int = LARGEST) -> str:
    """Reads a whole file as text: UTF-8, with or without a mark, or UTF-16; lines end as in Unix.

    Raises:
        OSError: It cannot be read.
        ValueError: It is none of these, or larger than `most` bytes.
    """
    data = read_bytes(path, most)
    try:
        text = data.decode(encoding_of(data[:4]))
    except UnicodeDecodeError as error:
        raise ValueError(f"no text in UTF-8 or UTF-16 ({error}); save it as UTF-8") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")
