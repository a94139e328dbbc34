"""The swarm as a 3D scene: messages in, Foxglove's scene entities out; no clock, no I/O."""

import math
from itertools import product

from observer.trace.foxglove_types import (
    Color,
    CylinderPrimitive,
    LinePrimitive,
    Point3,
    Pose,
    SceneEntity,
    SceneUpdate,
    SpherePrimitive,
    TextPrimitive,
    Time,
    Vector3,
)
from shared.cylinders import Cylinder, columns_of, cylinder_of
from shared.fence import fence_box
from shared.formation import Formation
from shared.messages import NO_HAND, ORIGIN, DroneState, HandSample, Message, ObstacleState, Vector
from shared.obstacle_watch import MOST_OBSTACLES
from shared.scenario import Scenario

FRAME = "world"

# Okabe and Ito's colours: told apart by colour-blind readers too.
_BODY = Color(0.00, 0.45, 0.70)
_GOAL = Color(0.34, 0.71, 0.91, 0.6)
_HAND = Color(0.90, 0.62, 0.00)
_RELAXED = Color(0.60, 0.60, 0.60)
_STRETCHED = Color(0.84, 0.37, 0.00)
_COLUMN = Color(0.35, 0.35, 0.35)
_ZONE = Color(0.80, 0.47, 0.65, 0.25)
_WALKER = Color(0.94, 0.89, 0.26, 0.7)
_FENCE = Color(0.00, 0.62, 0.45)
_LABEL = Color(0.80, 0.80, 0.80)

_BODY_SIZE, _GOAL_SIZE, _HAND_SIZE = 0.10, 0.05, 0.14
_LABEL_HEIGHT = 0.15
_MOST_STRANGERS = 16


