"""check_environment: an environment that keeps every promise passes; each slip is told by name, in one line."""

import random
import re
import sys

import numpy as np
import pytest

import sgimd_torch
from sgimd_torch.__main__ import _call
from sgimd_torch.environments.check import check_environment
from sgimd_torch.environments.protocol import check_movement
from sgimd_torch.runs.process import command
from sgimd_torch.spaces import Box


class Cannon:
    """One parameter, some noise; keeps every promise. Each class below breaks one."""

    contexts, policies, outcomes = Box.cube(-1, 1, 1), Box.cube(0, 1, 2), Box.cube(-5, 5, 1)
    rest, outcome_noise = np.zeros(1), 0.1

    def observe(self, rng):
        return self.contexts.sample(rng)

    def execute(self, context, theta, rng):
        context, theta = check_movement(self, context, theta)
        return context + theta[:1] + rng.normal(0, 0.1, 1)

    def execute_many(self, contexts, thetas, rngs):
        return np.stack([self.execute(*movement) for movement in zip(contexts, thetas, rngs, strict=True)])


class RestOutside(Cannon):
    rest = np.array([9.0])


class RestList(Cannon):
    rest = (0.0,)


class TupleContexts(Cannon):
    contexts = (-1, 1)


class NoPolicies(Cannon):
    policies = Box.cube(0, 1, 0)


class TextNoise(Cannon):
    outcome_noise = "0.1"


class ContextOutside(Cannon):
    def observe(self, rng):
        return 3 + super().observe(rng)


class ContextOfItsOwn(Cannon):
    def __init__(self):
        self.rng = np.random.default_rng(0)

    def observe(self, rng):
        return self.contexts.sample(self.rng)


class ContextBuffer(Cannon):
    def __init__(self):
        self.buffer = np.zeros(1)

    def observe(self, rng):
        self.buffer[:] = super().observe(rng)
        return self.buffer


class OutcomeBuffer(ContextBuffer):
    def observe(self, rng):
        return self.contexts.sample(rng)

    def execute(self, context, theta, rng):
        self.buffer[:] = super().execute(context, theta, rng)
        return self.buffer


class Number(Cannon):
    def execute(self, context, theta, rng):
        return float(super().execute(context, theta, rng)[0])


class Diverging(Cannon):
    def execute(self, context, theta, rng):
        return super().execute(context, theta, rng) / (theta[0] < 1)


class Writing(Cannon):
    def execute(self, context, theta, rng):
        context, theta = check_movement(self, context, theta)
        outcome = context + theta[:1] + rng.normal(0, 0.1, 1)
        theta *= 0.5
        return outcome


class Failing(Cannon):
    def execute(self, context, theta, rng):
        return self.nothing


class GlobalNoise(Cannon):
    def execute(self, context, theta, rng):
        return super().execute(context, theta, rng) + np.random.normal(0, 0.1)  # noqa: NPY002 - the slip


class GlobalRandom(Cannon):
    def execute(self, context, theta, rng):
        return super().execute(context, theta, rng) + random.gauss(0, 0.1)


class NoiseOfItsOwn(Cannon):
    def __init__(self):
        self.rng = np.random.default_rng(0)

    def execute(self, context, theta, rng):
        return super().execute(context, theta, self.rng)


class Carrying(Cannon):
    speed = 0.0

    def execute(self, context, theta, rng):
        outcome = super().execute(context, theta, rng) + self.speed
        self.speed += theta[0]
        return outcome


class CarryingOthers(Cannon):
    """The same movement again ends in the same place, unless another came between."""

    last = None

    def execute(self, context, theta, rng):
        warm, self.last = self.last is not None and self.last != theta[0], theta[0]
        return super().execute(context, theta, rng) + 0.1 * warm


class Silent(Cannon):
    outcome_noise = 0.0


class Deterministic(Cannon):
    def execute(self, context, theta, rng):
        context, theta = check_movement(self, context, theta)
        return context + theta[:1]


class Centimetres(Cannon):
    outcome_noise = 10.0


class OneStream(Cannon):
    def execute_many(self, contexts, thetas, rngs):
        return super().execute_many(contexts, thetas, [rngs[0]] * len(rngs))


class Longest(Cannon):
    def execute_many(self, contexts, thetas, rngs):
        return super().execute_many(contexts, thetas, rngs) + 1e-12 * (len(thetas) == 1)


class FlatBatch(Cannon):
    def execute_many(self, contexts, thetas, rngs):
        return super().execute_many(contexts, thetas, rngs).ravel()


class BatchBuffer(Cannon):
    def __init__(self):
        self.buffer = np.zeros((100, 1))

    def execute_many(self, contexts, thetas, rngs):
        self.buffer[: len(thetas)] = super().execute_many(contexts[::-1], thetas[::-1], rngs[::-1])[::-1]
        return self.buffer[: len(thetas)]


class Trusting(Cannon):
    def execute(self, context, theta, rng):
        return np.array([context[0] + theta[0] + rng.normal(0, 0.1)])


class Clipping(Cannon):
    def execute(self, context, theta, rng):
        return super().execute(context, self.policies.clip(np.nan_to_num(np.resize(theta, 2))), rng)


