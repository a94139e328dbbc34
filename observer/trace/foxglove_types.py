"""The well-known messages of Foxglove that we write, as their documentation names the fields.

Names of classes and fields are the format itself; https://docs.foxglove.dev/docs/sdk/schemas. Lengths in m,
frame ENU, quaternions x, y, z, w, colours 0..1.
"""

import enum

from attrs import frozen

from shared.clock import NS_PER_S
from shared.messages import Vector

Nothing = tuple[()]
"""An array that we leave empty."""


@frozen
class Time:
    """A moment since the Unix epoch, or a duration."""

    sec: int = 0
    nsec: int = 0

    @classmethod
    def of(cls, stamp_ns: int) -> "Time":
        """Splits nanoseconds."""
        return cls(*divmod(stamp_ns, NS_PER_S))


@frozen
class Vector3:
    """A vector, or a size along the axes."""

    x: float
    y: float
    z: float


@frozen
class Point3:
    """A point."""

    x: float
    y: float
    z: float


@frozen
class Quaternion:
    """An orientation."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0


@frozen
class Pose:
    """Position and orientation."""

    position: Vector3
    orientation: Quaternion = Quaternion()

    @classmethod
    def at(cls, position: Vector) -> "Pose":
        """Returns an upright pose."""
        return cls(Vector3(*position))


@frozen
class Color:
    """RGBA."""

    r: float
    g: float
    b: float
    a: float = 1.0


@frozen
class SpherePrimitive:
    """An ellipsoid; `size` is its diameter along each axis."""

    pose: Pose
    size: Vector3
    color: Color


@frozen
class CylinderPrimitive:
    """A cylinder along z."""

    pose: Pose
    size: Vector3
    color: Color
    bottom_scale: float = 1.0
    top_scale: float = 1.0


class LineType(enum.IntEnum):
    """How the points of a line belong together."""

    LINE_STRIP = 0
    LINE_LOOP = 1
    LINE_LIST = 2


@frozen
class LinePrimitive:
    """Lines; `thickness` is in pixels if `scale_invariant`, else in m."""

    points: tuple[Point3, ...]
    color: Color
    thickness: float
    type: LineType = LineType.LINE_LIST
    pose: Pose = Pose(Vector3(0.0, 0.0, 0.0))
    scale_invariant: bool = True
    colors: tuple[Color, ...] = ()
    indices: tuple[int, ...] = ()


@frozen
class TextPrimitive:
    """A text that faces the viewer; `font_size` is in pixels if `scale_invariant`."""

    pose: Pose
    text: str
    color: Color
    font_size: float = 14.0
    billboard: bool = True
    scale_invariant: bool = True


@frozen(kw_only=True)
class SceneEntity:
    """Something in the scene; it replaces what had the same `id`."""

    timestamp: Time
    frame_id: str
    id: str
    lifetime: Time = Time()
    frame_locked: bool = False
    metadata: Nothing = ()
    arrows: Nothing = ()
    cubes: Nothing = ()
    spheres: tuple[SpherePrimitive, ...] = ()
    cylinders: tuple[CylinderPrimitive, ...] = ()
    lines: tuple[LinePrimitive, ...] = ()
    triangles: Nothing = ()
    texts: tuple[TextPrimitive, ...] = ()
    models: Nothing = ()


@frozen
class SceneUpdate:
    """What changes in the scene; we delete nothing."""

    entities: tuple[SceneEntity, ...]
    deletions: Nothing = ()


@frozen
class PoseInFrame:
    """A pose at a moment."""

    timestamp: Time
    frame_id: str
    pose: Pose