class Scene:
    """What is known of a flight at one moment.

    Args:
        scenario: What flies, resolved.
        formation: Its formation.
    """

    def __init__(self, scenario: Scenario, formation: Formation) -> None:
        self._scenario = scenario
        self._formation = formation
        self._box = tuple(tuple(map(float, corner)) for corner in fence_box(scenario, formation))
        self._hand: HandSample | None = None
        self._drones: dict[int, DroneState] = {}
        self._own = set(formation.ids)
        self._walkers: dict[int, ObstacleState] = {}

    def add(self, message: Message) -> None:
        """Takes a message; only the newest of the hand, of each drone and of each moving obstacle counts."""
        if isinstance(message, HandSample):
            self._hand = message
        elif isinstance(message, DroneState) and self._has_room(message.id):
            self._drones[message.id] = message
        elif isinstance(message, ObstacleState) and (message.id in self._walkers or self._has_room_aside()):
            self._walkers[message.id] = message

    def _has_room_aside(self) -> bool:
        return len(self._walkers) < MOST_OBSTACLES

    def _has_room(self, drone: int) -> bool:
        """Says whether a drone is shown: those of the formation, and a few that anybody may have made up."""
        most = len(self._own) + _MOST_STRANGERS
        return drone in self._drones or drone in self._own or len(self._drones) < most

    def surroundings(self, stamp_ns: int) -> SceneUpdate:
        """Returns what never moves: fence, columns and the zones in which they act."""
        avoidance = self._scenario.avoidance
        cylinders = []
        for column in columns_of(self._scenario):
            body, zone = column.radius, column.radius + avoidance.columns.d0
            if avoidance.rule == "projection":
                body = avoidance.projection_radius
                zone = body + avoidance.projection_margin
            standing = column._replace(low=0.0, high=min(column.high, self._box[1][2]))
            cylinders += [
                _upright(standing._replace(radius=r), color) for r, color in ((body, _COLUMN), (zone, _ZONE))
            ]
        fence = LinePrimitive(self._edges(), _FENCE, thickness=1.0)
        return SceneUpdate(
            (
                _entity("fence", stamp_ns, lines=(fence,)),
                _entity("obstacles", stamp_ns, cylinders=tuple(cylinders)),
            )
        )

    def moment(self, stamp_ns: int) -> SceneUpdate:
        """Returns the hand, every drone with its goal and its links, and what moves among them."""
        entities = [self._drone(state, stamp_ns) for state in self._drones.values()]
        entities += [
            _entity(f"obstacle/{state.id}", stamp_ns, cylinders=(_upright(cylinder_of(state), _WALKER),))
            for state in self._walkers.values()
        ]
        if self._hand is not None and self._hand.position != NO_HAND:
            hand = _sphere(self._hand.position, _HAND_SIZE, _HAND)
            entities.append(_entity("hand", stamp_ns, spheres=(hand,)))
        return SceneUpdate(tuple(entities))

    def _drone(self, state: DroneState, stamp_ns: int) -> SceneEntity:
        x, y, z = state.position
        label = TextPrimitive(Pose.at((x, y, z + _LABEL_HEIGHT)), f"{state.id} {state.mode}", _LABEL)
        goal = LinePrimitive((Point3(*state.position), Point3(*state.goal)), _GOAL, thickness=1.0)
        return _entity(
            f"drone/{state.id}",
            stamp_ns,
            spheres=(_sphere(state.position, _BODY_SIZE, _BODY), _sphere(state.goal, _GOAL_SIZE, _GOAL)),
            lines=(goal, *self._links(state)),
            texts=(label,),
        )

    def _links(self, state: DroneState) -> list[LinePrimitive]:
        """Draws what the drone refers to and is linked to, the redder the more the link is displaced."""
        formation = self._formation
        if state.id not in formation.ids:
            return []
        shares = {self._place(source): 0.0 for source in formation.references(state.id)}
        if formation.refers_to_human(state.id):
            shares[self._place(None)] = 0.0
        for link in formation.links_into(state.id):
            source = formation.ids[link.source - 1] if link.source else None
            shares[self._place(source)] = math.hypot(*state.displacements.get(link.name, ORIGIN)) / link.limit
        end = Point3(*state.position)
        return [
            LinePrimitive((Point3(*place), end), _blend(share), thickness=3.0)
            for place, share in shares.items()
            if place is not None
        ]

    def _place(self, source: int | None) -> Vector | None:
        """Returns where a drone or the hand (None) is, None if it has not been seen."""
        message = self._hand if source is None else self._drones.get(source)
        return message.position if message and message.position != NO_HAND else None

    def _edges(self) -> tuple[Point3, ...]:
        """Pairs of corners that differ along one axis."""
        low, high = self._box
        corners = list(product(*zip(low, high, strict=True)))
        return tuple(
            Point3(*end)
            for number, one in enumerate(corners)
            for other in corners[number + 1 :]
            if sum(a != b for a, b in zip(one, other, strict=True)) == 1
            for end in (one, other)
        )


def _upright(cylinder: Cylinder, color: Color) -> CylinderPrimitive:
    x, y, radius, low, high = cylinder
    return CylinderPrimitive(
        Pose.at((x, y, (low + high) / 2)), Vector3(2 * radius, 2 * radius, high - low), color
    )


def _entity(
    name: str,
    stamp_ns: int,
    *,
    spheres: tuple[SpherePrimitive, ...] = (),
    cylinders: tuple[CylinderPrimitive, ...] = (),
    lines: tuple[LinePrimitive, ...] = (),
    texts: tuple[TextPrimitive, ...] = (),
) -> SceneEntity:
    return SceneEntity(
        timestamp=Time.of(stamp_ns),
        frame_id=FRAME,
        id=name,
        spheres=spheres,
        cylinders=cylinders,
        lines=lines,
        texts=texts,
    )


def _sphere(position: Vector, size: float, color: Color) -> SpherePrimitive:
    return SpherePrimitive(Pose.at(position), Vector3(size, size, size), color)


def _blend(share: float) -> Color:
    """Returns a colour between relaxed (0) and stretched to the limit (1)."""
    t = min(share, 1.0)
    one, other = _RELAXED, _STRETCHED
    return Color(one.r + t * (other.r - one.r), one.g + t * (other.g - one.g), one.b + t * (other.b - one.b))
