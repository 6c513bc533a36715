"""The main loop: five learners, exact counts, independent streams, and replays that execute nothing."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from sgimd_torch.algorithms.paper import sagg_riac, sgim_d
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import evaluate
from sgimd_torch.inverses.local import LocalInverse
from sgimd_torch.record import Record
from sgimd_torch.record.replay import load_life, save_life
from sgimd_torch.session import run
from sgimd_torch.spaces import Array, Episode, stream
from sgimd_torch.teachers import InitialTeacher, PeriodicTeacher
from worlds import ALGORITHMS, TAUGHT, ArmThat, demonstrations, last_posture, make

every_algorithm = pytest.mark.parametrize("name", ALGORITHMS)


def teacher_of(arm: PlanarArm, every: int = 30) -> PeriodicTeacher:
    return PeriodicTeacher(demonstrations(arm), stream(0, "teacher"), every=every)


def life(
    name: str, arm: PlanarArm, movements: int = 200, seed: int = 0, *, every: int = 30, **options: object
) -> list[Episode]:
    teacher = teacher_of(arm, every) if name in TAUGHT else None
    return list(run(make(name, arm, seed), arm, seed, movements=movements, teacher=teacher, **options))


def summary(episodes: Sequence[Episode]) -> list[tuple[object, ...]]:
    return [
        (e.index, e.context.tobytes(), e.move and e.move.theta.tobytes(), e.outcome is not None and e.outcome.tobytes())
        for e in episodes
    ]


@every_algorithm
def test_a_run_has_exactly_as_many_movements_as_asked_for(name: str) -> None:
    arm = PlanarArm(5, noise=0.01)
    learner = make(name, arm)
    teacher = teacher_of(arm) if name in TAUGHT else None
    episodes = list(run(learner, arm, 0, movements=200, teacher=teacher))
    assert [episode.index for episode in episodes] == list(range(200))
    n_executed = sum(episode.move is not None for episode in episodes)
    assert n_executed == {"observation": 0, "imitation": 170}.get(name, 200)  # imitation rests before its first lesson
    assert len(learner.memory) == (6 if name == "observation" else n_executed)
    executed = np.array([episode.outcome for episode in episodes if episode.move is not None]).reshape(-1, 2)
    if name != "observation":
        assert np.array_equal(learner.memory.outcomes, executed)


@every_algorithm
def test_evaluating_does_not_disturb_learning(name: str) -> None:
    def watched(every: int | None) -> list[tuple[object, ...]]:
        arm = PlanarArm(5, noise=0.01)
        learner = make(name, arm)
        teacher = teacher_of(arm) if name in TAUGHT else None
        episodes = []
        for episode in run(learner, arm, 0, movements=150, teacher=teacher):
            episodes.append(episode)
            if every and (episode.index + 1) % every == 0 and len(learner.memory):
                evaluate(LocalInverse(learner.problem), arm, np.eye(2) / 2, 0, episode.index + 1, repeats=3)
        return summary(episodes)

    assert watched(every=None) == watched(every=10)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Of an empty record of five joints."""
    Record.make(tmp_path / "life.sqlite", (0, 5, 2), {}).close()
    return tmp_path / "life.sqlite"


def recorded(path: Path, name: str, arm: PlanarArm, movements: int, seed: int = 0) -> list[Episode]:
    """A life that goes on with what ``path`` holds."""
    with Record(path, write=True) as record:
        episodes = life(name, arm, movements, seed, record=record)
        record.commit()
    return episodes


@every_algorithm
def test_a_run_resumed_from_its_record_executes_the_rest_alone(name: str, path: Path) -> None:
    arm = ArmThat(lambda n, rng: None, noise=0.01)
    recorded(path, name, arm, 37)
    arm.calls = 0
    teacher_of(arm)
    n_for_the_teacher = arm.calls if name in TAUGHT else 0
    arm.calls = 0
    resumed, whole = recorded(path, name, arm, 100), life(name, PlanarArm(5, noise=0.01), 100)
    assert arm.calls == n_for_the_teacher + sum(e.move is not None for e in whole[37:])
    assert summary(resumed) == summary(whole)


@every_algorithm
def test_a_movement_has_the_noise_of_its_number_whatever_was_done_before_it(name: str) -> None:
    drawn: list[float] = []
    arm = ArmThat(lambda n, rng: drawn.append(rng.random()), noise=0.05)
    teacher = teacher_of(PlanarArm(5), 20) if name in TAUGHT else None
    episodes = list(run(make(name, arm), arm, 0, movements=60, teacher=teacher))
    executed = [episode.index for episode in episodes if episode.move is not None]
    assert drawn == [stream(0, "environment", index).random() for index in executed]


def test_sgim_d_without_a_teacher_is_sagg_riac() -> None:
    arm = PlanarArm(5, noise=0.01)
    alone = run(sgim_d(arm, 0, correspondence=last_posture), arm, 0, movements=150)
    assert summary(list(alone)) == summary(list(run(sagg_riac(arm, 0), arm, 0, movements=150)))


