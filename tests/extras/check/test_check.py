"""check_environment: an environment that keeps every promise passes; each slip is told by name, in one line."""

import re

import numpy as np
import pytest

from sgimd_torch.__main__ import _call
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import check_movement
from sgimd_torch.extras.check.promises import check_environment
from sgimd_torch.runs.program import command
from sgimd_torch.spaces import Box, stream


class Cannon:
    """One parameter, some noise; keeps every promise. What is below breaks one."""

    contexts, policies, outcomes = Box.cube(-1, 1, 1), Box.cube(0, 1, 2), Box.cube(-5, 5, 1)
    rest, outcome_noise = np.zeros(1), 0.1

    def observe(self, rng):
        return self.contexts.sample(rng)

    def execute(self, context, theta, rng):
        context, theta = check_movement(self, context, theta)
        return context + theta[:1] + rng.normal(0, 0.1, 1)

    def execute_many(self, contexts, thetas, rngs):
        return np.stack([self.execute(*movement) for movement in zip(contexts, thetas, rngs, strict=True)])


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


def with_(**members):
    """A cannon with other members; a function gets what the cannon's own method gives, and its arguments."""

    def wrapped(name, change):
        own = getattr(Cannon, name)
        return lambda self, *given: change(lambda *changed: own(self, *(changed or given)), *given)

    made = {name: wrapped(name, each) if callable(each) else each for name, each in members.items()}
    return type("Other", (Cannon,), made)()


def writing(cannon, context, theta, rng):
    outcome = cannon()
    theta *= 0.5
    return outcome


def buffered(name, **others):
    """A cannon of which one member gives the same buffer again and again."""
    buffer = np.zeros((100, 1)) if name == "execute_many" else np.zeros(1)

    def kept(own, *_):
        value = own()
        buffer[: len(value)] = value
        return buffer[: len(value)]

    return with_(**{name: kept}, **others)


OF_ITS_OWN = np.random.default_rng(0)
EXECUTE, MANY = r"execute\(\)", r"execute_many\(\)"
GLOBAL = f"{EXECUTE} drew from a global random stream"
USED_TWICE = "changed an array that it gave before: one buffer is used twice"


SLIPS = {
    r"rest .* is 9.0, outside \[-5.0, 5.0\].*the outcome of not moving, one point of T": with_(rest=np.array([9.0])),
    r"contexts must be a sgimd_torch.Box, got tuple; without contexts it is Box.cube": with_(contexts=(-1, 1)),
    "outcome_noise must be a number >= 0, got '0.1'": with_(outcome_noise="0.1"),
    r"observe\(\) gave \[.*\], outside C": with_(observe=lambda own, rng: 3 + own()),
    r"observe\(\) gave two contexts for equal streams": with_(observe=lambda own, rng: own(OF_ITS_OWN)),
    rf"observe\(\) {USED_TWICE}": buffered("observe"),
    f"{EXECUTE} {USED_TWICE}": buffered("execute", execute_many=None),
    f"{MANY} {USED_TWICE}": buffered("execute_many"),
    rf"{EXECUTE} must give an array of shape \(1,\), got float; np": with_(execute=lambda own, *_: float(own()[0])),
    rf"{EXECUTE} gave \[inf\] for theta \[1.0, 1.0\]; raise SimulationError": with_(
        execute=lambda own, context, theta, rng: own() / (theta[0] < 1)
    ),
    f"{EXECUTE} changed the theta that it was given": with_(execute=writing),
    rf"{EXECUTE} raised AttributeError for theta \[.*\]: .* has no attribute 'nothing'": with_(
        execute=lambda own, *_: own.nothing
    ),
    GLOBAL: with_(execute=lambda own, *_: own() + np.random.normal(0, 0.1)),  # noqa: NPY002 - the slip
    "nothing was drawn from rng; does its noise come from a generator of its own": with_(
        execute=lambda own, context, theta, rng: own(context, theta, OF_ITS_OWN)
    ),
    r"then \[.*\] for the same movement and equal streams: state carries over": Carrying(),
    r"but \[.*\] after another movement: state carries over": CarryingOthers(),
    "outcome_noise is 0, but outcomes of a movement scatter by about 0.1": with_(outcome_noise=0.0),
    rf"outcome_noise is 0.1, but no movement scatters; does {EXECUTE} use its rng": with_(
        execute=lambda own, context, theta, rng: own(context, theta, stream(0, "always the same"))
    ),
    "outcome_noise is 10, but outcomes of a movement scatter by 0.1.*; a wrong unit": with_(outcome_noise=10.0),
    rf"row 1 of {MANY} is .*, {EXECUTE} gives .*its own rng": with_(
        execute_many=lambda own, contexts, thetas, rngs: own(contexts, thetas, [rngs[0]] * len(rngs))
    ),
    f"a row of {MANY} depends on other rows of its batch": with_(
        execute_many=lambda own, contexts, thetas, rngs: own() + 1e-12 * (len(thetas) == 1)
    ),
    rf"{MANY} must give float64 of shape \(5, 1\), got float64 \(5,\)": with_(
        execute_many=lambda own, *_: own().ravel()
    ),
    rf"{EXECUTE} accepted a context of shape \(2,\).*check_movement": with_(
        execute=lambda own, context, theta, rng: np.array([context[0] + theta[0] + rng.normal(0, 0.1)])
    ),
    rf"{EXECUTE} accepted a theta of shape \(3,\).*check_movement": with_(
        execute=lambda own, context, theta, rng: own(context, np.resize(np.nan_to_num(theta), 2).clip(0, 1), rng)
    ),
}


