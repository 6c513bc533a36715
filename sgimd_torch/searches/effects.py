"""Effects: the exemplars whose movement had an effect, for robots most of whose movements have none.

Our addition. A movement that misses an object does not move it. So all movements without an effect have outcomes that
depend on the context alone: these outcomes lie on the *plateau*, an affine map of the context. RANSAC (Fischler &
Bolles 1981) finds the plateau: of many affine maps of the context, each through a few random exemplars, it takes the
one that fits most other exemplars.
    effects = Effects(memory, problem.outcome_noise); effective = effects()
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.memory import Memory
from sgimd_torch.memory.exemplars import Exemplars
from sgimd_torch.spaces import Array, stream

_FIRST: Final = 16  # number of exemplars at the first search for a plateau
_GROWTH: Final = 1.5  # factor by which the number of exemplars grows from one search to the next
_CANDIDATES: Final = 50  # number of candidate maps, each through the least number of exemplars that determine a map
_SAMPLED: Final = 300  # largest number of random exemplars on which the candidates are compared
_REFITS: Final = 5  # number of least squares fits that refine the best map
_NEAR: Final = 2.0  # distance from a plateau, in standard deviations, within which nearly all of its points lie
_WITHIN: Final = 4.0  # distance from a plateau, in standard deviations, within which all of its points lie
_ROUNDING: Final = 1e-9  # assumed noise if an environment has none, relative to the spread of outcomes
_LEAST_NUMBER: Final = 16  # least number of exemplars on a plateau
_LEAST_SHARE_AT_FIRST: Final = 0.5  # least share of all exemplars on a plateau when it is found
_LEAST_SHARE: Final = 0.1  # least share later, as more and more movements have an effect
_DENSE: Final = 0.9  # least share of the points within 4 sd that lie within 2 sd; without a plateau, about half do


class Effects:
    """Exemplars with an effect; they depend only on the arguments, because the random stream has a fixed seed.

    Args:
        memory: exemplars of the learner.
        outcome_noise: standard deviation of each outcome dimension, in the unit of T.
    """

    def __init__(self, memory: Memory, outcome_noise: float) -> None:
        self.memory = memory
        self.noise = outcome_noise * np.sqrt(memory.outcome_dim)
        self._due = float(_FIRST)  # number of exemplars at the next search for a plateau
        while self._due * _GROWTH <= len(memory):
            self._due *= _GROWTH
        self._plateau: Array | None = None  # (1 + context_dim, outcome_dim)
        self._seen = 0  # number of exemplars that `__call__` has sorted by their distance from the plateau

    def __call__(self) -> Memory | None:
        """Memory of the exemplars with an effect, perhaps empty; None if there is no plateau, because then every
        movement has an effect. The memory is a new object after each search for a plateau."""
        n = len(self.memory)
        while int(self._due) <= n:
            self._plateau = self._find_plateau(int(self._due))
            self._due, self._effective, self._seen = self._due * _GROWTH, self.memory.empty(), 0
        if self._plateau is None:
            return None
        distances = self._distances(self._plateau, slice(self._seen, n))
        rows = self._seen + np.flatnonzero(distances > _WITHIN * self._scale)
        self._effective.extend(*Exemplars.of(self.memory, rows))
        self._seen = n
        return self._effective

    def _find_plateau(self, n: int) -> Array | None:
        """The plateau of the first ``n`` exemplars; None if they have no plateau."""
        outcomes = self.memory.outcomes[:n]
        self._scale = max(self.noise, _ROUNDING * float(np.sqrt(outcomes.var(axis=0).sum())))
        rng = stream(n, "plateau")
        sampled = rng.permutation(n)[:_SAMPLED]
        n_points = 1 + self.memory.context_dim
        candidates = [self._fit(rng.choice(sampled, n_points, replace=False)) for _ in range(_CANDIDATES)]
        fits = [(self._distances(candidate, sampled) <= _NEAR * self._scale).sum() for candidate in candidates]
        plateau = candidates[int(np.argmax(fits))]
        for _ in range(_REFITS):
            distances = self._distances(plateau, slice(n))
            within = distances <= _WITHIN * self._scale
            plateau = self._fit(np.flatnonzero(within))
        n_within, n_near = within.sum(), (distances <= _NEAR * self._scale).sum()
        share = _LEAST_SHARE_AT_FIRST if self._plateau is None else _LEAST_SHARE
        is_plateau = n_within >= max(_LEAST_NUMBER, share * n) and n_near >= _DENSE * n_within
        return plateau if is_plateau else None

    def _fit(self, rows: np.ndarray) -> Array:
        """Affine map from contexts to outcomes, fitted to ``rows`` by least squares."""
        return np.asarray(np.linalg.lstsq(self._inputs(rows), self.memory.outcomes[rows], rcond=None)[0])

    def _distances(self, plateau: Array, rows: np.ndarray | slice) -> Array:
        """Distances ``(n,)`` of the outcomes in ``rows`` from the ``plateau``."""
        return np.asarray(np.linalg.norm(self.memory.outcomes[rows] - self._inputs(rows) @ plateau, axis=1))

    def _inputs(self, rows: np.ndarray | slice) -> Array:
        contexts = self.memory.contexts[rows]
        return np.concatenate((np.ones((len(contexts), 1)), contexts), axis=1)
