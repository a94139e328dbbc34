"""What a scenario may say: one frozen class per TOML table, with its defaults and single-value checks."""

from typing import Literal

from attrs import Factory, field, frozen
from attrs.validators import optional

from shared.pointer_link import DEFAULT_SOCKET
from shared.validators import (
    check_box,
    check_endpoint,
    drone_number,
    hand_rate,
    key_chunk,
    not_negative,
    port,
    positive,
)

Law = Literal["paper", "stable"]
Profile = Literal["laptop", "compose", "field", "radio"]
Shape = Literal["rhombus", "triangle", "line", "vee", "grid", "custom"]
Triple = tuple[float, float, float]
Pair = tuple[float, float]


@frozen(kw_only=True)
class Swarm:
    """`[swarm]`: who it is and by which law it flies.

    Attributes:
        name: Prefix of every key; swarms of other names do not hear this one.
        law: `paper` (references are actual positions, Eqs. 11-13) or `stable` (references are goals).
        total_limit: `stable`: bound of the summed corrections along the deepest path, m.
    """

    name: str = field(default="swarm", validator=key_chunk)
    law: Law = "stable"
    total_limit: float = field(default=0.5, validator=positive)


@frozen(kw_only=True)
class Rates:
    """`[rates]`: Hz.

    Attributes:
        control_hz: Agents step so often without a hand, and simulators with one.
        max_control_hz: No agent steps more often, however many samples come.
        hand_hz: The relay sends no more poses of the hand than these, the newest; agents step at it.
    """

    control_hz: float = field(default=60.0, validator=positive)
    max_control_hz: float = field(default=120.0, validator=positive)
    hand_hz: float = field(default=60.0, validator=hand_rate)


@frozen(kw_only=True)
class Clip:
    """`[hand.clip]`: box that the mapped hand is clipped to, m (x, y)."""

    min: Pair
    max: Pair

    def __attrs_post_init__(self) -> None:
        check_box(self.min, self.max)


@frozen(kw_only=True)
class Hand:
    """`[hand]`: from the hand in the world to the point that the formation refers to.

    Attributes:
        mapping: `absolute` (the hand itself) or `relative` (`offset + gain * hand`).
        gain: Factor of `relative`, also on the velocity.
        offset: Shift of `relative`, m.
        height: Fixed height of the mapped hand, m; absent: it follows the hand.
        home: Mapped hand (x, y) at which the formation is laid out on the ground, m.
        clip: Box for the mapped hand, absent: only the fence.
        follow_yaw: Whether the formation turns with the hand's yaw.
        max_speed: The mapped hand follows no faster than this, m/s.
    """

    mapping: Literal["absolute", "relative"] = "absolute"
    gain: float = field(default=1.0, validator=positive)
    offset: Triple = (0.0, 0.0, 0.0)
    height: float | None = None
    home: Pair = (0.0, 0.0)
    clip: Clip | None = None
    follow_yaw: bool = True
    max_speed: float = field(default=0.75, validator=positive)


@frozen(kw_only=True)
class LinkSettings:
    """One entry of `[[impedance.links]]`: what differs for one link from the default."""

    name: str
    mass: float | None = None
    damping: float | None = None
    stiffness: float | None = None
    gain: float | None = None
    limit: float | None = None


@frozen(kw_only=True)
class Impedance:
    """`[impedance]`: the mass-spring-damper of every link, `M x'' + D x' + K x = Kv v_hand`.

    Attributes:
        mass: M, kg.
        damping: D, N s/m.
        stiffness: K, N/m.
        gain: Kv, N s/m; 0 switches the links off.
        limit: Bound of each displacement and axis, m.
        links: Exceptions by link name, for example `"2-4"`.
    """

    mass: float = field(default=1.9, validator=positive)
    damping: float = field(default=12.6, validator=not_negative)
    stiffness: float = field(default=21.0, validator=positive)
    gain: float = -7.0
    limit: float = field(default=0.25, validator=positive)
    links: tuple[LinkSettings, ...] = ()


@frozen(kw_only=True)
class Drone:
    """One entry of `[[formation.drones]]`: the geometry of one drone.

    Attributes:
        id: Number of the drone, from 1.
        references: `"human"` or numbers of drones.
        weights: Weight per reference, sum 1; absent: equal.
        offset: Place relative to the weighted references, formation frame, m.
    """

    id: int = field(validator=drone_number)
    references: tuple[str, ...]
    weights: tuple[float, ...] | None = None
    offset: Triple = (0.0, 0.0, 0.0)


