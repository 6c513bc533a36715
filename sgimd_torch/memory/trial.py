"""Trial of a memory of a user's: whether it finds the nearest exemplars."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from sgimd_torch.memory.growing import Growing
from sgimd_torch.spaces import stream

if TYPE_CHECKING:
    from sgimd_torch.memory import Memory

_N: Final = 40  # number of exemplars in the trial
_ASKED: Final = 10  # number of neighbours that are asked for


def check_memory(memory: Memory) -> None:
    """Refuse a memory that answers a few questions wrongly.

    Raises:
        ValueError: it does not find rows that exist, as many as asked, nearest first.
    """
    rng, trial, name = stream(0, "check of a memory"), memory.empty(), type(memory).__name__
    dims = memory.context_dim, memory.theta_dim, memory.outcome_dim
    contexts, thetas, outcomes = (rng.random((_N, dim)) for dim in dims)
    trial.extend(contexts, thetas, outcomes)
    by_outcome, by_theta = np.hstack((contexts, outcomes)), np.hstack((contexts, thetas))
    asked = {
        "near_outcomes": (trial.near_outcomes(contexts[0], outcomes[0], _ASKED), by_outcome),
        "near_policies": (trial.near_policies(contexts[0], thetas[0], _ASKED), by_theta),
        "neighbourhoods": (trial.neighbourhoods(np.zeros(1, np.int64), _ASKED)[0], by_theta),
        "index": (trial.index(Growing(by_theta.shape[1], by_theta)).nearest(by_theta[:1], _ASKED)[0], by_theta),
    }
    for method, (rows, keys) in asked.items():
        what = f"memory {name}: of {_N} exemplars, {method} gave the rows {np.asarray(rows).tolist()}"
        if len(rows) < _ASKED:
            raise ValueError(f"{what}, which are fewer than the {_ASKED} asked for")
        if min(rows) < 0 or max(rows) >= _N:
            raise ValueError(f"{what}, of which some do not exist")
        if (np.diff(np.linalg.norm(keys[rows] - keys[0], axis=1)) < 0).any():
            raise ValueError(f"{what}, which are not in order; the nearest must come first")
