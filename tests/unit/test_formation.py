"""The formation matrix: rows, order, rest shapes, links and the bound on corrections."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.arrays import offsets_of, rest_of, weights_of
from shared.config import SCENARIOS, load_scenario, structure_scenario
from shared.errors import ConfigError
from shared.formation import PAPER_MAX_DEPTH, Formation, build_formation

SHIPPED = sorted(path.stem for path in SCENARIOS.glob("*.toml"))
GENERATED = [(shape, n) for shape in ("line", "vee", "grid") for n in (1, 2, 3, 4, 5, 9, 16, 17, 32, 64)]


def formation_of(shape: str, n: int, **settings: object) -> Formation:
    return build_formation(structure_scenario({"formation": {"shape": shape, "n": n, **settings}}, "here"))


@st.composite
def custom_formations(draw: st.DrawFn) -> Formation:
    """A random DAG with random weights; offsets keep drones apart whatever the weights are."""
    count = draw(st.integers(1, 8))
    ids = draw(st.lists(st.integers(1, 99), min_size=count, max_size=count, unique=True))
    drones = []
    for place, number in enumerate(ids):
        earlier = ["human", *(str(i) for i in ids[:place])]
        references = draw(st.lists(st.sampled_from(earlier), min_size=1, unique=True, max_size=4))
        shares = draw(st.lists(st.floats(0.1, 1.0), min_size=len(references), max_size=len(references)))
        weights = [share / sum(shares) for share in shares]
        offset = [0.0, 0.0, draw(st.floats(-1.0, 1.0))]
        offset[place % 2] = 2.0 ** (place + 1)
        drones.append({"id": number, "references": references, "weights": weights, "offset": offset})
    tree = {"formation": {"shape": "custom", "drones": drones}, "limits": {"safety_distance": 1e-6}}
    try:
        return build_formation(structure_scenario(tree, "here"))
    except ConfigError:
        # Two drones may still coincide: what remains must be a formation.
        return formation_of("line", count)


def check(formation: Formation) -> None:
    """What holds for every formation."""
    n = len(formation.ids)
    assert formation.ids == tuple(sorted(formation.ids))
    weights, rest = weights_of(formation), rest_of(formation)
    assert (weights >= 0).all()
    assert weights.sum(axis=1) == pytest.approx(np.ones(n))
    level_of = {row: depth for depth, level in enumerate(formation.levels) for row in level}
    assert sorted(level_of) == list(range(n))
    for row in range(n):
        parents = np.flatnonzero(weights[row, 1:]).tolist()
        assert level_of[row] == max((level_of[parent] + 1 for parent in parents), default=0)
    assert weights @ np.vstack([np.zeros(3), rest]) + offsets_of(formation) == pytest.approx(rest)
    assert formation.radius == pytest.approx(max(math.hypot(x, y) for x, y, _ in formation.rest))
    for drone in formation.ids:
        ancestors = formation.ancestors(drone)
        assert drone not in ancestors
        assert set(formation.references(drone)) <= set(ancestors)
        assert all(set(formation.references(a)) <= set(ancestors) for a in ancestors)


@given(formation=custom_formations())
def test_any_graph_that_is_accepted_is_a_formation(formation: Formation) -> None:
    check(formation)


@pytest.mark.parametrize(("shape", "n"), GENERATED)
def test_every_shape_is_a_formation_of_n_distinct_places(shape: str, n: int) -> None:
    formation = formation_of(shape, n)
    check(formation)
    assert formation.ids == tuple(range(1, n + 1))
    gaps = [math.dist(a, b) for a, b in itertools.combinations(formation.rest, 2)]
    assert min(gaps, default=0.5) >= 0.5 - 1e-9


@pytest.mark.parametrize("n", [1, 2, 7, 32])
def test_a_line_goes_ahead_of_the_hand(n: int) -> None:
    formation = formation_of("line", n, spacing=0.4)
    assert rest_of(formation) == pytest.approx(np.array([[-0.4 * i, 0.0, 0.0] for i in range(1, n + 1)]))
    assert formation.depth == n


@pytest.mark.parametrize("n", [1, 2, 3, 8, 33])
def test_a_vee_has_a_tip_and_two_arms(n: int) -> None:
    formation = formation_of("vee", n, spacing=0.4, width=0.6)
    places = [(-0.4 * (1 + i // 2), 0.6 * (i // 2) * (1 if i % 2 == 0 else -1), 0.0) for i in range(1, n + 1)]
    assert rest_of(formation) == pytest.approx(np.array(places))


@pytest.mark.parametrize(("n", "columns"), [(9, None), (9, 3), (10, 4), (12, 5), (5, 1), (7, 2)])
def test_a_grid_is_centred_rows(n: int, columns: int | None) -> None:
    formation = formation_of("grid", n, **({} if columns is None else {"columns": columns}))
    wide = columns or math.ceil(math.sqrt(n))
    for row, indices in itertools.groupby(range(n), lambda i: i // wide):
        places = rest_of(formation)[list(indices)]
        assert places[:, 0] == pytest.approx(np.full(len(places), -0.5 * (row + 1)))
        if len(places) == wide:
            across = sorted(places[:, 1])
            assert np.diff(across) == pytest.approx(np.full(wide - 1, 0.5))
            assert abs(across[0] + across[-1]) <= 0.5 + 1e-9


def test_the_rhombus_is_equations_11_to_13() -> None:
    formation = build_formation(load_scenario("rhombus"))
    assert weights_of(formation) == pytest.approx(
        np.array([[1, 0, 0, 0, 0], [0, 1, 0, 0, 0], [0, 1, 0, 0, 0], [0, 0, 0.5, 0.5, 0]])
    )
    offsets = [[-0.5, 0.0, 0.0], [-0.5, 0.5, 0.0], [-0.5, -0.5, 0.0], [-0.5, 0.0, 0.0]]
    assert offsets_of(formation) == pytest.approx(np.array(offsets))
    assert [link.name for link in formation.links] == ["human-1", "1-2", "1-3", "2-4", "3-4"]
    assert formation.levels == ((0,), (1, 2), (3,))
    assert formation.correction_scale == 1.0
    assert formation.references(4) == (2, 3)
    assert [formation.refers_to_human(i) for i in (1, 2, 3, 4)] == [True, False, False, False]
    assert formation.ancestors(4) == (1, 2, 3)
    assert [link.name for link in formation.links_into(4)] == ["2-4", "3-4"]


def test_the_maze_is_the_triangle_of_the_recorded_flights() -> None:
    formation = build_formation(load_scenario("maze"))
    assert formation.depth == 1
    assert formation.rest[0] == pytest.approx(np.zeros(3))
    sides = [math.dist(a, b) for a, b in itertools.combinations(formation.rest, 2)]
    assert sides == pytest.approx([0.398, 0.398, 0.4], abs=1e-3)


def test_links_are_chosen_independently_of_the_geometry() -> None:
    tree = {
        "formation": {"links": ["human-4", "1-3"]},
        "impedance": {"stiffness": 30.0, "links": [{"name": "1-3", "limit": 0.1, "gain": 0.0}]},
    }
    formation = build_formation(structure_scenario(tree, "here"))
    first, second = formation.links
    assert (first.name, first.source, first.target, first.stiffness, first.limit) == (
        "human-4",
        0,
        3,
        30.0,
        0.25,
    )
    assert (second.name, second.source, second.target, second.limit, second.gain) == ("1-3", 1, 2, 0.1, 0.0)
    assert build_formation(structure_scenario({"formation": {"links": []}}, "here")).links == ()


@given(
    shape=st.sampled_from(["line", "vee", "grid", "rhombus"]),
    n=st.integers(1, 40),
    limit=st.floats(0.01, 2.0),
    total=st.floats(0.05, 2.0),
)
def test_the_sum_of_corrections_along_every_path_is_bounded(
    shape: str, n: int, limit: float, total: float
) -> None:
    tree = {
        "swarm": {"law": "stable", "total_limit": total},
        "formation": {"shape": shape, "n": n},
        "impedance": {"limit": limit},
    }
    formation = build_formation(structure_scenario(tree, "here"))
    assert 0.0 < formation.correction_scale <= 1.0
    largest: dict[int, float] = {}
    for row in itertools.chain.from_iterable(formation.levels):
        drone = formation.ids[row]
        own = sum(link.limit for link in formation.links_into(drone))
        largest[drone] = own + max((largest[parent] for parent in formation.references(drone)), default=0.0)
    worst = max(largest.values())
    assert formation.correction_scale * worst <= total * (1 + 1e-12)
    assert formation.correction_scale == 1.0 or formation.correction_scale * worst == pytest.approx(total)


def test_links_without_gain_need_no_room() -> None:
    tree = {"formation": {"shape": "line", "n": 32}, "impedance": {"gain": 0.0}}
    assert build_formation(structure_scenario(tree, "here")).correction_scale == 1.0


@pytest.mark.parametrize("depth", range(1, 8))
def test_the_paper_law_flies_four_hops_and_no_more(depth: int) -> None:
    tree = {"swarm": {"law": "paper"}, "formation": {"shape": "line", "n": depth}}
    scenario = structure_scenario(tree, "here")
    if depth <= PAPER_MAX_DEPTH:
        assert build_formation(scenario).depth == depth
    else:
        with pytest.raises(ConfigError, match=f"{depth} hops deep"):
            build_formation(scenario)


@given(gap=st.floats(0.05, 1.0))
def test_drones_rest_at_least_the_safety_distance_apart(gap: float) -> None:
    tree = {"formation": {"shape": "line", "n": 3, "spacing": gap}, "limits": {"safety_distance": 0.4}}
    scenario = structure_scenario(tree, "here")
    if gap >= 0.4:
        assert build_formation(scenario).depth == 3
    elif gap < 0.4 - 1e-9:
        with pytest.raises(ConfigError, match="safety_distance"):
            build_formation(scenario)


def test_drones_above_each_other_are_too_near() -> None:
    drones = [{"id": i, "references": ["human"], "offset": [1.0, 0.0, float(i)]} for i in (1, 2)]
    with pytest.raises(ConfigError, match=r"rest 0\.000 m apart"):
        build_formation(structure_scenario({"formation": {"shape": "custom", "drones": drones}}, "here"))


@pytest.mark.parametrize("name", SHIPPED)
def test_every_scenario_that_ships_builds(name: str) -> None:
    check(build_formation(load_scenario(name)))