@pytest.mark.parametrize(("told", "slip"), SLIPS.items(), ids=map(str, range(len(SLIPS))))
def test_a_slip_is_told_by_name(told, slip):
    with np.errstate(divide="ignore"), pytest.raises(ValueError, match=told) as refused:
        check_environment(slip)
    first, *lines = str(refused.value).splitlines()
    assert first == f"{type(slip).__name__} is no environment yet:"
    assert len(lines) == (2 if "accepted a context" in told else 1)


class Warm(Cannon):
    """Ends in another place each time, by rounding."""

    outcome_noise, calls, execute_many = 0.0, 0, None

    def execute(self, context, theta, rng):
        self.calls += 1
        context, theta = check_movement(self, context, theta)
        return context + theta[:1] + 1e-5 * (self.calls % 3)


def test_an_execute_many_that_does_not_count_is_remarked():
    (remark,) = check_environment(
        type("Own", (Cannon,), {"execute": lambda self, *given: Cannon.execute(self, *given)})()
    )
    assert remark.startswith("execute_many() is a parent's, execute() is not: movements are made one by one")


def test_a_repeat_that_differs_by_rounding_is_a_remark_with_the_difference():
    (remark,) = check_environment(Warm())
    assert re.match(r"a repeated movement .* ends [12]e-05 away, as by rounding", remark)


def test_scatter_is_that_of_the_median_movement_and_one_that_scatters_far_more_is_remarked():
    wild = lambda own, context, theta, rng: own() + (theta == 1).all() * rng.normal(0, 100, 1)  # noqa: E731
    (remark,) = check_environment(with_(execute=wild, execute_many=None))
    assert re.match(r"theta \[1.0, 1.0\] scatters by 14, a typical movement by 0.19:", remark)
    assert check_environment(Cannon()) == []


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
from sgimd_torch.tasks import Task

class Far(PlanarArm):
    rest = property(lambda self: np.array([9.0, 0.0]), lambda self, value: None)

def task():
    arm = PlanarArm(3)
    return Task(arm, benchmark=lambda: Benchmark("PlanarArm", np.array([[5.0, 0.0]]), 0.1))

def clumsy():
    return PlanarArm(3).nothing

class Exits(PlanarArm):
    def execute(self, context, theta, rng):
        raise SystemExit(0)

class Unseen(PlanarArm):
    def trace(self, context, theta, rng):
        raise SystemExit(0)

class Forgets(PlanarArm):
    def execute(self, context, theta, rng):
        super().execute(context, theta, rng)

class Wide(PlanarArm):
    outcomes = property(lambda self: Box.cube(-100, 100, 2), lambda self, value: None)
"""


@pytest.fixture
def arms(module):
    module("my_arms", MODULE)
    module("leaves", "raise SystemExit('no licence')")


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
    assert re.search(r"the last 20 outcomes span only 0\.\d+ % of T, \[.*\] x \[.*\]; .* make T smaller", said)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["my_arms:Far"], "error: Far is no environment yet:\n  rest of the environment must lie in its box"),
        (["my_arms:task"], "error: goals of the benchmark must lie in the task space"),
        (["my_arms:clumsy"], "error: environment my_arms:clumsy cannot be made: AttributeError: 'PlanarArm'"),
        (["planar-arm-7", "--movements", "0"], "error: --movements must be a whole number >= 1"),
        (["my_arms:Exits"], "execute() raised SystemExit for theta"),
        (["my_arms:Unseen"], "error: trace() of Unseen failed: SystemExit: 0"),
        (["my_arms:Forgets"], "got NoneType; is its return missing?"),
        (["leaves:make"], "error: environment leaves:make: the module leaves cannot be imported: SystemExit: no lic"),
    ],
)
def test_the_command_refuses_with_exit_code_2_and_no_traceback(arms, capsys, words, told):
    assert command(_call, ["check", *words]) == 2
    said = capsys.readouterr().err
    assert told in said
    assert "Traceback" not in said


ROBOTS = {
    "arm": PlanarArm(),
    "two joints": PlanarArm(2),
    "noise and context": PlanarArm(noise=0.02, context=True),
    "large task space": PlanarArm(context=True, outcomes=Box.cube(-100, 100, 2)),
    "rod": FishingRod(),
    "windy rod": FishingRod(max_wind=0.02),
}


@pytest.mark.parametrize("name", ROBOTS)
def test_our_robots_keep_every_promise(name):
    check_environment(ROBOTS[name])


class Hiding(Cannon):
    """Its batches hide some outcomes."""

    def execute_many(self, contexts, thetas, rngs):
        outcomes = super().execute_many(contexts, thetas, rngs)
        return np.ma.masked_array(outcomes, outcomes > 0)


def test_a_mask_that_hides_outcomes_is_told():
    with pytest.raises(ValueError, match="got MaskedArray; raise SimulationError where there is no outcome"):
        check_environment(Hiding())
