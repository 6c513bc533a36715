"""Learners that ask: when, whom and for which goal; teachers who reply, also badly."""

import sys
from collections import Counter

import numpy as np
import pytest

from experiments.mislabelling import mislabelled
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.extras.asking.algorithms import SEARCHING, sgim_acts, sgim_im
from sgimd_torch.extras.asking.teachers import AnsweringTeacher, high_half, low_half
from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.parts import Demonstrator, Strategy
from sgimd_torch.session import run
from sgimd_torch.spaces import Demonstration, Lesson, Request, stream
from sgimd_torch.tasks.robots import arm_demonstrations
from worlds import NO_CONTEXT, demonstrations, last_posture

ARM = PlanarArm(4, noise=0.02)
SHOWN = demonstrations(PlanarArm(4))


def halves(seed=0, shown=SHOWN, **options):
    return {
        name: AnsweringTeacher(shown, stream(seed, name), knows=knows, **options)
        for name, knows in (("low", low_half), ("high", high_half))
    }


def acts(arm=ARM, seed=0, teachers=None, translate=last_posture, **options):
    teachers = halves() if teachers is None else teachers
    return sgim_acts(arm, seed, correspondence=translate, teachers=teachers, inverse=NearestNeighbour, **options)


def live(learner, teachers, movements=150, arm=ARM, seed=0, **options):
    return list(run(learner, arm, seed, movements=movements, teachers=teachers, **options))


def lines(episodes):
    """What episodes hold, as values that can be compared."""
    return [
        (
            *(e.index, e.context.tolist(), e.move and (e.move.theta.tolist(), e.move.origin)),
            *(e.outcome is not None and e.outcome.tolist(), e.request and (e.request.teacher, e.request.goal.tolist())),
            e.demonstration and e.demonstration.outcome.tolist(),
        )
        for e in episodes
    ]


def test_a_teacher_replies_with_the_nearest_of_their_demonstrations_or_not_at_all():
    low, high = halves(within=0.5).values()
    assert len(low.demonstrations) == len(high.demonstrations) == 10
    xs = [[demonstration.outcome[0] for demonstration in teacher.demonstrations] for teacher in (low, high)]
    assert max(xs[0]) < min(xs[1])
    for demonstration in low.demonstrations:
        assert low.demonstrate(NO_CONTEXT, demonstration.outcome + 0.001, None) is demonstration
    assert high.demonstrate(NO_CONTEXT, np.array([-1.0, 0.0]), None) is None
    assert AnsweringTeacher(SHOWN, stream(0, "t")).demonstrate(NO_CONTEXT, np.array([-9.0, 0.0]), None) is not None


def test_a_mislabelling_teacher_shows_each_movement_under_another_outcome():
    wrong = AnsweringTeacher(SHOWN, stream(0, "t"), knows=mislabelled).demonstrations
    assert all(np.array_equal(a.trajectory, b.trajectory) for a, b in zip(wrong, SHOWN, strict=True))
    outcomes = [[demonstration.outcome.tolist() for demonstration in part] for part in (wrong, SHOWN)]
    assert not any(a == b for a, b in zip(*outcomes, strict=True))
    assert sorted(outcomes[0]) == sorted(outcomes[1])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: halves(within=0.0), "within must be a distance above 0, got 0"),
        (lambda: halves(takes=-1), "takes must be a whole number >= 0, got -1"),
        (lambda: halves(shown=[]), "a teacher needs at least one demonstration"),
        (lambda: acts(cost=0.0), "costs must be positive and finite"),
        (lambda: acts(goals=UniformGoals), "goals must be StrategicGoals, .* got a UniformGoals"),
        (lambda: live(acts(), {"other": Silent()}), r"the learner asks '(low|high)', but teachers are other; are they"),
    ],
)
def test_teachers_and_learners_that_cannot_ask_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_it_asks_both_teachers_for_goals_and_uses_the_answers_in_both_ways():
    teachers = halves()
    episodes = live(acts(**SEARCHING), teachers, 300)
    asked = [e for e in episodes if e.reply == "shown"]
    assert {e.request.teacher for e in asked} == {"low", "high"}
    for e in asked:
        assert e.demonstration is teachers[e.request.teacher].demonstrate(NO_CONTEXT, e.request.goal, None)
    shown = [e for e in asked if np.array_equal(e.move.goal, e.demonstration.outcome)]
    assert shown == asked  # imitated or emulated, it is the goal of the movements
    assert Counter(e.move.origin == "imitate" for e in asked).keys() == {True, False}
    imitated = next(e for e in asked if e.move.origin == "imitate")
    assert np.array_equal(imitated.move.theta, imitated.demonstration.trajectory[-1])


def fails(context, goal, memory):
    raise OSError("the camera is off")


BAD = {
    "raises": (fails, "OSError: the camera is off"),
    "exits": (lambda *_: sys.exit(0), "SystemExit: 0"),
    "outside T": (lambda *_: demonstration(outcome=[9.0, 0.0]), "outcome of the demonstration must lie in its box"),
    "another context": (lambda *_: demonstration(context=[0.5]), "context of the demonstration must have shape"),
    "another shape": (lambda *_: demonstration(outcome=[0.1, 0.2, 0.3]), r"must have shape \(..., 2\), got \(3,\)"),
    "outside Pi": (lambda *_: demonstration(theta=2.0), "theta_d of the correspondence must lie in its box"),
    "no demonstration": (lambda *_: "later", "'str' object has no attribute 'context'"),
}


