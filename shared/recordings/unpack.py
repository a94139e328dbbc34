"""Unpacks what recorders have packed, and never more than a stated size of it."""

import bz2
from collections.abc import Callable, Iterator
from typing import cast

LARGEST_CHUNK = 1 << 26
"""Bytes of the largest chunk of a recording, packed or not: recorders make them of about a MB."""


MOST_GROWTH = 1_000
"""Times its size that a chunk may unpack to; what moves and is stamped gets ten times larger, or twenty."""
_SMALL = 1 << 20
"""Bytes that any chunk may unpack to."""


class UnpackError(ValueError):
    """Data that is damaged, packed in an unknown way, or would grow beyond all bounds."""


def unpack(data: bytes, compression: str, most: int = LARGEST_CHUNK) -> bytes:
    """Unpacks a chunk; what it takes is bounded by `most` and by its size, not by what the data says.

    Args:
        data: The chunk; what is missing at its end is missing in the result.
        compression: `zstd`, `lz4`, `bz2`, or empty or `none` for nothing.
        most: Bytes that it may unpack to.

    Raises:
        UnpackError: It is damaged, it becomes more, or the compression is unknown.
    """
    if compression not in ("", "none"):
        most = min(most, max(_SMALL, MOST_GROWTH * len(data)))
    try:
        unpacked = _at_most(data, compression, most + 1)
    except UnpackError:
        raise
    except Exception as error:  # each package raises its own
        raise UnpackError(f"damaged {compression}: {error}") from error
    if len(unpacked) > most:
        raise UnpackError(f"a chunk of more than {most / (1 << 20):g} MiB")
    return unpacked


def _at_most(data: bytes, compression: str, size: int) -> bytes:
    # The packages are imported where they are needed: flying processes read no recordings.
    match compression:
        case "" | "none":
            return data
        case "bz2":
            return bz2.BZ2Decompressor().decompress(data, size)
        case "lz4":
            import lz4.frame  # noqa: PLC0415

            return cast(bytes, lz4.frame.LZ4FrameDecompressor().decompress(data, size))
        case "zstd":
            import zstandard  # noqa: PLC0415

            with zstandard.ZstdDecompressor().stream_reader(data, read_across_frames=True) as stream:
                return b"".join(_parts(stream.read, size))
        case _:
            raise UnpackError(f"compression {compression!r:.40} is unknown")


def _parts(read: Callable[[int], bytes], size: int) -> Iterator[bytes]:
    """Reads piece by piece: at once, memory is set aside for all that may come."""
    while size > 0 and (part := read(min(1 << 20, size))):
        size -= len(part)
        yield part