@frozen(kw_only=True)
class FormationSettings:
    """`[formation]`: geometry and impedance links, independently of each other.

    Attributes:
        shape: A generator, or `custom` with `drones`.
        n: Number of drones of a generated shape.
        spacing: Distance along the direction of motion (L), m.
        width: Distance across (H), m.
        columns: `grid`: drones per row; absent: near square.
        drones: The geometry of `custom`.
        links: Impedance links `"from-to"`; absent: one per reference. `[]` means none.
        absent: Numbers of drones that stay away from this flight: nobody waits for them, and whoever refers to
            one refers to what that one refers to.
        height_from: `paper` law: `hand` takes the height of a reference from the hand and the rest shape, as
            the recorded flights did; `references` takes its actual height, literally Eqs. 11-13, and lets the
            slow altitude loop of every drone ring through the whole formation.
    """

    shape: Shape = "rhombus"
    n: int = field(default=4, validator=positive)
    spacing: float = field(default=0.5, validator=positive)
    width: float = field(default=0.5, validator=positive)
    columns: int | None = field(default=None, validator=optional(positive))
    drones: tuple[Drone, ...] = ()
    links: tuple[str, ...] | None = None
    absent: tuple[int, ...] = ()
    height_from: Literal["hand", "references"] = "hand"


@frozen(kw_only=True)
class Obstacle:
    """One entry of `[[obstacles]]`: a vertical column.

    Attributes:
        name: For people.
        x: Its axis, m.
        y: The same.
        radius: m; absent: `avoidance.columns.radius`.
        height: m; absent: it has no end.
    """

    name: str
    x: float
    y: float
    radius: float | None = field(default=None, validator=optional(positive))
    height: float | None = field(default=None, validator=optional(positive))


@frozen(kw_only=True)
class Walker:
    """One entry of `[[walkers]]`: somebody who walks among the drones, in the simulated world.

    Attributes:
        name: For people.
        path: Corners of the way (x, y), m; walked there and back again.
        speed: Largest speed, m/s.
        radius: m.
        height: m.
        start: When the walk begins, s.
    """

    name: str
    path: tuple[Pair, ...]
    speed: float = field(default=1.0, validator=positive)
    radius: float = field(default=0.3, validator=positive)
    height: float = field(default=1.8, validator=positive)
    start: float = field(default=0.0, validator=not_negative)

    def __attrs_post_init__(self) -> None:
        if not self.path:
            raise ValueError("path is empty; give the corners of the way, for example [[0.0, 1.0], [2.0, 1.0]]")


@frozen(kw_only=True)
class FieldSettings:
    """Potential field of one kind of obstacle (Eqs. 14-16).

    Attributes:
        eta: Gain of the repulsion, m^4/s.
        d0: Distance from the surface at which it starts, m.
        radius: Radius of the obstacle, m.
    """

    eta: float = field(validator=positive)
    d0: float = field(validator=positive)
    radius: float = field(validator=positive)


@frozen(kw_only=True)
class Avoidance:
    """`[avoidance]`: columns by field or projection; separation from drones and hand always on.

    Attributes:
        rule: `field` (Eqs. 14-16) or `projection` (the flights' rule, swept, with a margin).
        xi: Gain of the attraction, 1/s.
        speed: Largest set-point speed while a column acts, m/s.
        columns: Field of the columns.
        separation: Field of other drones and of the hand.
        projection_radius: Circle of `projection`, m.
        projection_margin: Added to it in flight, m.
    """

    rule: Literal["field", "projection"] = "field"
    xi: float = field(default=2.0, validator=positive)
    speed: float = field(default=0.5, validator=positive)
    columns: FieldSettings = FieldSettings(eta=0.002, d0=0.30, radius=0.12)
    separation: FieldSettings = FieldSettings(eta=2e-4, d0=0.12, radius=0.18)
    projection_radius: float = field(default=0.27, validator=positive)
    projection_margin: float = field(default=0.06, validator=not_negative)


@frozen(kw_only=True)
class VehicleSettings:
    """Settings of a vehicle; absent ones come from the next wider table (robot > type > all).

    Attributes:
        type: Name of a table under `[vehicles.types]`.
        uri: Backend, `{id}` is replaced by the drone's number.
        body: Simulated body: `identified` or `crazyflie`.
        link_loss: What a simulated body does without commands: `crazyflie` or `hover`.
        envelope: What the vehicle can do: a file of `swarmtouch vehicle identify`, or one that ships by its
            name; absent: that of the simulated body.
        tau: Lag of the vehicle that the `stable` law leads by, s; absent: that of the envelope.
        battery: Fault of a simulated vehicle: its charge at the start, 0..1.
        endurance: The same: flying time from full to empty, s; absent: its battery never drains.
        pose_silence: The same: (start, length) of a time without poses, s from the start of the world.
    """

    type: str | None = None
    uri: str | None = None
    body: Literal["identified", "crazyflie"] | None = None
    link_loss: Literal["crazyflie", "hover"] | None = None
    envelope: str | None = None
    tau: float | None = field(default=None, validator=optional(not_negative))
    battery: float | None = field(default=None, validator=optional(not_negative))
    endurance: float | None = field(default=None, validator=optional(positive))
    pose_silence: tuple[float, float] | None = None


