"""Gymnasium environments with continuous actions as environments of this library; each episode is one movement.

theta holds the parameters of a controller, which gives the actions; the outcome is a function of the observations.
    actions = Box(world.action_space.low, world.action_space.high)
    swimmer = FromGymnasium(world, Sinusoids(actions, (0.2, 2.0)), steps=150, outcome=travelled, outcomes=..., ...)
A controller of your own needs the two members of `Controller`. ``to_gymnasium.py`` converts in the other direction.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from copy import deepcopy
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.environments.motor_primitives import Controller
from sgimd_torch.environments.protocol import Primitive, SimulationError, check_movement, check_recording, check_robot
from sgimd_torch.extras.check.remarks import FEWEST, LATEST
from sgimd_torch.spaces import Array, Box, check_count, check_point, check_rng, stream

try:
    import gymnasium as gymnasium
except ImportError as error:
    raise ImportError(f"this environment needs gymnasium: pip install 'sgimd-torch[gym]' ({error})") from error

STARTS: Final = 1000  # number of different starts, where the start is the context


class FromGymnasium:
    """An environment of this library that plays episodes of a gymnasium environment.

    Each episode is reset with a seed drawn from ``rng``. So the random start of an episode counts as noise, or, with
    ``context``, as the context: this can be seen and not set, so only a context of one of the `STARTS` can be executed.
    Only one thread at a time may use the environment. After a warning MuJoCo resets its state, so a warning raises
    ``SimulationError``.

    Args:
        world: gymnasium environment with a Box of actions, with or without wrappers.
        controller: controller that turns theta into actions; the actions are clipped to the action space.
        outcomes: T.
        rest: ``(outcome_dim,)`` in T, the outcome of not moving.
        outcome_noise: standard deviation of each outcome dimension if a movement is repeated; see `measured_noise`.
        steps: largest number of actions of an episode; the world may end an episode earlier.
        outcome: function (list of all observations of an episode) -> outcome ``(outcome_dim,)``.
        dt: time between two actions (s); None for the ``dt`` of the world, which MuJoCo's environments have.
        contexts: C; None if the start of an episode counts as noise.
        context: function (first observation of an episode) -> context ``(context_dim,)``; None without ``contexts``.

    Raises:
        ValueError: the actions are no Box, there is no ``dt``, ``rest`` lies outside T, the world's time limit is below
            ``steps``, or only one of ``contexts`` and ``context`` is given.
    """

    def __init__(
        self,
        world: gymnasium.Env[Any, Any],
        controller: Controller,
        *,
        outcomes: Box,
        rest: ArrayLike,
        outcome_noise: float,
        steps: int,
        outcome: Callable[[Sequence[Any]], ArrayLike],
        dt: float | None = None,
        contexts: Box | None = None,
        context: Callable[[Any], ArrayLike] | None = None,
    ) -> None:
        if not isinstance(world.action_space, gymnasium.spaces.Box) or len(world.action_space.shape) != 1:
            raise ValueError(f"needs continuous actions, a gymnasium Box of one axis, got {world.action_space}")
        dt = getattr(world.unwrapped, "dt", None) if dt is None else dt
        if dt is None or not 0 < dt < np.inf:
            raise ValueError(f"needs dt > 0, the seconds between two actions, got {dt}; has the world no dt?")
        self.world, self.controller, self._actions = world, controller, world.action_space
        self.primitive = controller if isinstance(controller, Primitive) else Primitive()
        self.policies, self.outcomes = controller.policies, outcomes
        if (contexts is None) != (context is None):
            raise ValueError("contexts (C) and context, a function of the first observation, must be given together")
        self.contexts = Box.cube(0.0, 1.0, 0) if contexts is None else contexts
        self.rest = check_point("rest", rest, outcomes.dim).copy()
        self.rest.flags.writeable = False
        self.outcome_noise, self.steps, self.dt = float(outcome_noise), check_count("steps", steps, 1), float(dt)
        check_robot(self)
        if hasattr(controller, "correspondence"):
            self.correspondence = controller.correspondence
        name = "_max_episode_steps"  # of gymnasium's TimeLimit
        limit = world.get_wrapper_attr(name) if world.has_wrapper_attr(name) else None
        if limit is not None and limit < self.steps:
            raise ValueError(
                f"the world ends an episode after {limit} actions, but a movement has {self.steps}; make it with "
                f"gymnasium.make(..., max_episode_steps={self.steps}), or choose fewer steps"
            )
        self._outcome, self._context = outcome, context
        self._ended = deque[int](maxlen=LATEST)  # actions of each of the latest episodes that ended early, else 0

    @property
    def noticed(self) -> str:
        """Sentence about episodes that end early, "" if most do not; see `remarks_on`."""
        early = [n for n in self._ended if n]
        if 2 * len(early) < max(len(self._ended), FEWEST):
            return ""
        when = f"after {np.median(early):g} of {self.steps} actions (median): the later ones do nothing"
        return f"{len(early)} of the last {len(self._ended)} episodes ended early, {when}"

    def observe(self, rng: np.random.Generator) -> Array:
        """``(context_dim,)``, the context of a random start of an episode; it is empty if the start counts as noise.

        Raises:
            ValueError: the function ``context`` returns no context.
        """
        check_rng(rng)
        if self._context is None:
            return self.contexts.sample(rng)
        return self._seen(int(rng.integers(STARTS)))

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """``(outcome_dim,)``, the outcome of one episode; see `Environment`.

        Raises:
            ValueError: ``context`` is never observed, or the function ``outcome`` returns no outcome.
            SimulationError: MuJoCo gave a warning, or the outcome is not finite.
        """
        context, theta = check_movement(self, context, theta)
        check_rng(rng)
        seed = _seed(rng) if self._context is None else self._seeds.get(context.tobytes())
        if seed is None:
            raise ValueError(
                f"context {context.tolist()} is never observed: the start of an episode can be seen, not set; give a "
                "context from observe()"
            )
        actions = self.controller.at(theta, self.dt * np.arange(self.steps, dtype=np.float64))
        return self._play(actions, seed, theta, None if self._context is None else rng)

    def replay(self, times: ArrayLike, trajectory: ArrayLike) -> Array:
        """``(outcome_dim,)``, the outcome of recorded actions, always from the same start; see `Replaying`.

        Between recorded actions they are interpolated.
        """
        width, longest = self._actions.shape[0], self.dt * (self.steps - 1)
        times, actions = check_recording(times, trajectory, width, longest=longest)
        even = self.dt * np.arange(round((times[-1] - times[0]) / self.dt) + 1, dtype=np.float64)
        played = np.stack([np.interp(even, times - times[0], column) for column in actions.T], axis=1)
        return self._play(played, _seed(stream(0, "replay")), played[-1])

    def _seen(self, seed: int) -> Array:
        """The context of the start with this ``seed``."""
        assert self._context is not None
        first, _ = self.world.reset(seed=seed)
        context = np.array(np.ma.filled(self._context(first), np.nan), dtype=np.float64)
        return check_point("context", context, self.contexts.dim)

    @cached_property
    def _seeds(self) -> dict[bytes, int]:
        """The first seed of each context, alike in all processes and after ``--resume``."""
        return {self._seen(seed).tobytes(): seed for seed in reversed(range(STARTS))}

    def _play(self, actions: Array, seed: int, theta: Array, rng: np.random.Generator | None = None) -> Array:
        """The outcome of an episode of these ``actions``; a `SimulationError` names ``theta``.

        The noise of the world after its reset comes from ``rng``; None: from ``seed``, as the start does.
        """
        observation, _ = self.world.reset(seed=seed)
        if rng is not None:
            self.world.unwrapped.np_random = rng
        observations = [deepcopy(observation)]
        for action in np.clip(actions, self._actions.low, self._actions.high):
            observation, _, terminated, truncated, _ = self.world.step(action.astype(self._actions.dtype))
            observations.append(deepcopy(observation))
            if terminated or truncated:
                break
        made = len(observations) - 1
        self._ended.append(made if made < len(actions) else 0)
        warned = getattr(getattr(self.world.unwrapped, "data", None), "warning", None)
        if warned is not None and np.any(warned.number):
            raise SimulationError("MuJoCo gave a warning: the simulation diverged, or ran out of room", theta)
        outcome = np.array(np.ma.filled(self._outcome(observations), np.nan), dtype=np.float64)
        if not np.isfinite(outcome).all():
            raise SimulationError("the outcome is not finite", theta)
        return check_point("outcome", outcome, self.outcomes.dim)


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**31))


def measured_noise(environment: FromGymnasium, rng: np.random.Generator, *, movements: int = 20) -> float:
    """Measured ``outcome_noise``: root mean square deviation over random movements, each executed three times."""
    variances = []
    for _ in range(movements):
        context, theta = environment.observe(rng), environment.policies.sample(rng)
        outcomes = [environment.execute(context, theta, rng) for _ in range(3)]
        variances.append(np.var(outcomes, axis=0, ddof=1))
    return float(np.sqrt(np.mean(variances)))
