"""Rivals with the one setting that a search on tuning seeds found better than their defaults: results/RIVALS.md.

Not listed are those whose defaults stood. Each is a learner for ``--algorithm``, in the folder above:
    sgimd run --algorithm experiments.tuned_rivals:cma_me
"""

from __future__ import annotations

from sgimd_torch.algorithms import Correspondence
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.learner import Learner
from sgimd_torch.memory import Memory
from sgimd_torch.rivals import quality_diversity


def map_elites(environment: Environment, seed: int, *, memory: Memory | None = None) -> Learner:
    """With cells of twice the side."""
    return quality_diversity.map_elites(environment, seed, cells=10, memory=memory)


def cma_me(environment: Environment, seed: int, *, memory: Memory | None = None) -> Learner:
    """With a smaller first step."""
    return quality_diversity.cma_me(environment, seed, sd=0.05, memory=memory)


def cma_mae_taught(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    imitations: int = 10,
    epsilon: float = 0.05,
    memory: Memory | None = None,
) -> Learner:
    """With a smaller first step, and shown the same as SGIM-D."""
    return quality_diversity.cma_mae(
        environment,
        seed,
        sd=0.05,
        correspondence=correspondence,
        imitations=imitations,
        epsilon=epsilon,
        memory=memory,
    )
