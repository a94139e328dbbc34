"""What every reader of recorded motion gives: where a body was, and when."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Vec = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]


class Track(NamedTuple):
    """A recorded rigid body.

    Attributes:
        t_ns: (n,) source stamps, strictly increasing, ns.
        position: (n, 3) world frame, m.
        quaternion: (n, 4) x, y, z, w.
    """

    t_ns: Stamps
    position: Vec
    quaternion: Vec
