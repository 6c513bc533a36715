"""Environments of this library as goal environments of gymnasium: an episode is one movement, the action is theta.

world = ToGymnasium(PlanarArm()); observation, _ = world.reset(seed=0); world.step(world.action_space.sample())
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.environments.protocol import Environment
from sgimd_torch.extras.gymnasium.from_gymnasium import gymnasium
from sgimd_torch.spaces import Array, Box, check_point

Observation = dict[str, Array]


class ToGymnasium(gymnasium.Env[Any, Any]):
    """A goal environment of one step.

    ``observation`` is the context, or a constant 0 without contexts; ``achieved_goal`` is the outcome (``rest`` before
    the movement), ``desired_goal`` the goal. Goal and context are drawn, or given as ``reset(options={"goal": ...,
    "context": ...})``. The reward is minus the distance of the outcome from the goal. ``info["is_success"]`` is true if
    this distance is at most .02, or at most the outcome noise.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - as gymnasium declares it

    def __init__(self, environment: Environment) -> None:
        self.environment = environment
        # Learners such as those of stable-baselines3 need an observation of at least one number.
        contexts = environment.contexts if environment.contexts.dim else Box.cube(0.0, 1.0, 1)
        anywhere = gymnasium.spaces.Box(-np.inf, np.inf, (environment.outcomes.dim,), np.float64)  # also outside T
        goals = {"achieved_goal": anywhere, "desired_goal": _box(environment.outcomes)}
        self.observation_space: gymnasium.spaces.Dict[Any] = gymnasium.spaces.Dict(
            {"observation": _box(contexts), **goals}
        )
        self.action_space: gymnasium.spaces.Box[Any] = _box(environment.policies)
        self._goal: Array | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """A new context and goal.

        Raises:
            ValueError: a goal outside T or a context outside C.
        """
        super().reset(seed=seed)
        wanted, robot = options or {}, self.environment
        self._context = robot.contexts.check("context", wanted.get("context", robot.observe(self.np_random)))
        drawn = robot.outcomes.sample(self.np_random)
        self._goal = robot.outcomes.check("goal", wanted.get("goal", drawn), "was a theta passed instead?")
        return self._observation(robot.rest), {}

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Execute the movement ``action`` ``(theta_dim,)``, which ends the episode.

        Raises:
            RuntimeError: the episode has ended.
            ValueError: a theta outside Pi.
        """
        if self._goal is None:
            raise RuntimeError("step() needs a reset() first: an episode is one movement")
        theta = check_point("action", np.asarray(action, dtype=np.float64), self.environment.policies.dim)
        outcome = self.environment.execute(self._context.copy(), theta, self.np_random)
        observation = self._observation(outcome)
        distance = float(self.environment.outcomes.distance(outcome, self._goal))
        info = {"is_success": distance <= max(self.environment.outcome_noise, 0.02)}
        self._goal = None
        return observation, -distance, True, False, info

    def compute_reward(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Any = None) -> Array:
        """Minus the distances ``(...)`` between the two goals ``(..., outcome_dim)``, for hindsight relabelling."""
        return -self.environment.outcomes.distance(np.asarray(achieved_goal), np.asarray(desired_goal))

    def _observation(self, outcome: Array) -> Observation:
        assert self._goal is not None
        return {
            "observation": self._context.copy() if self._context.size else np.zeros(1),
            "achieved_goal": np.array(outcome, dtype=np.float64),
            "desired_goal": self._goal.copy(),
        }


def _box(box: Box) -> gymnasium.spaces.Box[Any]:
    return gymnasium.spaces.Box(box.low, box.high, dtype=np.float64)
