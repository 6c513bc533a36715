"""Both directions of gymnasium: its environments keep our promises, ours pass its own check."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from sgimd_torch.environments.motor_primitives import GaussianPrimitive
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import SimulationError
from sgimd_torch.extras.check.promises import check_environment
from sgimd_torch.extras.check.remarks import remarks_on
from sgimd_torch.extras.gymnasium.controllers import Sinusoids
from sgimd_torch.extras.gymnasium.from_gymnasium import FromGymnasium, measured_noise
from sgimd_torch.extras.gymnasium.to_gymnasium import ToGymnasium
from sgimd_torch.spaces import Box, stream

PUSHES = Box.cube(-1, 1, 2)
NO_CONTEXT = np.zeros(0)
SPACE = gymnasium.spaces.Box(-np.inf, np.inf, (2,), np.float64)


class Sled(gymnasium.Env):
    """A point on ice, pushed for .1 s by each action; a goal environment. It starts up to .1 m away from its middle."""

    dt = 0.1

    def __init__(self, *, ends_at=np.inf, noise=0.1):
        self.action_space = gymnasium.spaces.Box(-1, 1, (2,), np.float32)
        self.observation_space = gymnasium.spaces.Dict(
            dict.fromkeys(("observation", "achieved_goal", "desired_goal"), SPACE)
        )
        self.ends_at, self.noise, self.actions = ends_at, noise, []

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place, self.speed = self.np_random.uniform(-self.noise, self.noise, 2), np.zeros(2)
        self.actions = []
        return self.seen(), {}

    def step(self, action):
        assert self.action_space.contains(action)
        self.actions.append(action.copy())
        self.speed += self.dt * action
        self.place += self.dt * self.speed
        return self.seen(), 0.0, bool(np.linalg.norm(self.place) > self.ends_at), False, {}

    def seen(self):
        return {"observation": self.speed, "achieved_goal": self.place, "desired_goal": np.zeros(2)}  # its own buffers


class Windy(Sled):
    """Each step draws noise."""

    def step(self, action):
        self.place += self.np_random.normal(0, 0.01, 2)
        return super().step(action)


def achieved(observations):
    return observations[-1]["achieved_goal"]


def sled(controller=None, *, world=None, **options):
    controller = GaussianPrimitive(PUSHES, (1.0, 2.0)) if controller is None else controller
    space = {"outcome": achieved, "outcomes": Box.cube(-3, 3, 2), "rest": np.zeros(2), "outcome_noise": 0.06}
    return FromGymnasium(Sled() if world is None else world, controller, **{**space, "steps": 20, **options})


@pytest.mark.parametrize("controller", [Sinusoids(PUSHES, (0.2, 2.0)), GaussianPrimitive(PUSHES, (1.0, 2.0))])
def test_an_environment_of_gymnasium_keeps_every_promise_with_every_controller(controller):
    check_environment(sled(controller))


def test_a_movement_is_an_episode_of_the_controllers_commands():
    robot = sled(world=Sled(noise=0.0))
    theta = np.array([1.0] * 4 + [0.5] * 4 + [1.0])  # full to the right, nothing upwards
    outcome = robot.execute(NO_CONTEXT, theta, stream(0, "any"))
    np.testing.assert_allclose(outcome, [0.1 * 0.1 * 20 * 21 / 2, 0.0], atol=1e-12)  # the sum of speeds .1, .2 .. 2
    np.testing.assert_allclose(robot.world.actions, [[1.0, 0.0]] * 20, atol=1e-7)


def test_what_a_mask_hides_is_no_outcome():
    robot = sled(outcome=lambda observations: np.ma.masked_array([0.1, 0.2], [False, True]))
    with pytest.raises(SimulationError, match="the outcome is not finite"):
        robot.execute(NO_CONTEXT, np.full(9, 0.5), stream(0, "any"))


def test_a_world_that_ends_most_episodes_early_is_told_and_one_that_seldom_does_is_not():
    away = np.array([1.0] * 8 + [0.5])  # as fast as it can
    robots = {ends_at: sled(world=Sled(ends_at=ends_at, noise=0.0)) for ends_at in (0.1, 9.0)}
    for robot in robots.values():
        for k in range(12):
            robot.execute(NO_CONTEXT, away, stream(k, "any"))
    said = "12 of the last 12 episodes ended early, after 4 of 20 actions (median): the later ones do nothing"
    assert remarks_on(robots[0.1], np.zeros((0, 2))) == {"noticed": said}
    assert not remarks_on(robots[9.0], np.zeros((0, 2)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sled(rest=[9.0, 9.0]), "rest of the environment must lie in its box"),
        (lambda: sled(rest=[0.0]), r"rest must have shape \(..., 2\)"),
        (lambda: sled(world=gymnasium.make("CartPole-v1")), r"needs continuous actions, .* Discrete\(2\)"),
        (lambda: sled(world=gymnasium.make("MountainCarContinuous-v0")), "needs dt > 0, .* has the world no dt"),
        (lambda: sled(steps=0), "steps must be a whole number >= 1"),
        (
            lambda: sled(world=gymnasium.wrappers.TimeLimit(Sled(), 12)),
            r"ends an episode after 12 actions, but a movement has 20; .* max_episode_steps=20",
        ),
        (lambda: sled(contexts=Box.cube(-1, 1, 2)), "contexts .* and context, .* must be given together"),
        (lambda: Box([-1, -1], [1, np.inf]), r"dimension 1 is \[-1.0, inf\]; is it a space without bounds"),
    ],
)
def test_what_cannot_be_a_task_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_world_that_diverges_names_the_theta():
    class Breaking(Sled):
        def step(self, action):
            self.place *= np.nan
            return super().step(action)

    with pytest.raises(SimulationError, match=r"not finite; theta=\[0.5, "):
        sled(world=Breaking()).execute(NO_CONTEXT, np.full(9, 0.5), stream(0, "any"))


def seen(first):
    return first["achieved_goal"]


@pytest.mark.parametrize(("world", "noise"), [(Sled(), 0.0), (Windy(), 0.045)])
def test_a_start_that_is_seen_and_not_set_is_a_context(world, noise):
    robot = sled(world=world, contexts=Box.cube(-0.1, 0.1, 2), context=seen, outcome_noise=noise)
    check_environment(robot)
    assert measured_noise(robot, stream(0, "any")) == pytest.approx(noise, rel=0.2)
    starts = [robot.observe(stream(k, "any")) for k in range(2)]
    still = np.full(9, 0.5)
    ends = [robot.execute(start, still, stream(0, "any")) for start in starts]
    np.testing.assert_allclose(ends[0] - ends[1], starts[0] - starts[1], atol=1e-12)  # it does not move but by the wind
    elsewhere = sled(world=type(world)(), contexts=Box.cube(-0.1, 0.1, 2), context=seen, outcome_noise=noise)
    assert elsewhere.execute(starts[0], still, stream(0, "any")).tolist() == ends[0].tolist()  # as after --resume
    with pytest.raises(ValueError, match=r"context \[0.0, 0.0\] is never observed: .* can be seen, not set"):
        robot.execute(np.zeros(2), still, stream(0, "any"))


@pytest.mark.parametrize("arm", [PlanarArm(3), PlanarArm(noise=0.02, context=True)], ids=["arm", "contexts and noise"])
@pytest.mark.filterwarnings(
    "ignore:.*Box observation space m.*imum value is.*infinity", "ignore:.*Not able to test alternative render modes"
)
def test_our_environments_pass_gymnasiums_own_check(arm):
    check_env(ToGymnasium(arm))


def test_an_observation_has_a_number_even_without_contexts():
    world = ToGymnasium(PlanarArm(3))
    first, _ = world.reset(seed=0)
    last, *_ = world.step(np.full(3, 0.5))
    assert first["observation"].tolist() == last["observation"].tolist() == [0.0]
    assert world.observation_space.contains(first)


def test_an_episode_of_ours_is_one_movement_whose_reward_is_the_distance_to_the_goal():
    arm = PlanarArm(3)
    world = ToGymnasium(arm)
    observation, _ = world.reset(seed=3, options={"goal": [0.5, 0.5]})
    assert observation["desired_goal"].tolist() == [0.5, 0.5]
    assert observation["achieved_goal"].tolist() == arm.rest.tolist()
    observation, reward, terminated, truncated, info = world.step(arm.solve(NO_CONTEXT, [0.5, 0.5]))
    assert (terminated, truncated, info["is_success"]) == (True, False, True)
    np.testing.assert_allclose(observation["achieved_goal"], [0.5, 0.5], atol=1e-9)
    assert reward == pytest.approx(world.compute_reward(observation["achieved_goal"], [0.5, 0.5]))
    rewards = world.compute_reward(np.zeros((4, 2)), np.ones((4, 2)), [{}] * 4)
    np.testing.assert_allclose(rewards, -np.sqrt(2))
    with pytest.raises(RuntimeError, match="an episode is one movement"):
        world.step(np.full(3, 0.5))


def test_goals_and_contexts_of_ours_come_from_the_seed_or_from_the_caller():
    world = ToGymnasium(PlanarArm(3, context=True))
    goals = {tuple(world.reset(seed=seed)[0]["desired_goal"].tolist()) for seed in (0, 1, 2, 1)}
    assert len(goals) == 3
    assert world.reset(options={"context": [0.3]})[0]["observation"].tolist() == [0.3]
    for options in ({"goal": [5.0, 0.0]}, {"context": [5.0]}, {"goal": [0.0]}):
        with pytest.raises(ValueError, match=r"goal|context"):
            world.reset(options=options)
    world.reset()
    with pytest.raises(ValueError, match="theta must lie in its box"):
        world.step([2.0, 0.5, 0.5])


def test_ours_and_theirs_are_the_same_when_one_is_put_into_the_other():
    arm = PlanarArm(3)
    same = {"outcomes": arm.outcomes, "rest": arm.rest, "outcome": achieved}
    back = FromGymnasium(ToGymnasium(arm), Angles(), **same, outcome_noise=0, steps=1, dt=1.0)
    check_environment(back)
    theta = arm.policies.sample(stream(0, "theta"))
    there, here = (each.execute(NO_CONTEXT, theta, stream(0, "any")) for each in (back, arm))
    assert there.tolist() == here.tolist()


class Angles:
    """The action is theta itself."""

    policies = Box.cube(0, 1, 3)

    def at(self, theta, times):
        return np.tile(theta, (len(times), 1))
