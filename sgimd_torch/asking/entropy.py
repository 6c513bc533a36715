"""Rival by entropy: it asks when a demonstration is expected to reduce entropy more than the learner's own movement.

After Kulak & Calinon (2023), "Combining social and intrinsically-motivated learning for multi-task robot skill
acquisition". They compute the mean epistemic entropy of the policies for random goals, and its expected reduction by
each strategy. The learner asks for a demonstration of the goal with the greatest epistemic entropy.
    learner = sgim_im(environment, seed, correspondence=..., teachers={"ann": ann}, goals=EntropyGoals)
Here a Gaussian process models the policy for a goal, so that reductions have a closed form. The outcome of a strategy
at a goal is predicted from the nearest earlier attempt of the strategy.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from sgimd_torch.asking.interest import AUTONOMOUS, StrategicGoals
from sgimd_torch.goals.checks import check_attempt, check_in
from sgimd_torch.inverses.gaussian_process import one_thread
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array, Box

_GOALS: Final = 30  # number of random goals over which entropy is averaged
_KNOWN: Final = 400  # largest number of exemplars to which the Gaussian process is fitted
_NOISE: Final = 0.1  # variance of the noise of one exemplar, in units of the prior variance
_LENGTH: Final = 0.1  # length scale of the kernel, relative to the sides of C x T


@one_thread
def doubt(known: Array, points: Array) -> Array:
    """Posterior covariance of the policies for ``points``, by a Gaussian process from C x T to policies.

    Deviation: Kulak & Calinon take a Bayesian mixture of Gaussians.

    Args:
        known: ``(n, dim)`` exemplars, relative to the sides of C x T.
        points: ``(m, dim)`` points, relative to the sides of C x T.

    Returns:
        ``(m, m)`` covariances, given the exemplars; 1 on the diagonal where nothing is known.
    """
    known = _thinned(known)
    across = _covariances(points, known)
    inner = _covariances(known, known) + _NOISE * np.eye(len(known))
    return _covariances(points, points) - across @ np.linalg.solve(inner, across.T)


def _covariances(one: Array, other: Array) -> Array:
    """Matern 5/2 kernel ``(n, m)`` between the rows of two arrays."""
    distances = np.sqrt(5) * cdist(one, other) / _LENGTH
    covariances: Array = (1 + distances + distances**2 / 3) * np.exp(-distances)
    return covariances


class EntropyGoals(StrategicGoals):
    """Goals and strategies by the expected reduction of entropy, for learners that ask teachers.

    Args:
        problem: problem to learn.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.memory, contexts, outcomes = problem.memory, problem.contexts, problem.outcomes
        self._box = Box(np.concatenate((contexts.low, outcomes.low)), np.concatenate((contexts.high, outcomes.high)))
        self._tried: dict[str, list[tuple[Array, Array]]] = {}  # goal, and outcome minus goal, in sides of C x T

    def choose(self, context: ArrayLike, costs: Mapping[str, float]) -> tuple[str, Array]:
        """The strategy with the greatest expected reduction of entropy for its cost, and a goal ``(outcome_dim,)`` for
        this strategy.

        Raises:
            ValueError: ``context`` is not one point of C.
        """
        context = check_in(self.problem.contexts, "context", context)
        goals = np.stack([self.problem.outcomes.sample(self.rng) for _ in range(_GOALS)])
        points = self._scaled(np.tile(context, (_GOALS, 1)), goals)
        places = [points, *(self._landing(points, name) for name in costs)]
        known = self._scaled(self.memory.contexts, self.memory.outcomes)
        covariance = doubt(known, np.concatenate(places))
        entropies = _entropy(np.diag(covariance)[:_GOALS])
        doubtful = int(entropies.argmax())
        found = dict[str, float]()
        for number, (name, cost) in enumerate(costs.items(), 1):
            aimed = range(_GOALS) if name == AUTONOMOUS else [doubtful]  # an autonomous attempt may have any goal
            reductions = [_reduction(covariance, entropies, number * _GOALS + goal) for goal in aimed]
            found[name] = float(np.mean(reductions)) / cost
        name = max(found, key=lambda each: found[each])
        return name, goals[0 if name == AUTONOMOUS else doubtful]

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = AUTONOMOUS, gain: float = 0.0
    ) -> None:
        """Remember the goal and the outcome of an attempt; its outcome is the last one in memory.

        Raises:
            ValueError: see `Goals.add`.
        """
        point = check_attempt(self.problem, context, goal, competence, gain)
        goals, last = (
            (point - self._box.low) / self._box.sides,
            self._scaled(self.memory.contexts, self.memory.outcomes),
        )  # A request without a reply (gain -1) teaches nothing, like an attempt whose outcome was known before.
        missed = np.full(len(point), np.nan) if gain == -1.0 else last[-1] - goals
        self._tried.setdefault(strategy, []).append((goals, missed))

    def _landing(self, points: Array, strategy: str) -> Array:
        """Expected outcomes of attempts at ``points``: the difference from the goal is that of the nearest earlier
        attempt of the strategy. A strategy without attempts is expected to meet each goal."""
        tried = self._tried.get(strategy)
        if not tried:
            return points
        goals, missed = (np.array(each) for each in zip(*tried, strict=True))
        landed = points + missed[cdist(points, goals).argmin(axis=1)]
        known = self._scaled(self.memory.contexts[:1], self.memory.outcomes[:1])
        found: Array = np.where(np.isnan(landed), known if len(known) else points, landed)
        return found

    def _scaled(self, contexts: Array, outcomes: Array) -> Array:
        scaled: Array = (np.concatenate((contexts, outcomes), axis=1) - self._box.low) / self._box.sides
        return scaled


def _thinned(known: Array) -> Array:
    return known[:: 1 + len(known) // _KNOWN]


def _entropy(variances: Array) -> Array:
    """Entropy of Gaussians with these variances, up to a constant."""
    return 0.5 * np.log(np.maximum(variances, 0) + _NOISE)


def _reduction(covariance: Array, entropies: Array, place: int) -> float:
    """Reduction of the mean entropy of the goals (the first points) by one more exemplar at point number ``place``."""
    n, variances = len(entropies), np.diag(covariance)
    after = variances[:n] - covariance[:n, place] ** 2 / (variances[place] + _NOISE)
    return float((entropies - _entropy(after)).mean())