def broken_off(after: int) -> ArmThat:
    """An arm on which somebody presses Ctrl-C once, in the movement after so many."""

    def act(n: int, rng: np.random.Generator) -> None:
        if n == after:
            raise KeyboardInterrupt

    return ArmThat(act, noise=0.05)


@pytest.mark.parametrize("after", [4, 15, 16])
def test_a_life_saved_where_a_movement_was_broken_off_goes_on_as_if_it_never_was(after: int, tmp_path: Path) -> None:
    """A lesson waits in the movement after 15 others, since the teacher has just offered it."""
    other = PlanarArm(5, noise=0.05)
    whole = life("sgim-d", other, 60, every=5)
    arm = broken_off(after)
    learner = make("sgim-d", arm)
    with pytest.raises(KeyboardInterrupt):
        list(run(learner, arm, 0, movements=60, teacher=teacher_of(other, 5)))
    save_life(learner, tmp_path / "life.sqlite")
    again, teacher = make("sgim-d", arm), teacher_of(other, 5)
    load_life(again, tmp_path / "life.sqlite", teacher=teacher)
    assert summary(list(run(again, arm, 0, movements=60, teacher=teacher))) == summary(whole[after:])


def test_a_lesson_whose_answer_was_given_up_is_offered_again_and_such_a_life_can_be_loaded(tmp_path: Path) -> None:
    arm, other = broken_off(15), PlanarArm(5, noise=0.05)
    learner, teacher = make("sgim-d", arm), teacher_of(other, 5)
    with pytest.raises(KeyboardInterrupt):
        list(run(learner, arm, 0, movements=40, teacher=teacher))
    assert learner.lesson_waits_for(0)
    learner.interrupt()
    rest = list(run(learner, arm, 0, movements=40, teacher=teacher))
    assert [e.index for e in rest if e.demonstration is not None] == [15, 20, 25, 30, 35]
    save_life(learner, tmp_path / "life.sqlite")
    load_life(make("sgim-d", arm), tmp_path / "life.sqlite", teacher=teacher_of(other, 5))


def test_a_lesson_of_ones_own_before_a_run_takes_none_of_the_teachers_away() -> None:
    arm = PlanarArm(5)
    shown = demonstrations(arm)
    learner = sgim_d(arm, 0, correspondence=last_posture)
    learner.watch(shown[-1])
    teacher = InitialTeacher(shown[:3], stream(0, "teacher"), every=10)
    episodes = list(run(learner, arm, 0, movements=40, teacher=teacher))
    assert [e.index for e in episodes if e.demonstration is not None] == [0, 10, 20]


def test_an_outcome_of_integers_is_recorded_as_it_is_remembered() -> None:
    class Counts(PlanarArm):
        def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
            return np.rint(super().execute(context, theta, rng)).astype(int)

    arm = Counts(5)
    assert {e.outcome.dtype for e in run(make("random", arm), arm, 0, movements=5) if e.outcome is not None} == {
        np.dtype(np.float64)
    }


@pytest.mark.parametrize("movements", [0, 1.5, -1, 7, 10])
def test_a_run_without_new_movements_is_refused(movements: int) -> None:
    arm = PlanarArm(5)
    learner = sagg_riac(arm, 0)
    list(run(learner, arm, 0, movements=10))
    with pytest.raises(ValueError, match="movements must be"):
        next(run(learner, arm, 0, movements=movements))


class CarelessArm(PlanarArm):
    """Writes into what it was given, and hands out arrays that it goes on using."""

    def __init__(self) -> None:
        super().__init__(5, context=True)
        self.seen, self.end = np.zeros(1), np.zeros(2)

    def observe(self, rng: np.random.Generator) -> Array:
        self.seen[:] = super().observe(rng)
        return self.seen

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        self.end[:] = super().execute(context, theta, rng)
        for array in (context, theta, self.seen):
            array *= 0
        return self.end


def test_an_environment_may_write_into_what_it_is_given_and_spoils_no_record() -> None:
    careful, careless = PlanarArm(5, context=True), CarelessArm()
    first, second = sagg_riac(careful, 0), sagg_riac(careless, 0)
    episodes = list(run(first, careful, 0, movements=60))
    assert summary(list(run(second, careless, 0, movements=60))) == summary(episodes)
    for name in ("contexts", "thetas", "outcomes"):
        assert np.array_equal(getattr(first.memory, name), getattr(second.memory, name))


@pytest.mark.parametrize("rest", [np.array([2.0, 0.0]), np.array([np.nan, 0.0]), np.zeros(5), np.zeros((1, 2))])
@every_algorithm
def test_no_learner_is_built_on_an_environment_whose_rest_is_no_outcome_in_its_task_space(
    name: str, rest: Array
) -> None:
    arm = PlanarArm(5)
    arm.rest = rest
    with pytest.raises(ValueError, match="rest of the environment must"):
        make(name, arm)
