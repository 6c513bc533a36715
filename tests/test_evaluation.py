"""Eq. (10): errors worked out on an arm, a noise floor that is known analytically, and a benchmark that fits or not."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from finger import Finger
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import (
    Benchmark,
    Evaluation,
    beyond,
    contexts_of_goals,
    evaluate,
    load_benchmark,
    save_benchmark,
    tile_goals,
)
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.spaces import Array, Box, stream
from worlds import NO_CONTEXT, Perfect, Sure, executed, problem


def test_errors_are_the_distances_between_goals_and_where_the_best_movements_end() -> None:
    # Two links of .5 m: straight ahead at (1, 0), a first joint at +pi/2 (theta .75) ends at (0, 1).
    arm = PlanarArm(2)
    inverse = NearestNeighbour(problem(memory=executed(arm, np.array([[0.5, 0.5], [0.75, 0.5]]))))
    goals = np.array([[1.0, 0.0], [0.7, 0.4], [0.3, 1.4]])
    evaluation = evaluate(inverse, arm, goals, 0, 1000, repeats=0)
    assert evaluation.errors == pytest.approx([0.0, 0.5, 0.5])
    assert evaluation.mean_error == pytest.approx(1 / 3)
    assert evaluation.outcomes == pytest.approx(np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    assert evaluation.thetas.tolist() == [[0.5, 0.5], [0.5, 0.5], [0.75, 0.5]]


def test_an_evaluation_has_the_errors_that_were_expected_and_none_of_who_does_not_say() -> None:
    arm, goals = PlanarArm(5), stream(0, "goals").uniform(-0.6, 0.6, (4, 2))
    found = evaluate(Sure(arm), arm, goals, 0, 0, repeats=0)
    assert found.errors == pytest.approx(np.zeros(4), abs=1e-9)
    assert found.expected == pytest.approx(np.full(4, 0.5))
    assert np.isnan(evaluate(Perfect(arm), arm, goals, 0, 0, repeats=0).expected).all()


def test_each_goal_has_a_context_of_its_own_the_same_in_every_evaluation_of_every_run() -> None:
    arm, goals = PlanarArm(5, context=True), stream(0, "goals").uniform(-0.6, 0.6, (200, 2))
    inverse = Perfect(arm)
    first = evaluate(inverse, arm, goals, seed=0, step=100, repeats=2)
    assert first.errors == pytest.approx(np.zeros(200), abs=1e-9)  # executed in the context that was asked about
    assert first.contexts.tolist() == inverse.asked
    for seed, step in ((0, 200), (1, 100)):
        later = evaluate(Perfect(arm), arm, goals, seed, step, repeats=0)
        assert np.array_equal(later.contexts, first.contexts)
    assert np.array_equal(contexts_of_goals(arm, 50), first.contexts[:50])  # goal k, whatever their number
    # Uniform in +-pi / 4: mean 0, sd pi / 4 / sqrt(3) = .453; four standard errors of 200 are .13 and .06.
    assert arm.contexts.contains(first.contexts).all()
    assert first.contexts.mean() == pytest.approx(0, abs=0.13)
    assert first.contexts.std() == pytest.approx(0.453, abs=0.06)


def test_a_perfect_inverse_makes_no_error_in_any_context_given_for_all_goals_or_for_each() -> None:
    arm, goals = PlanarArm(5, context=True), stream(0, "goals").uniform(-0.6, 0.6, (4, 2))
    for context in (None, np.array([0.0]), np.array([0.7]), np.array([[0.1], [-0.2], [0.3], [0.0]])):
        found = evaluate(Perfect(arm), arm, goals, 0, 0, context=context, repeats=0)
        assert found.errors == pytest.approx(np.zeros(4), abs=1e-9)
        assert context is None or np.array_equal(found.contexts, np.broadcast_to(context, (4, 1)))


class Remembering(PlanarArm):
    """Its turn is the state in which the last movement has left it."""

    execute_many = None

    def __init__(self) -> None:
        super().__init__(5, context=True)
        self.turn = 0.0

    def observe(self, rng: np.random.Generator) -> Array:
        return np.array([self.turn])

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        outcome = super().execute([self.turn], theta, rng)
        self.turn = float(outcome[0]) / 2
        return outcome


def test_a_context_that_is_the_state_of_the_robot_is_seen_before_each_movement() -> None:
    arm, goals = Remembering(), stream(0, "goals").uniform(-0.6, 0.6, (8, 2))
    found = evaluate(Perfect(arm), arm, goals, 0, 0, repeats=2)
    assert found.errors == pytest.approx(np.zeros(8), abs=1e-9)
    assert found.noise_floor == pytest.approx(0, abs=1e-9)  # repeats are answered in the state that they find, too
    assert len(np.unique(found.contexts)) == 8


def test_movements_are_repeated_in_another_order_so_that_a_robot_with_memory_scatters() -> None:
    finger, goals = Finger(), np.array([[100.0, 40.0], [100.0, -40.0], [130.0, 0.0], [80.0, 0.0]] * 5)
    memory = executed(finger, stream(0, "thetas").random((200, 3)))
    found = evaluate(NearestNeighbour(problem(memory=memory)), finger, goals, 0, 0)
    assert found.noise_floor > 5  # mm; in the same order it would be .6, the noise alone


def test_ctrl_c_is_heard_between_blocks_of_movements_also_if_the_robot_executes_many_together() -> None:
    class Counted(PlanarArm):
        sizes: list[int] = []  # noqa: RUF012

        def execute_many(self, contexts: Array, thetas: Array, rngs: Sequence[np.random.Generator]) -> Array:
            self.sizes.append(len(thetas))
            return super().execute_many(contexts, thetas, rngs)

    def between() -> None:
        if len(arm.sizes) == 2:
            raise KeyboardInterrupt

    arm, goals = Counted(5), stream(0, "goals").uniform(-0.6, 0.6, (300, 2))
    with pytest.raises(KeyboardInterrupt):
        evaluate(Perfect(arm), arm, goals, 0, 0, repeats=2, between=between)
    assert arm.sizes == [128, 128]


def test_without_contexts_an_environment_is_not_asked_for_any() -> None:
    class Silent(PlanarArm):
        def observe(self, rng: np.random.Generator) -> Array:
            raise AssertionError

    found = evaluate(Perfect(PlanarArm(5)), Silent(5), np.array([[0.5, 0.5]]), 0, 0)
    assert found.contexts.shape == (1, 0)


def test_without_repeats_there_is_no_noise_floor_and_without_noise_it_is_zero() -> None:
    arm, goals = PlanarArm(5), np.array([[0.5, 0.5], [-0.3, 0.2]])
    assert np.isnan(evaluate(Perfect(arm), arm, goals, 0, 0, repeats=0).noise_floor)
    assert evaluate(Perfect(arm), arm, goals, 0, 0, repeats=10).noise_floor == pytest.approx(0, abs=1e-15)


@pytest.mark.parametrize("repeats", [2, 3, 10])
def test_the_noise_floor_is_the_mean_distance_to_the_true_mean_however_many_repeats(repeats: int) -> None:
    # Stretched out along y, joint noise s moves the end along x by s times the distances of the joints to the end,
    # 1, .8, .6, .4, .2: sd s sqrt(2.2). Mean distance of a Gaussian: sd sqrt(2 / pi).
    arm = PlanarArm(5, noise=0.001)
    evaluation = evaluate(Perfect(arm), arm, np.tile([0.0, 1.0], (1200, 1)), 0, 0, repeats=repeats)
    expected = 0.001 * np.sqrt(2.2) * np.sqrt(2 / np.pi)
    # Its standard error is at most .76 / sqrt(1200 (repeats - 1)) of it, so five of them are 11, 8 and 4 %.
    assert evaluation.noise_floor == pytest.approx(expected, rel={2: 0.11, 3: 0.08, 10: 0.04}[repeats])
    assert evaluation.mean_error == pytest.approx(expected, rel=5 * 0.76 / np.sqrt(1200))


def test_the_movement_that_is_judged_is_not_one_of_its_own_repeats() -> None:
    arm = PlanarArm(5, noise=0.05)
    seen = evaluate(Perfect(arm), arm, np.array([[0.0, 0.5]]), 0, 0, repeats=2)
    judged, *again = (arm.execute(NO_CONTEXT, seen.thetas[0], stream(0, "evaluation 0", row)) for row in range(3))
    assert np.array_equal(seen.outcomes[0], judged)
    assert seen.scatter[0] == pytest.approx(
        np.sqrt(2) * np.linalg.norm(again[0] - again[1]) / 2
    )  # from two points to their middle


@pytest.mark.parametrize(
    "wrong",
    [
        *({"repeats": repeats} for repeats in (-1, 1, 2.5)),
        {"step": -1},
        *({"goals": goals} for goals in (np.zeros((3, 3)), np.full((3, 2), np.nan), np.zeros(2), np.zeros((0, 2)))),
    ],
)
def test_counts_and_goals_that_are_none_are_refused(wrong: dict[str, object]) -> None:
    arm, right = PlanarArm(5), {"goals": np.array([[0.5, 0.5]]), "seed": 0, "step": 0}
    with pytest.raises(ValueError, match=f"{next(iter(wrong))} must"):
        evaluate(Perfect(arm), arm, **right | wrong)


def test_the_same_streams_give_the_same_and_every_evaluation_of_a_run_has_its_own() -> None:
    arm, goals = PlanarArm(5, noise=0.05), np.array([[0.5, 0.5], [-0.3, 0.2]])

    def look(seed: int, step: int) -> Evaluation:
        return evaluate(Perfect(arm), arm, goals, seed, step, repeats=2)

    first, same, later, other = look(0, 1000), look(0, 1000), look(0, 2000), look(1, 1000)
    assert np.array_equal(first.outcomes, same.outcomes)
    assert np.array_equal(first.scatter, same.scatter)
    assert not np.isclose(first.outcomes, later.outcomes).any()
    assert not np.isclose(first.outcomes, other.outcomes).any()


def test_one_goal_is_drawn_in_each_tile_that_was_reached_twice_and_none_outside_the_task_space() -> None:
    outcomes = np.array([[-0.9, -0.9], [-0.6, -0.6], [0.1, 0.1], [0.9, -0.9], [0.6, -0.6], [1.2, 0.0], [1.3, 0.0]])
    goals = tile_goals(outcomes, Box.cube(-1, 1, 2), 0.5, stream(0, "benchmark"))  # tiles of .5 m, 4 x 4
    assert np.floor((goals + 1) / 0.5).tolist() == [[0, 0], [3, 0]]


def test_goals_are_uniform_in_their_tile_and_come_from_the_stream() -> None:
    box, middle = Box.cube(-1, 1, 2), np.array([[0.1, -0.4]] * 2)
    goals = np.concatenate([tile_goals(middle, box, 0.5, stream(seed, "benchmark")) for seed in range(400)])
    assert np.array_equal(goals[:1], tile_goals(middle, box, 0.5, stream(0, "benchmark")))
    # Of a side of .5: mean .25, sd .144; five standard errors of 400 draws are .036.
    assert goals.mean(axis=0) == pytest.approx([0.25, -0.25], abs=0.036)
    assert goals.std(axis=0) == pytest.approx([0.144, 0.144], abs=0.02)


BENCHMARK = Benchmark("PlanarArm", np.array([[0.5, 0.5], [-0.3, 0.2]]), 0.1)


def test_a_benchmark_is_loaded_as_it_was_saved(tmp_path: Path) -> None:
    save_benchmark(tmp_path / "goals.npz", BENCHMARK)
    loaded = load_benchmark(tmp_path / "goals.npz")
    assert (loaded.environment, loaded.side) == ("PlanarArm", 0.1)
    assert np.array_equal(loaded.goals, BENCHMARK.goals)


IN_CM = Benchmark("PlanarArm", 100 * BENCHMARK.goals, 10.0)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (replace(BENCHMARK, environment="FishingRod"), r"made for the class FishingRod .* got PlanarArm"),
        (replace(BENCHMARK, goals=np.zeros((4, 3))), "3 outcome dimensions"),
        (replace(BENCHMARK, goals=np.full((1, 2), np.nan)), r"entry \[0, 0\] is nan"),
        (IN_CM, r"entry \[0, 0\] is 50.0 \(and 3 more\); were they made for another T"),
    ],
)
def test_a_benchmark_of_another_robot_is_refused(wrong: Benchmark, message: str) -> None:
    BENCHMARK.check(PlanarArm(5))
    IN_CM.check(PlanarArm(5, outcomes=Box.cube(-100, 100, 2)))
    load_benchmark().check(FishingRod(threads=1))
    with pytest.raises(ValueError, match=message):
        wrong.check(PlanarArm(5))


def test_goals_beyond_all_outcomes_are_told_from_goals_among_them():
    rng = stream(0, "outcomes")
    outcomes = rng.uniform(-1, 1, (1000, 2))
    disc = outcomes[np.linalg.norm(outcomes, axis=1) < 0.8]
    goals = rng.uniform(-1, 1, (500, 2))
    radii = np.linalg.norm(goals, axis=1)
    outside = beyond(disc, goals)
    assert outside[radii > 0.9].all()
    assert not outside[radii < 0.78].any()
    assert not beyond(disc[:5], goals).any()  # too few to say