@frozen(kw_only=True)
class Vehicles:
    """`[vehicles]`: robot > type > all."""

    all: VehicleSettings = VehicleSettings()
    types: dict[str, VehicleSettings] = Factory(dict)
    robots: dict[str, VehicleSettings] = Factory(dict)

    def __attrs_post_init__(self) -> None:
        for name, settings in (("all", self.all), *self.robots.items()):
            if settings.type is not None and settings.type not in self.types:
                known = ", ".join(self.types) or "none"
                raise ValueError(f"{name}: no type {settings.type!r} in vehicles.types; known: {known}")


@frozen(kw_only=True)
class Limits:
    """`[limits]`: bounds of what a vehicle is ever asked to do.

    Attributes:
        speed: Set-point speed, m/s (1.5 x the hand's speed if that is larger).
        acceleration: Set-point acceleration, m/s^2.
        safety_distance: Smallest distance of two drones in the rest shape, m.
        takeoff_height: Height at which a drone joins the formation, m.
        takeoff_speed: Climb rate, m/s.
        landing_speed: Descent rate, m/s.
    """

    speed: float = field(default=1.0, validator=positive)
    acceleration: float = field(default=3.0, validator=positive)
    safety_distance: float = field(default=0.30, validator=positive)
    takeoff_height: float = field(default=1.2, validator=positive)
    takeoff_speed: float = field(default=0.5, validator=positive)
    landing_speed: float = field(default=0.5, validator=positive)


@frozen(kw_only=True)
class Fence:
    """`[fence]`: box that no drone leaves.

    Attributes:
        min: Lower corner, m; absent: the formation at home less `room`.
        max: Upper corner, m; absent: the formation at home plus `room`.
        room: Free space around the formation where a corner is absent, m.
        margin: Free space between goals and the box, m.
    """

    min: Triple | None = None
    max: Triple | None = None
    room: float = field(default=3.0, validator=positive)
    margin: float = field(default=0.15, validator=not_negative)

    def __attrs_post_init__(self) -> None:
        if self.min is not None and self.max is not None:
            check_box(self.min, self.max)


@frozen(kw_only=True)
class Net:
    """`[net]`: where the processes meet.

    Attributes:
        profile: How: `laptop` (TCP on loopback), `compose` (TCP
            between containers, by name), `field` (QUIC, mutual TLS, access rules, signed hand) or `radio` (the
            hand over UDP multicast beside the mesh).
        base_port: First port on loopback of nodes without an endpoint.
        endpoint: Endpoint of nodes without an entry in `endpoints`, `{node}` is replaced by the name of the
            node with a dash; for example `tcp/{node}.swarm:7447`, where names resolve.
        endpoints: Node -> Zenoh endpoint, for example `"drone/2" = "udp/10.0.0.2:7447"`; a node at `udp/`
            uses the TCP port of that number as well, for all but samples.
        router: Endpoint of a router whose client every node is, instead of linking to each other.
        keys: Directory with the keys of this node (`swarmtouch net keys`); empty: none.
        multicast: Group of the hand's radio, for example `224.0.0.225:7450`; empty: that one, or a free
            port of it for a flight on one machine.
        interface: Network interface of the radio, for example `wlan0`.
        adminspace: Whether nodes answer Zenoh's adminspace queries (for inspection).
        full_mesh: Up to this many drones everyone links to everyone; of more, who must or comes near.
        pointer: Unix socket where the relay's `pointer://` source hears consoles: an absolute path, or a name
            in a folder that only their user can enter; empty: it has none.
    """

    profile: Profile = "laptop"
    base_port: int = field(default=7460, validator=port)
    endpoint: str | None = None
    endpoints: dict[str, str] = Factory(dict)
    router: str | None = None
    keys: str = ""
    multicast: str = ""
    interface: str = "lo"
    adminspace: bool = False
    full_mesh: int = field(default=16, validator=not_negative)
    pointer: str = DEFAULT_SOCKET

    def __attrs_post_init__(self) -> None:
        named = {f'endpoints."{node}"': text for node, text in self.endpoints.items()}
        for key, text in {"endpoint": self.endpoint, "router": self.router, **named}.items():
            if text is not None:
                check_endpoint(key, text)


@frozen(kw_only=True)
class Scenario:
    """A whole scenario file."""

    swarm: Swarm = Swarm()
    rates: Rates = Rates()
    hand: Hand = Hand()
    impedance: Impedance = Impedance()
    formation: FormationSettings = FormationSettings()
    obstacles: tuple[Obstacle, ...] = ()
    walkers: tuple[Walker, ...] = ()
    avoidance: Avoidance = Avoidance()
    vehicles: Vehicles = Vehicles()
    limits: Limits = Limits()
    fence: Fence = Fence()
    net: Net = Net()
