"""What readers of recorded motion find, and what is left of it once it has been checked."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from attrs import frozen

Vec = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]
Rows = npt.NDArray[np.intp]

NO_STAMP = -(2**63)
"""Stands where a source has not said when."""


class Track(NamedTuple):
    """A recorded rigid body.

    Attributes:
        t_ns: (n,) stamps, strictly increasing, ns.
        position: (n, 3) world frame, m.
        quaternion: (n, 4) x, y, z, w.
    """

    t_ns: Stamps
    position: Vec
    quaternion: Vec


@frozen(kw_only=True, eq=False)
class Found:
    """A body as a reader has found it: nothing in it is to be trusted.

    Attributes:
        t_ns: (n,) the source's stamps, ns; `NO_STAMP` where there is none.
        position: (n, 3) m.
        quaternion: (n, 4) x, y, z, w; None if the format has no orientation.
        arrival_ns: (n,) when each pose came to the recorder, ns; None if the format does not say.
        lines: (n,) where each pose stands in the file, for messages; None counts poses from 1.
        remarks: What the reader could not read, in words.
    """

    t_ns: Stamps
    position: Vec
    quaternion: Vec | None = None
    arrival_ns: Stamps | None = None
    lines: Stamps | None = None
    remarks: tuple[str, ...] = ()
