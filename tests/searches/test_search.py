"""Searches: scipy's Nelder-Mead point for point, remembered outcomes at no cost, and what all of them promise."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from scipy.optimize import minimize, rosen

from sgimd_torch.options.catalogue import WORDS
from sgimd_torch.options.signature import options_of
from sgimd_torch.searches.explore import Returning
from sgimd_torch.searches.perturb import Perturb
from sgimd_torch.searches.simplex import NelderMead, simplex_descent
from sgimd_torch.searches.vary import Vary
from sgimd_torch.spaces import Array, Box, Estimate, stream
from worlds import World, drive, part, problem


def rough(x: Array) -> float:
    """A bowl full of pits, where simplices shrink."""
    return float((x**2).sum() + 0.3 * np.abs(np.sin(40 * x)).sum())


@pytest.mark.parametrize("bounded", [False, True])
@pytest.mark.parametrize("function", [rosen, rough])
@pytest.mark.parametrize("dim", [2, 5, 25])
def test_the_simplex_visits_the_same_points_as_scipy(
    dim: int, function: Callable[[Array], float], bounded: bool
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
        options={"initial_simplex": simplex, "maxfev": 2000, "maxiter": np.inf},
    )
    values = np.array([function(x) for x in simplex])
    descent = simplex_descent(simplex, values, allow=box.clip if box else None)
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


simplex_search = partial(NelderMead, noise=0.0, step=0.05, complete=True, xatol=1e-4, fatol=1e-4)


def reflection(world: World, vertices: Array) -> Array:
    """The worst vertex mirrored at the mean of the others."""
    order = np.argsort([world.distance(vertex) for vertex in vertices])
    return 2 * vertices[order[:-1]].mean(axis=0) - vertices[order[-1]]


def test_remembered_outcomes_are_used_as_they_are_and_not_executed_again() -> None:
    world = World(dim=6, k=6)
    lucky = world.execute(world.thetas)
    lucky[2] = world.goal + 10  # what memory says of the third, though it would now land elsewhere
    search = simplex_search(world.problem())(Estimate(world.theta, world.thetas, lucky), world.goal)
    executed = drive(search, world.execute, 30)
    others = np.vstack((world.theta, np.delete(world.thetas, 2, axis=0)))
    assert executed[1] == pytest.approx(2 * others.mean(axis=0) - world.thetas[2])
    assert not any((theta == world.thetas).all(axis=1).any() for theta in executed)


def test_missing_neighbours_are_replaced_by_random_steps_at_right_angles_to_a_simplex_that_is_not_flat() -> None:
    world = World(dim=6, k=3)
    executed = np.array(world.run(simplex_search(world.problem(), step=0.04), n=5))
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
    executed = world.run(simplex_search(world.problem(), complete=False), n=2)
    assert executed[1] == pytest.approx(reflection(world, np.vstack((world.theta, world.thetas[1:]))))


def test_neighbours_nearly_on_a_line_or_nearly_at_its_origin_make_no_vertex() -> None:
    world = World(dim=3, k=1)
    edge = world.thetas[0] - world.theta
    askew = world.theta - 0.9 * edge + 0.05 * np.cross(edge, [0, 0, 1])
    beside = world.theta + np.array([0, 0, 1e-6])
    alone = world.run(simplex_search(world.problem()), n=5)
    world.thetas = np.vstack((world.thetas, askew, beside))
    world.goal = world.execute(world.thetas[0])  # so that the best neighbour is the one that was alone
    assert np.array_equal(world.run(simplex_search(world.problem()), n=3), alone[:3])


def test_an_incomplete_simplex_stays_in_the_flat_of_its_vertices_and_still_meets_the_goal() -> None:
    world = World(dim=25, k=4)
    executed = np.array(world.run(simplex_search(world.problem(), complete=False), n=80))
    flat = np.linalg.qr((world.thetas - world.theta).T)[0]
    edges = executed - world.theta
    assert np.abs(edges - edges @ flat @ flat.T).max() < 1e-12
    assert min(world.distance(theta) for theta in executed) < 1e-3


@pytest.fixture(params=WORDS["search"])
def make(request):
    """Every search, as wide as it can be; those through a forward model before it is trusted."""
    search = part("search", request.param)
    return partial(search, **dict.fromkeys({"noise", "step", "sd"} & options_of(search).keys(), 0.5))


def test_no_search_leaves_the_policy_space_even_from_its_corners_towards_noise(make) -> None:
    rng = stream(3, "noise")
    for seed in range(1, 8):
        world = World(dim=5, k=seed, spread=0.3, centre=rng.integers(0, 2, 5).astype(float), seed=seed)
        search = make(world.problem(seed))(world.start, np.array([50.0, -50.0]))
        executed = drive(search, lambda theta: 10 * rng.normal(size=2), 200)
        assert world.policies.contains(np.array(executed)).all()


def test_movements_come_from_the_stream_alone(make) -> None:
    world, numpy_state = World(dim=6, k=1), str(np.random.get_state())  # noqa: NPY002 - nobody may touch it
    first, same, other = (world.run(make(world.problem(seed)), n=6) for seed in (1, 1, 2))
    assert np.array_equal(first, same)
    assert not np.isclose(first[1:], other[1:]).all(axis=1).any()
    assert str(np.random.get_state()) == numpy_state  # noqa: NPY002


def test_an_estimate_outside_of_the_policy_space_is_refused(make) -> None:
    outside = Estimate(np.array([1.5, 0.5]), np.zeros((1, 2)), np.zeros((1, 2)))
    with pytest.raises(ValueError, match="theta of the estimate must lie in"):
        next(make(problem(policies=Box.cube(0, 1, 2)))(outside, np.zeros(2)))


@pytest.mark.parametrize(
    ("make", "options"),
    [
        *((NelderMead, {"step": step}) for step in (0.0, 0.6, np.nan)),
        *((NelderMead, {"noise": noise}) for noise in (-0.1, 0.6, np.nan)),
        *((make, {"sd": sd}) for make in (Perturb, Vary) for sd in (0.0, np.nan)),
        (Returning, {"first": -1}),
    ],
)
def test_numbers_out_of_range_are_refused(make, options) -> None:
    with pytest.raises(ValueError, match=next(iter(options))):
        make(problem(), **options)


COPY, INFERRED = (0.3, 5.0), (0.4, 6.0)


@pytest.mark.parametrize(
    ("make", "theta", "mean", "sd"),
    [
        (NelderMead, INFERRED, INFERRED, 0.05),
        (Perturb, COPY, (0.5, 0.0), 0.05),  # around the best remembered
        (partial(Perturb, sd=0.02), COPY, (0.5, 0.0), 0.02),
        (Vary, INFERRED, INFERRED, 0.03),
        (Vary, COPY, COPY, 0.03),
    ],
)
def test_what_is_varied_spreads_by_sd_of_each_side(make, theta, mean, sd) -> None:
    policies, n = Box(np.array([0.0, -100.0]), np.array([1.0, 100.0])), 2000
    start = Estimate(np.array(theta), np.array([COPY, (0.5, 0.0)]), np.array([[9.0], [0.0]]))
    search = make(problem(policies=policies))
    varied = np.array([next(search(start, np.zeros(1))) for _ in range(n)])
    # Five standard errors: of the mean sd / sqrt(n), of the standard deviation sd / sqrt(2 n).
    assert (varied.mean(axis=0) - mean) / (sd * policies.sides) == pytest.approx([0, 0], abs=5 / np.sqrt(n))
    assert varied.std(axis=0) / policies.sides == pytest.approx([sd, sd], rel=5 / np.sqrt(2 * n))


class Right(Box):
    """Movements of which the left half would hit something."""

    def allows(self, point: Array) -> bool:
        return bool(point[0] > 0.5)


def test_variations_widen_until_pi_allows_one_and_stay_narrow_where_it_does() -> None:
    policies = Right(np.zeros(2), np.ones(2))
    search = Vary(problem(policies=policies))
    for first, widest in ((0.2, 1.0), (0.8, 0.2)):
        start = Estimate(np.array([first, 0.5]), np.zeros((1, 2)), np.zeros((1, 1)))
        varied = np.array([next(search(start, np.zeros(1))) for _ in range(200)])
        assert np.mean(varied[:, 0] > 0.5) > 0.98
        assert np.abs(varied - start.theta).max() <= widest


@pytest.mark.parametrize("corner", [0.0, 1.0])
def test_a_simplex_begun_in_a_corner_steps_inwards_and_is_not_flat(corner: float) -> None:
    world = World(dim=5, k=0, centre=np.full(5, corner))
    executed = np.array(world.run(simplex_search(world.problem(), step=0.05), n=6))
    assert np.linalg.matrix_rank(executed[1:] - executed[0], tol=1e-3) == 5
    assert np.sqrt(((executed[1:] - executed[0]) ** 2).mean(axis=1)) == pytest.approx(
        [0.05] * 5
    )  # mirrored, not clipped


def test_perturb_executes_a_new_theta_first_and_then_varies_the_best_so_far() -> None:
    world = World(dim=3, k=2)
    executed = world.run(Perturb(world.problem(), sd=1e-6), n=50)
    assert np.array_equal(executed[0], world.theta)
    for i in range(1, 50):
        best = min((*executed[:i], *world.thetas), key=world.distance)
        assert np.linalg.norm(executed[i] - best) < 1e-5
    assert world.distance(executed[-1]) < world.distance(executed[0])
    world.theta = world.thetas[1]  # remembered, so its outcome is known
    assert not (world.run(Perturb(world.problem()), n=1)[0] == world.thetas).all(axis=1).any()


def test_in_a_corner_of_a_small_box_the_simplex_is_not_flat() -> None:
    policies = Box.cube(0, 1, 2)
    theta, neighbour = np.array([0.95, 0.05]), np.array([0.45, 0.55])  # mirroring in this corner leads along their line
    for seed in range(50):
        search = NelderMead(problem(policies=policies, seed=seed), noise=0.0, step=0.1, xatol=1e-4)
        estimate = Estimate(theta, neighbour[None], np.array([[0.0, 1.0]]))
        executed = drive(search(estimate, np.zeros(2)), lambda x: x, 2)
        edges = np.array([neighbour, executed[1]]) - theta
        assert abs(np.linalg.det(edges)) > 1e-4


def noise_of(world: World, noise: float, seed: int, n: int) -> Array:
    """Where ``n`` movements went, less where the exact simplex would have gone from where those before them went."""
    search = NelderMead(world.problem(seed), noise=noise, xatol=1e-4, fatol=1e-4)
    executed = world.run(search, n)
    assert world.policies.contains(np.array(executed)).all()
    differences, later = [executed[0] - world.theta], iter(executed[1:])

    def place(theta: Array) -> Array:
        went = next(later)
        differences.append(went - theta)
        return went

    vertices = np.vstack((executed[0], world.thetas))
    values = np.array([world.distance(vertex) for vertex in vertices])
    descent = simplex_descent(vertices, values, allow=place, xatol=1e-4, fatol=1e-4)
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
    world = World(dim=6, k=2)
    search = simplex_search(world.problem(), complete=False)
    state = search.rng.bit_generator.state
    executed = world.run(search, n=6)
    assert np.array_equal(executed[0], world.theta)
    assert search.rng.bit_generator.state == state
