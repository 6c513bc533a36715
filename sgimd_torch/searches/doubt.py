"""Another hill: when to leave the movements that are known, and when to believe a movement that nothing explains.

Our addition. A map from Pi to T may have two hills, and most movements lie on one of them. A single movement that hits
the other one looks like a gross error, and answers from the first hill miss goals of the other one by a known distance.
    doubt = Doubt(problem); doubt.add(theta); theta = doubt.next(); instead = Stuck(problem)(estimate, goal)
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.memory.growing import Growing
from sgimd_torch.memory.reached import Reached
from sgimd_torch.parts import Problem
from sgimd_torch.searches.vary import Vary
from sgimd_torch.spaces import Array, Estimate

_FIRST: Final = 40  # number of new exemplars from which on movements are doubted
_AGAIN: Final = 0.005  # standard deviation of a repetition, relative to the sides of Pi
_NOVEL: Final = 0.25  # least distance to all other outcomes, relative to how far off the outcome is
_KNOWN: Final = 3.0  # a miss is known from so many standard deviations of the outcome on
_NEARBY: Final = 0.5  # distance of goals that count as near, relative to the miss
_NEAR_CONTEXT: Final = 0.25  # distance of contexts that count as near, relative to the sides of C
_MISSES: Final = 10  # number of known misses near a goal after which a learner is stuck there
_PROGRESS: Final = 0.8  # factor of the miss, compared with the oldest of these, below which it makes progress


class Doubt:
    """Repeats a global movement once, if similar movements do not explain its outcome, and no other outcome is near.

    If the outcome comes again, it is `Reached.confirmed`: two movements explain each other, so the inverse model takes
    neither for a gross error.

    Args:
        problem: problem to learn, with the inverse model.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem, self.reached = problem, problem.shared(Reached, Reached)
        self._vary, self._begun = Vary(problem, sd=_AGAIN).varied, len(problem.memory)
        self._unseen: list[int] = []  # rows that are still to be looked at
        self._doubted: list[tuple[Array, Array, float]] = []  # theta and outcome, and how far off that is
        self._repeated: list[tuple[Array, Array, float]] = []  # the same, with theta of the repetition

    def __len__(self) -> int:
        """Number of movements to be repeated."""
        return len(self._doubted)

    def next(self) -> Array:
        """The repetition ``(theta_dim,)`` of a doubted movement."""
        theta, outcome, off = self._doubted.pop(0)
        theta = self._vary(theta)
        self._repeated.append((theta, outcome, off))
        return theta

    def add(self, theta: Array) -> None:
        """A global movement ``(theta_dim,)`` was executed; it is the last exemplar in memory."""
        memory = self.problem.memory
        for k, (repetition, first, off) in enumerate(self._repeated):
            if np.array_equal(repetition, theta):
                del self._repeated[k]
                again = self.problem.outcomes.unwrapped(memory.outcomes[-1], first)
                if np.linalg.norm(again - first) < off / 2:
                    self.reached.confirmed.append((again + first) / 2)
                return
        self.reached.rows.append(len(memory) - 1)
        self._unseen.append(len(memory) - 1)
        while len(memory) - self._begun >= _FIRST and self._unseen and not self._doubted:
            self._look(self._unseen.pop(0))

    def _look(self, row: int) -> None:
        memory = self.problem.memory
        theta, outcome = memory.thetas[row], memory.outcomes[row]
        off = self.problem.inverse.unexplained(memory.contexts[row], theta, outcome)
        if off > 0:
            others = self.problem.outcomes.distance(np.delete(memory.outcomes, row, axis=0), outcome)
            if others.min() > _NOVEL * off:
                self._doubted.append((theta, outcome, off))


class Stuck:
    """Whether goals near one were answered again and again by a movement that is known to miss them.

    Args:
        problem: problem to learn.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._misses = Growing(problem.contexts.dim + problem.outcomes.dim + 1)  # context, goal, distance missed

    def __call__(self, estimate: Estimate, goal: Array) -> bool:
        """Whether this ``estimate`` for a ``goal`` is a known miss, and ten earlier ones near it were no worse."""
        if estimate.expected is None or not estimate.sd:
            return False
        miss = float(np.linalg.norm(estimate.expected - goal))
        if miss <= _KNOWN * estimate.sd * np.sqrt(len(goal)):
            return False
        c, known = len(estimate.context), self._misses.rows
        distances = self._problem.outcomes.distance(known[:, c:-1], goal)
        in_contexts = np.linalg.norm((known[:, :c] - estimate.context) / self._problem.contexts.sides, axis=1)
        near = np.flatnonzero((distances <= _NEARBY * miss) & (in_contexts <= _NEAR_CONTEXT))[-_MISSES:]
        self._misses.append(np.concatenate((estimate.context, goal, [miss]))[None])
        return len(near) == _MISSES and miss > _PROGRESS * (known[near[0], -1] - distances[near[0]])
