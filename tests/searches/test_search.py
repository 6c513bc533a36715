"""Searches: scipy's Nelder-Mead point for point, remembered outcomes at no cost, and what all of them promise."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from scipy.optimize import minimize, rosen

from sgimd_torch.searches.cma_es import cma_es
from sgimd_torch.searches.perturb import perturb, practise
from sgimd_torch.searches.simplex import nelder_mead, simplex_descent
from sgimd_torch.spaces import Array, Box, Estimate, Search, stream
from worlds import drive


def rough(x: Array) -> float:
    """A bowl full of pits, where simplices shrink."""
    return float((x**2).sum() + 0.3 * np.abs(np.sin(40 * x)).sum())


@pytest.mark.parametrize("adaptive", [False, True])
@pytest.mark.parametrize("bounded", [False, True])
@pytest.mark.parametrize("function", [rosen, rough])
@pytest.mark.parametrize("dim", [2, 5, 25])
def test_the_simplex_visits_the_same_points_as_scipy(
    dim: int, function: Callable[[Array], float], bounded: bool, adaptive: bool
) -> None:
    simplex = stream(dim, "simplex").uniform(-0.9, 0.4, (dim + 1, dim))
    box = Box.cube(-1, 0.5, dim) if bounded else None  # keeps the minimum of rosen, at 1, outside
    visited: list[Array] = []

    def recorded(x: Array) -> float:
        visited.append(x.copy())
        return function(x)

    minimize(
        recorded,
        simplex[0],
        method="Nelder-Mead",
        bounds=list(zip(box.low, box.high, strict=True)) if box else None,
        options={"initial_simplex": simplex, "adaptive": adaptive, "maxfev": 2000, "maxiter": np.inf},
    )
    values = np.array([function(x) for x in simplex])
    descent = simplex_descent(simplex, values, place=box.clip if box else None, adaptive=adaptive)
    ours = drive(descent, function, 2000 - len(simplex))
    assert np.array_equal(np.array(ours), np.array(visited[dim + 1 :]))
    assert len(ours) > 20


def test_the_simplex_changes_neither_its_arguments_nor_what_it_has_proposed() -> None:
    simplex, values = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), np.array([0.0, 1.0, 1.0])
    before = simplex.copy(), values.copy()
    proposed: list[Array] = []

    def execute(x: Array) -> float:
        proposed.append(x)
        return rough(x)

    copies = drive(simplex_descent(simplex, values), execute)
    assert np.array_equal(simplex, before[0])
    assert np.array_equal(values, before[1])
    assert np.array_equal(proposed, copies)


class World:
    """Linear outcomes of unit-cube movements, and an estimate from ``k`` neighbours ``spread`` around a centre."""

    def __init__(self, dim: int, k: int, *, spread: float = 0.1, centre: Array | None = None, seed: int = 0) -> None:
        rng = stream(seed, "world")
        self.policies = Box.cube(0, 1, dim)
        self.jacobian = rng.normal(size=(dim, 2))
        self.theta = np.full(dim, 0.5) if centre is None else centre
        self.thetas = self.policies.clip(self.theta + rng.uniform(-spread, spread, (k, dim)))
        self.goal = self.execute(self.theta) + np.array([0.12, -0.07])

    def execute(self, theta: Array) -> Array:
        return theta @ self.jacobian

    def distance(self, theta: Array) -> float:
        return float(np.linalg.norm(self.execute(theta) - self.goal))

    @property
    def start(self) -> Estimate:
        return Estimate(self.theta, self.thetas, self.execute(self.thetas))

    def run(self, search: Search, n: int = 10_000) -> list[Array]:
        return drive(search(self.start, self.goal), self.execute, n)


def rng() -> np.random.Generator:
    return stream(0, "search")


simplex_search = partial(nelder_mead, noise=0.0, step=0.05, complete=True, adaptive=False, xatol=1e-4, fatol=1e-4)


def reflection(world: World, vertices: Array) -> Array:
    """The worst vertex mirrored at the mean of the others."""
    order = np.argsort([world.distance(vertex) for vertex in vertices])
    return 2 * vertices[order[:-1]].mean(axis=0) - vertices[order[-1]]


def test_remembered_outcomes_are_used_as_they_are_and_not_executed_again() -> None:
    world = World(dim=6, k=6)
    lucky = world.execute(world.thetas)
    lucky[2] = world.goal + 10  # what memory says of the third, though it would now land elsewhere
    search = simplex_search(world.policies, rng())(Estimate(world.theta, world.thetas, lucky), world.goal)
    executed = drive(search, world.execute, 30)
    others = np.vstack((world.theta, np.delete(world.thetas, 2, axis=0)))
    assert executed[1] == pytest.approx(2 * others.mean(axis=0) - world.thetas[2])
    assert not any((theta == world.thetas).all(axis=1).any() for theta in executed)


def test_missing_neighbours_are_replaced_by_random_steps_at_right_angles_to_a_simplex_that_is_not_flat() -> None:
    world = World(dim=6, k=3)
    executed = np.array(world.run(simplex_search(world.policies, rng(), step=0.04), n=5))
    steps = executed[1:4] - world.theta
    assert np.sqrt((steps**2).mean(axis=1)) == pytest.approx([0.04] * 3)
    assert np.count_nonzero(steps) == 18  # no coordinate stands still
    edges = np.vstack((world.thetas - world.theta, steps))
    assert edges @ steps.T == pytest.approx(np.vstack((np.zeros((3, 3)), 6 * 0.04**2 * np.eye(3))))
    assert executed[4] == pytest.approx(reflection(world, np.vstack((executed[:4], world.thetas))))


def test_neighbours_that_would_flatten_the_simplex_are_left_out_the_worst_first() -> None:
    world = World(dim=5, k=3)
    world.theta = np.array([0.5, 0.3, 0.2]) @ world.thetas  # a mean, as the inverse model makes it: one is redundant
    world.thetas = np.array(sorted(world.thetas, key=world.distance, reverse=True))
    executed = world.run(simplex_search(world.policies, rng(), complete=False), n=2)
    assert executed[1] == pytest.approx(reflection(world, np.vstack((world.theta, world.thetas[1:]))))


def test_neighbours_nearly_on_a_line_or_nearly_at_its_origin_make_no_vertex() -> None:
    world = World(dim=3, k=1)
    edge = world.thetas[0] - world.theta
    askew = world.theta - 0.9 * edge + 0.05 * np.cross(edge, [0, 0, 1])
    beside = world.theta + np.array([0, 0, 1e-6])
    alone = world.run(simplex_search(world.policies, rng()), n=5)
    world.thetas = np.vstack((world.thetas, askew, beside))
    world.goal = world.execute(world.thetas[0])  # so that the best neighbour is the one that was alone
    assert np.array_equal(world.run(simplex_search(world.policies, rng()), n=3), alone[:3])


def test_an_incomplete_simplex_stays_in_the_flat_of_its_vertices_and_still_meets_the_goal() -> None:
    world = World(dim=25, k=4)
    executed = np.array(world.run(simplex_search(world.policies, rng(), complete=False), n=80))
    flat = np.linalg.qr((world.thetas - world.theta).T)[0]
    edges = executed - world.theta
    assert np.abs(edges - edges @ flat @ flat.T).max() < 1e-12
    assert min(world.distance(theta) for theta in executed) < 1e-3


def test_the_simplex_ends_on_the_goal_where_nothing_is_random() -> None:
    world = World(dim=4, k=2)
    executed = world.run(simplex_search(world.policies, rng()))
    assert 5 < len(executed) < 300  # it ended by itself
    assert min(world.distance(theta) for theta in executed) < 1e-3


SEARCHES = {
    "complete": partial(simplex_search, step=0.5),
    "incomplete": partial(simplex_search, complete=False),
    "adaptive": partial(simplex_search, adaptive=True),
    "noisy": partial(nelder_mead, noise=0.5),
    "perturb": partial(perturb, sd=0.5),
    "practise": partial(practise, sd=0.5),
    "cma-es": partial(cma_es, sd=0.5),
}
every_search = pytest.mark.parametrize("make", SEARCHES.values(), ids=SEARCHES)


@every_search
def test_no_search_leaves_the_policy_space_even_from_its_corners_towards_noise(make) -> None:
    rng = stream(3, "noise")
    for seed in range(1, 8):
        world = World(dim=5, k=seed, spread=0.3, centre=rng.integers(0, 2, 5).astype(float), seed=seed)
        search = make(world.policies, rng)(world.start, np.array([50.0, -50.0]))
        executed = drive(search, lambda theta: 10 * rng.normal(size=2), 200)
        assert world.policies.contains(np.array(executed)).all()


@every_search
def test_movements_come_from_the_stream_alone(make) -> None:
    world, numpy_state = World(dim=6, k=1), str(np.random.get_state())  # noqa: NPY002 - nobody may touch it
    first, same, other = (world.run(make(world.policies, stream(seed, "search")), n=6) for seed in (1, 1, 2))
    assert np.array_equal(first, same)
    assert not np.isclose(first[1:], other[1:]).all(axis=1).any()
    assert str(np.random.get_state()) == numpy_state  # noqa: NPY002


@every_search
def test_an_estimate_outside_of_the_policy_space_is_refused(make) -> None:
    outside = Estimate(np.array([1.5, 0.5]), np.zeros((1, 2)), np.zeros((1, 2)))
    with pytest.raises(ValueError, match="theta of the estimate must lie in"):
        next(make(Box.cube(0, 1, 2), rng())(outside, np.zeros(2)))


@pytest.mark.parametrize(
    ("make", "options"),
    [
        *((nelder_mead, {"step": step}) for step in (0.0, 0.6, np.nan)),
        *((nelder_mead, {"noise": noise}) for noise in (-0.1, 0.6, np.nan)),
        *((make, {"sd": 0.0}) for make in (perturb, practise)),
        *((cma_es, {"sd": sd}) for sd in (0.0, np.nan, np.inf)),
        (cma_es, {"population": 2}),
    ],
)
def test_numbers_out_of_range_are_refused(make, options) -> None:
    with pytest.raises(ValueError, match=next(iter(options))):
        make(Box.cube(0, 1, 2), rng(), **options)


COPY, INFERRED = (0.3, 5.0), (0.4, 6.0)


@pytest.mark.parametrize(
    ("make", "theta", "mean", "sd", "n"),
    [
        (nelder_mead, INFERRED, INFERRED, 0.05, 2000),
        (perturb, COPY, (0.5, 0.0), 0.05, 2000),  # around the best remembered
        (partial(perturb, sd=0.02), COPY, (0.5, 0.0), 0.02, 2000),
        (practise, INFERRED, INFERRED, 0.02, 2000),
        (practise, COPY, COPY, 0.05, 2000),
        (partial(cma_es, sd=0.02), INFERRED, INFERRED, 0.02, 200),
    ],
)
def test_what_is_varied_spreads_by_sd_of_each_side(make, theta, mean, sd, n) -> None:
    """Of the first movement that is not theta_g itself."""
    policies, draw = Box(np.array([0.0, -100.0]), np.array([1.0, 100.0])), rng()
    start = Estimate(np.array(theta), np.array([COPY, (0.5, 0.0)]), np.array([[9.0], [0.0]]))
    found = np.array([drive(make(policies, draw)(start, np.zeros(1)), lambda x: x[:1], 2) for _ in range(n)])
    varied = found[:, int((found[0, 0] == theta).all())]
    # Five standard errors: of the mean sd / sqrt(n), of the standard deviation sd / sqrt(2 n).
    assert (varied.mean(axis=0) - mean) / (sd * policies.sides) == pytest.approx([0, 0], abs=5 / np.sqrt(n))
    assert varied.std(axis=0) / policies.sides == pytest.approx([sd, sd], rel=5 / np.sqrt(2 * n))


@pytest.mark.parametrize("corner", [0.0, 1.0])
def test_a_simplex_begun_in_a_corner_steps_inwards_and_is_not_flat(corner: float) -> None:
    world = World(dim=5, k=0, centre=np.full(5, corner))
    executed = np.array(world.run(simplex_search(world.policies, rng(), step=0.05), n=6))
    assert np.linalg.matrix_rank(executed[1:] - executed[0], tol=1e-3) == 5
    assert np.sqrt(((executed[1:] - executed[0]) ** 2).mean(axis=1)) == pytest.approx(
        [0.05] * 5
    )  # mirrored, not clipped


def test_perturb_executes_a_new_theta_first_but_not_a_remembered_one() -> None:
    world = World(dim=3, k=4)
    search = perturb(world.policies, stream(0, "search"))
    assert np.array_equal(world.run(search, n=1)[0], world.theta)
    world.theta = world.thetas[1]
    assert not (world.run(search, n=1)[0] == world.thetas).all(axis=1).any()


def test_perturb_follows_the_best_it_has_executed() -> None:
    world = World(dim=3, k=2)
    executed = world.run(perturb(world.policies, stream(0, "search"), sd=1e-6), n=50)
    for i in range(1, 50):
        so_far = min((*executed[:i], *world.thetas), key=world.distance)
        assert np.linalg.norm(executed[i] - so_far) < 1e-5
    assert world.distance(executed[-1]) < world.distance(executed[0])


def test_in_a_corner_of_a_small_box_the_simplex_is_not_flat() -> None:
    policies = Box.cube(0, 1, 2)
    theta, neighbour = np.array([0.95, 0.05]), np.array([0.45, 0.55])  # mirroring in this corner leads along their line
    for seed in range(50):
        search = nelder_mead(policies, stream(seed, "search"), noise=0.0, step=0.1, xatol=1e-4)
        estimate = Estimate(theta, neighbour[None], np.array([[0.0, 1.0]]))
        executed = drive(search(estimate, np.zeros(2)), lambda x: x, 2)
        edges = np.array([neighbour, executed[1]]) - theta
        assert abs(np.linalg.det(edges)) > 1e-4


def noise_of(world: World, noise: float, seed: int, n: int) -> Array:
    """Where ``n`` movements went, less where the exact simplex would have gone from where those before them went."""
    search = nelder_mead(world.policies, stream(seed, "search"), noise=noise, xatol=1e-4, fatol=1e-4)
    executed = world.run(search, n)
    assert world.policies.contains(np.array(executed)).all()
    differences, later = [executed[0] - world.theta], iter(executed[1:])

    def place(theta: Array) -> Array:
        went = next(later)
        differences.append(went - theta)
        return went

    vertices = np.vstack((executed[0], world.thetas))
    values = np.array([world.distance(vertex) for vertex in vertices])
    descent = simplex_descent(vertices, values, place=place, xatol=1e-4, fatol=1e-4)
    replayed = drive(descent, world.distance, n - 2)  # the next is placed, too
    assert np.array_equal(replayed, executed[1 : n - 1])
    return np.array(differences)


def test_every_movement_goes_beside_the_exact_simplex_by_the_noise_and_its_vertex_is_where_it_went() -> None:
    differences = np.stack([noise_of(World(dim=6, k=2), 0.02, seed, 25) for seed in range(40)])
    assert differences.shape == (40, 25, 6)
    # 6000 values: standard error of the mean sd / 77, of the standard deviation sd / 110; five of them.
    assert differences.mean() == pytest.approx(0, abs=5 * 0.02 / 77)
    assert differences.std() == pytest.approx(0.02, rel=5 / 110)
    assert differences.std(axis=(0, 2)) == pytest.approx(np.full(25, 0.02), rel=5 / 22)  # at every movement, of 240


def test_without_noise_the_simplex_draws_nothing() -> None:
    world, draw = World(dim=6, k=2), rng()
    state = draw.bit_generator.state
    executed = world.run(nelder_mead(world.policies, draw, noise=0.0, xatol=1e-4, fatol=1e-4), n=6)
    assert np.array_equal(executed[0], world.theta)
    assert draw.bit_generator.state == state


def test_cma_es_executes_theta_of_the_estimate_first_and_ends_where_all_movements_have_the_same_outcome() -> None:
    world = World(dim=25, k=1)
    world.jacobian = np.zeros((25, 2))
    executed = world.run(cma_es(world.policies, rng()), 500)
    assert np.array_equal(executed[0], world.theta)
    assert len(executed) < 20


def test_within_the_budget_of_a_goal_small_generations_of_cma_es_come_nearer_than_those_of_the_package() -> None:
    def left(population: int | None) -> float:
        found = []
        for seed in range(30):
            world = World(dim=25, k=1, seed=seed)
            world.goal = world.execute(world.theta) + stream(seed, "goal").normal(0, 0.5, 2)
            executed = world.run(cma_es(world.policies, stream(seed, "search"), population=population), 15)
            found.append(min(map(world.distance, executed)) / world.distance(world.theta))
        return float(np.mean(found))

    # 150 worlds gave .32 of the first distance, and .48 with the package's 13 movements.
    assert left(4) < min(0.4, left(None) - 0.1)


def test_cma_es_writes_nothing_and_takes_no_orders(tmp_path, monkeypatch, capfd) -> None:
    monkeypatch.chdir(tmp_path)
    world = World(dim=25, k=1)
    first = world.run(cma_es(world.policies, rng()), 40)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "cma_signals.in").write_text("{'maxfevals': 1}")  # by which the package would take orders
    assert np.array_equal(world.run(cma_es(world.policies, rng()), 40), first)
    assert capfd.readouterr() == ("", "")


def test_cma_es_needs_covariances_to_adapt() -> None:
    with pytest.raises(ValueError, match="2 dimensions or more"):
        cma_es(Box.cube(0, 1, 1), rng())