def demonstration(outcome=(0.1, 0.2), context=(), theta=0.5):
    return Demonstration(np.array(context), np.arange(2.0), np.full((2, 4), theta), np.array(outcome))


class Silent(Demonstrator):
    def demonstrate(self, context, goal, memory):
        return None


@pytest.mark.parametrize("kind", BAD)
def test_an_answer_that_cannot_be_used_is_told_and_counts_as_none(kind):
    answer, message = BAD[kind]
    bad = Silent()
    bad.demonstrate = answer
    with pytest.warns(RuntimeWarning, match=f"teacher t gave no usable demonstration, .*{message}"):
        episodes = live(acts(teachers={"t": bad}), {"t": bad}, 60)
    silent = live(acts(teachers={"t": Silent()}), {"t": Silent()}, 60)
    assert lines(episodes) == lines(silent)
    assert any(e.request for e in episodes)
    assert all(e.move is not None and e.demonstration is None for e in episodes)


def test_without_answers_it_moves_in_every_movement_also_when_nobody_hears_its_requests():
    heard, unheard = live(acts(), {"low": Silent(), "high": Silent()}, 60), live(acts(), None, 60)
    assert [e.move.theta.tolist() for e in heard] == [e.move.theta.tolist() for e in unheard]
    assert not any(e.request for e in unheard)


def test_for_a_slow_teacher_it_rests_before_it_uses_the_answer():
    teachers = {"slow": AnsweringTeacher(SHOWN, stream(0, "t"), takes=4)}
    episodes = live(acts(teachers=teachers), teachers, 200)
    asked = [e.index for e in episodes[:-5] if e.reply == "shown"]
    assert asked
    for index in asked:
        assert [e.move is None for e in episodes[index : index + 5]] == [True] * 4 + [False]
    assert sum(e.move is None for e in episodes[: asked[-1] + 5]) == 4 * len(asked)


def test_an_attempt_gets_its_lesson_with_the_policy_that_it_corresponds_to():
    replies = []

    class Asks(Strategy):
        def attempt(self, context):
            replies.append((yield Request("t", np.zeros(2))))
            yield None

    learner = acts()
    learner.autonomous = Asks(learner.problem)
    assert learner.request(NO_CONTEXT).teacher == "t"
    learner.watch(SHOWN[0])
    assert isinstance(replies[0], Lesson)
    assert np.array_equal(replies[0].theta_d, SHOWN[0].trajectory[-1])
    assert replies[0].demonstration is SHOWN[0]
    assert [learner.ask(NO_CONTEXT), learner.ask(NO_CONTEXT)] == [None, None]  # rests, of two attempts
    assert replies[1] is None


def test_costs_make_it_ask_less():
    asked = [sum(e.request is not None for e in live(acts(cost=cost), halves())) for cost in (1.0, 1000.0)]
    assert asked[1] < 0.3 * asked[0]


def test_nobody_shows_the_same_twice():
    teachers = {"all": AnsweringTeacher(SHOWN, stream(0, "t"))}
    episodes = live(acts(teachers=teachers), teachers, 300)
    shown = [e.demonstration.outcome.tolist() for e in episodes if e.demonstration]
    assert len(shown) == len({tuple(each) for each in shown}) > 10
    again = [e for e in episodes if e.reply == "again"]
    assert again
    assert all(e.demonstration is None and e.move.origin != "imitate" for e in again)


def late_requests(movements, after, noise=0.0, **more):
    """Requests of two learners to teachers of one half each, and to ``more`` teachers, by what these know."""
    arm, requests = PlanarArm(7, noise=noise), []
    for seed in (1000, 1001):
        teachers = halves(seed, arm_demonstrations(arm))
        for name, knows in more.items():
            teachers[name] = AnsweringTeacher(arm_demonstrations(arm), stream(seed, name), knows=knows)
        learner = acts(arm, seed, teachers, arm.correspondence)
        requests += [e.request for e in live(learner, teachers, movements, arm, seed)[after:] if e.request]
    assert len(requests) > 40
    return requests


def test_a_teacher_who_mislabels_is_soon_left_alone():
    asked = [request.teacher for request in late_requests(600, 200, noise=0.02, wrong=mislabelled)]
    assert asked.count("wrong") / len(asked) < 0.15  # a third, if it made no difference


def test_of_two_teachers_each_is_asked_about_goals_of_their_own_half():
    own = [(request.goal[0] < 0) == (request.teacher == "low") for request in late_requests(1000, 600)]
    assert np.mean(own) > 0.8


def test_sgim_im_imitates_what_it_is_shown_and_never_emulates():
    teachers = {"all": AnsweringTeacher(SHOWN, stream(0, "t"))}
    learner = sgim_im(ARM, 0, correspondence=last_posture, teachers=teachers, budget=5)
    asked = [e for e in live(learner, teachers) if e.request]
    assert {e.request.strategy for e in asked} == {"imitate all"}
    assert {e.move.origin for e in asked if e.reply == "shown"} == {"imitate"}
