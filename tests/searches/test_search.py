"""Searches: scipy's Nelder-Mead point for point, remembered outcomes at no cost, and movements that can be counted."""

from collections.abc import Callable, Generator
from functools import partial

import numpy as np
import pytest
from scipy.optimize import minimize, rosen

from sgimd_torch.searches.perturb import perturb, practise
from sgimd_torch.searches.simplex import limit, nelder_mead, simplex_descent
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


@pytest.mark.parametrize("complete", [True, False])
def test_the_simplex_ends_on_the_goal_where_nothing_is_random(complete: bool) -> None:
    world = World(dim=4, k=2)
    executed = world.run(simplex_search(world.policies, rng(), complete=complete))
    assert 5 < len(executed) < 300  # it ended by itself
    assert min(world.distance(theta) for theta in executed) < 1e-3


def searches(policies: Box, rng: np.random.Generator) -> dict[str, Search]:
    return {
        "complete": simplex_search(policies, rng, step=0.5),
        "incomplete": simplex_search(policies, rng, complete=False),
        "adaptive": simplex_search(policies, rng, adaptive=True),
        "noisy": simplex_search(policies, rng, noise=0.5),
        "perturb": perturb(policies, rng, sd=0.5),
        "practise": practise(policies, rng, sd=0.5),
    }


@pytest.mark.parametrize("name", ["complete", "incomplete", "adaptive", "noisy", "perturb", "practise"])
def test_no_search_leaves_the_policy_space_even_from_its_corners_towards_noise(name: str) -> None:
    rng = stream(3, "noise")
    for seed in range(1, 8):
        world = World(dim=5, k=seed, spread=0.3, centre=rng.integers(0, 2, 5).astype(float), seed=seed)
        world.goal = np.array([50.0, -50.0])
        search = searches(world.policies, rng)[name](world.start, world.goal)
        executed = drive(search, lambda theta: 10 * rng.normal(size=2), 200)
        assert world.policies.contains(np.array(executed)).all()


@pytest.mark.parametrize("corner", [0.0, 1.0])
def test_a_simplex_begun_in_a_corner_steps_inwards_and_is_not_flat(corner: float) -> None:
    world = World(dim=5, k=0, centre=np.full(5, corner))
    executed = np.array(world.run(simplex_search(world.policies, rng(), step=0.05), n=6))
    assert np.linalg.matrix_rank(executed[1:] - executed[0], tol=1e-3) == 5
    assert np.sqrt(((executed[1:] - executed[0]) ** 2).mean(axis=1)) == pytest.approx(
        [0.05] * 5
    )  # mirrored, not clipped


def test_wrong_steps_and_noise_are_refused() -> None:
    for step in (0.0, 0.6, np.nan):
        with pytest.raises(ValueError, match="step"):
            simplex_search(Box.cube(0, 1, 2), rng(), step=step)
    for noise in (-0.1, 0.6, np.nan):
        with pytest.raises(ValueError, match="noise"):
            nelder_mead(Box.cube(0, 1, 2), rng(), noise=noise)
    for make in (perturb, practise):
        with pytest.raises(ValueError, match="sd"):
            make(Box.cube(0, 1, 2), stream(0, "search"), sd=0.0)


def test_perturb_executes_a_new_theta_first_but_not_a_remembered_one() -> None:
    world = World(dim=3, k=4)
    search = perturb(world.policies, stream(0, "search"))
    assert np.array_equal(world.run(search, n=1)[0], world.theta)
    world.theta = world.thetas[1]
    assert not (world.run(search, n=1)[0] == world.thetas).all(axis=1).any()


def test_perturb_spreads_by_sd_of_each_side_around_the_best_remembered() -> None:
    policies = Box(np.array([0.0, -100.0]), np.array([1.0, 100.0]))
    thetas = np.array([[0.3, 0.0], [0.5, 0.0]])
    start = Estimate(thetas[0], thetas, np.array([[9.0], [0.0]]))
    search = perturb(policies, stream(0, "search"), sd=0.02)(start, np.zeros(1))
    executed = np.array(drive(search, lambda theta: np.ones(1), 2000))  # nothing improves on the second
    # Standard errors: of the mean sd / 45, of the standard deviation sd / 63; five of them fail once in a million.
    assert executed.mean(axis=0) == pytest.approx([0.5, 0.0], abs=5 * 4 / 45)
    assert executed[:, 0].mean() == pytest.approx(0.5, abs=5 * 0.02 / 45)
    assert executed.std(axis=0) == pytest.approx([0.02, 4.0], rel=5 / 63)


