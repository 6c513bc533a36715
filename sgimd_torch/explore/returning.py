"""Global exploration where most movements do nothing: find what has an effect at all, return to it, vary it.

Our addition. Forestier et al. (2022) vary, to reach a goal for an object, a movement that had moved that object; Go-
Explore (Ecoffet et al. 2021) returns before it explores. How far to vary follows how often the effect persists, as the
success rule of evolution strategies does (Rechenberg 1973).
    explore = Returning(problem); theta = explore(context)
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.explore.widening import Widening, Width
from sgimd_torch.parts import Explore, Inverse, Problem
from sgimd_torch.spaces import Array

_ENOUGH: Final = 16  # effects, for an inverse model to learn from
_SHARE: Final = 0.1  # of movements for exploration then; more would scatter what is learnt
_ANYWHERE: Final = 0.5  # of these, in search of other effects
_NEAREST: Final = 10  # effects in the most similar contexts, of which one is varied


class Returning(Explore):
    """Widening; where effects are rare, varies movements that had one.

    It is `Widening` while every movement has an effect of its own. Else it moves anywhere in Pi, and as soon as
    something had an effect, every other time around a movement that had one in a similar context.

    Args:
        problem: ``effects`` of the inverse model are read. One that knows none, unlike `AmongEffects`, makes this
            `Widening` always.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.width, self._widening = problem.shared(Width, Width), Widening(problem)
        self._varied: Array | None = None  # the last variation
        inverse = type(problem.inverse)
        if inverse.effects is Inverse.effects:
            problem.remarks.append(f"exploration does not look for effects: {inverse.__name__} does not tell them")

    @property
    def share(self) -> float | None:
        """Share of global movements: 1 until enough of them had an effect, then few. None where all have an effect."""
        acted = self.problem.inverse.effects()
        return None if acted is None else _SHARE if len(acted) >= _ENOUGH else 1.0

    def __call__(self, context: Array) -> Array:
        """``(theta_dim,)`` the next movement."""
        acted, policies = self.problem.inverse.effects(), self.problem.policies
        if acted is None:
            return self._widening(context)
        if self._varied is not None:
            self.width.update(bool((acted.thetas == self._varied).all(axis=1).any()))
            self._varied = None
        if not len(acted) or self.rng.random() < _ANYWHERE:
            return policies.sample(self.rng)
        alike = np.linalg.norm(acted.contexts - context, axis=1).argsort(kind="stable")
        theta = acted.thetas[self.rng.choice(alike[:_NEAREST] if acted.context_dim else alike)]
        self._varied = policies.clip(self.rng.normal(theta, self.width.sd * policies.sides))
        return self._varied