@pytest.mark.parametrize(
    ("slip", "told"),
    [
        (RestOutside, r"rest .* is 9.0, outside \[-5.0, 5.0\].*the outcome of not moving, one point of T"),
        (RestList, "rest must be an array, .* got tuple"),
        (TupleContexts, r"contexts must be a sgimd_torch.Box, got tuple; without contexts it is Box.cube\(0, 1, 0\)"),
        (NoPolicies, "policies must have a dimension"),
        (TextNoise, "outcome_noise must be a number >= 0, got '0.1'"),
        (ContextOutside, r"observe\(\) gave \[.*\], outside C"),
        (ContextOfItsOwn, r"observe\(\) gave two contexts for equal streams"),
        (ContextBuffer, r"observe\(\) changed an array that it gave before: one buffer is used twice"),
        (OutcomeBuffer, r"execute\(\) changed an array that it gave before: one buffer is used twice"),
        (Number, r"execute\(\) must give an array of shape \(1,\), got float; np.array\(\[x\]\)"),
        (Diverging, r"execute\(\) gave \[inf\] for theta \[1.0, 1.0\]; raise SimulationError"),
        (Writing, r"execute\(\) changed the theta that it was given"),
        (Failing, r"execute\(\) raised AttributeError for theta \[.*\]: 'Failing' object has no attribute 'nothing'"),
        (GlobalNoise, r"execute\(\) drew from a global random stream"),
        (GlobalRandom, r"execute\(\) drew from a global random stream"),
        (NoiseOfItsOwn, "its noise is not from the rng, of which nothing was drawn"),
        (Carrying, r"then \[.*\] for the same movement and equal streams: state is carried over"),
        (CarryingOthers, r"but \[.*\] after another movement: state is carried over"),
        (Silent, "outcome_noise is 0, but outcomes of a movement scatter by about 0.1"),
        (Deterministic, r"outcome_noise is 0.1, but no movement scatters; does execute\(\) use its rng"),
        (Centimetres, "outcome_noise is 10, but outcomes of a movement scatter by 0.1.*; in other units"),
        (OneStream, r"row 1 of execute_many\(\) is .*, execute\(\) gives .*its own rng"),
        (Longest, r"a row of execute_many\(\) depends on the others in its batch"),
        (FlatBatch, r"execute_many\(\) must give float64 of shape \(5, 1\), got float64 \(5,\)"),
        (BatchBuffer, r"execute_many\(\) changed an array that it gave before"),
        (Trusting, r"execute\(\) accepted a context of shape \(2,\).*check_movement"),
        (Clipping, r"execute\(\) accepted a theta of shape \(3,\).*check_movement"),
    ],
    ids=lambda each: each.__name__ if isinstance(each, type) else "",
)
def test_a_slip_is_told_by_name(slip, told):
    with np.errstate(divide="ignore"), pytest.raises(ValueError, match=told) as refused:
        check_environment(slip())
    first, *lines = str(refused.value).splitlines()
    assert first == f"{slip.__name__} is no environment yet:"
    assert len(lines) == (2 if slip is Trusting else 1)


def test_one_that_keeps_every_promise_passes_and_so_does_its_batch():
    check_environment(Cannon())
    sgimd_torch.check_environment(Cannon(), movements=10)


def test_all_slips_of_the_spaces_are_told_at_once():
    class Bare:
        """As a user begins: nothing is there yet."""

    with pytest.raises(ValueError, match="Bare is no environment yet") as refused:
        check_environment(Bare())
    assert [line.split()[0] for line in str(refused.value).splitlines()[1:]] == [
        *("contexts", "policies", "outcomes", "observe", "execute", "outcome_noise", "rest")
    ]


MODULE = """
import numpy as np
from sgimd_torch import Box, PlanarArm
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.runs.tasks import Task

class Far(PlanarArm):
    rest = property(lambda self: np.array([9.0, 0.0]), lambda self, value: None)

def task():
    arm = PlanarArm(3)
    return Task(arm, benchmark=lambda: Benchmark("PlanarArm", np.array([[5.0, 0.0]]), 0.1))

def clumsy():
    return PlanarArm(3).nothing

class Wide(PlanarArm):
    outcomes = property(lambda self: Box.cube(-100, 100, 2), lambda self, value: None)
"""


@pytest.fixture
def arms(tmp_path, monkeypatch):
    (tmp_path / "my_arms.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    yield
    sys.path[:] = [place for place in sys.path if place != str(tmp_path)]
    sys.modules.pop("my_arms", None)


def test_the_command_says_what_it_found(capsys):
    assert command(_call, ["check", "planar-arm-7", "--movements", "2"]) == 0
    said = capsys.readouterr().out
    assert re.search(
        r"PlanarArm keeps every promise\n"
        r".*goals of evaluation: 311\n.*demonstrations: 127",
        said,
    )


def test_a_task_space_much_larger_than_random_movements_reach_is_told(arms, capsys):
    assert command(_call, ["check", "my_arms:Wide"]) == 0
    said = capsys.readouterr().out
    assert re.search(r"20 random movements span only 0\.\d+ % of T, \[.*\] x \[.*\]; .* make T smaller", said)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["my_arms:Far"], "error: Far is no environment yet:\n  rest of the environment must lie in its box"),
        (["my_arms:task"], "error: goals of the benchmark must lie in the task space"),
        (["my_arms:clumsy"], "error: environment my_arms:clumsy cannot be made: AttributeError: 'PlanarArm'"),
        (["my_arms:None"], "error: environment my_arms:None: my_arms has no None"),
        (["nothing:make"], "error: environment nothing:make: the module nothing cannot be imported"),
        (["rod"], "error: unknown environment 'rod'"),
        (["planar-arm-7", "--movements", "0"], "error: --movements must be a whole number >= 1"),
        (["planar-arm-7", "--movements", "some"], "invalid int value: 'some'"),
        ([], "required: ENVIRONMENT"),
    ],
)
def test_the_command_refuses_with_exit_code_2_and_no_traceback(arms, capsys, words, told):
    assert command(_call, ["check", *words]) == 2
    said = capsys.readouterr().err
    assert told in said
    assert "Traceback" not in said