@pytest.mark.parametrize(("theta", "sd"), [((0.3, 5.0), 0.05), ((0.4, 6.0), 0.02)], ids=["a copy", "inferred"])
def test_practise_spreads_around_the_answer_and_farther_where_it_is_a_copy(theta, sd) -> None:
    policies = Box(np.array([0.0, -100.0]), np.array([1.0, 100.0]))
    start = Estimate(np.array(theta), np.array([[0.3, 5.0], [0.5, 0.0]]), np.array([[9.0], [0.0]]))
    executed = np.array(
        drive(practise(policies, stream(0, "search"))(start, np.zeros(1)), lambda theta: theta[:1], 2000)
    )
    assert (executed.mean(axis=0) - theta) / (sd * policies.sides) == pytest.approx([0, 0], abs=5 / 45)
    assert executed.std(axis=0) / policies.sides == pytest.approx([sd, sd], rel=5 / 63)


def test_perturb_follows_the_best_it_has_executed() -> None:
    world = World(dim=3, k=2)
    executed = world.run(perturb(world.policies, stream(0, "search"), sd=1e-6), n=50)
    for i in range(1, 50):
        so_far = min((*executed[:i], *world.thetas), key=world.distance)
        assert np.linalg.norm(executed[i] - so_far) < 1e-5
    assert world.distance(executed[-1]) < world.distance(executed[0])


class Diary:
    """An attempt of 100 movements that notes the outcomes it is sent and how often it ended."""

    def __init__(self) -> None:
        self.outcomes: list[float] = []
        self.n_ended = 0

    def attempt(self) -> Generator[Array, Array, None]:
        try:
            for i in range(100):
                outcome = yield np.array([float(i)])
                self.outcomes.append(float(outcome[0]))
        finally:
            self.n_ended += 1


def tenfold(movement: Array) -> Array:
    return 10 * movement


@pytest.mark.parametrize("n", [1, 2, 30, 100, 101])
def test_limit_stops_after_exactly_n_movements_and_passes_every_outcome_on(n: int) -> None:
    diary = Diary()
    attempt = diary.attempt()  # kept: Python would close it otherwise
    movements = drive(limit(attempt, n), tenfold)
    expected = np.arange(min(n, 100.0))
    assert np.array_equal(np.ravel(movements), expected)
    assert np.array_equal(diary.outcomes, 10 * expected)
    assert diary.n_ended == 1


def test_closing_a_limited_attempt_ends_the_attempt_at_once() -> None:
    diary = Diary()
    attempt = diary.attempt()  # kept: Python would close it otherwise
    limited = limit(attempt, 30)
    next(limited)
    limited.send(np.array([5.0]))
    assert diary.n_ended == 0
    limited.close()
    assert diary.n_ended == 1
    assert diary.outcomes == [5.0]


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


def test_the_noise_is_in_sides_of_the_policy_space_and_reaches_every_parameter() -> None:
    policies, draw = Box(np.array([0.0, -100.0]), np.array([1.0, 100.0])), rng()
    start = Estimate(np.array([0.5, 0.0]), np.empty((0, 2)), np.empty((0, 2)))
    search = nelder_mead(policies, draw)
    thetas = np.array([next(search(start, np.zeros(2))) for _ in range(2000)])
    # Standard errors: of the mean sd / 45, of the standard deviation sd / 63; five of them.
    assert (thetas.mean(axis=0) / [1, 200]) == pytest.approx([0.5, 0.0], abs=5 * 0.05 / 45)
    assert thetas.std(axis=0) == pytest.approx([0.05, 10.0], rel=5 / 63)


def test_the_noise_comes_from_the_stream_and_without_noise_nothing_is_drawn() -> None:
    world, draw = World(dim=6, k=2), rng()
    search = partial(nelder_mead, world.policies, xatol=1e-4, fatol=1e-4)  # so that no neighbour is too near
    first, same, other = (np.array(world.run(search(stream(seed, "search")), n=6)) for seed in (1, 1, 2))
    assert np.array_equal(first, same)
    assert not np.isclose(first[0], other[0]).any()
    state = draw.bit_generator.state
    exact = np.array(world.run(search(draw, noise=0.0), n=6))
    assert np.array_equal(exact[0], world.theta)
    assert draw.bit_generator.state == state
