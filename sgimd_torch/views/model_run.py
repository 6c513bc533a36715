"""The forward model of a run, from its record: what it predicted before it learnt from it, how sure it was, when asked.

model = model_run(run); np.linalg.norm(model.observed - model.mean, axis=1); model.inside(slice(-1000, None))
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sgimd_torch.forward_model.diagnostics import LEVELS, TRUSTED_UP_TO, coverage
from sgimd_torch.record import RunError
from sgimd_torch.runs.read import Run, read_run
from sgimd_torch.spaces import Array


@dataclass(frozen=True, eq=False)
class ModelRun:
    """What the forward model of one run predicted.

    ``movements`` ``(n,)``: executed before each of the predicted ones; ``observed``, ``mean`` and ``spread``
    ``(n, outcome_dim)`` m; ``refreshes`` ``(n_refreshes,)`` for each of its columns.
    """

    run: Run
    movements: NDArray[np.int64]
    observed: Array
    mean: Array
    spread: Array
    refreshes: dict[str, np.ndarray]

    @property
    def name(self) -> str:
        """Such as "sgim-d/seed-003"."""
        return "/".join(self.run.path.resolve().parts[-2:])

    @property
    def asked(self) -> NDArray[np.bool_]:
        """``(n_movements,)`` whether the model was trusted at each movement: the last refresh before it decides."""
        last = np.searchsorted(self.refreshes["movements"], self.run.index, side="right") - 1
        return (last >= 0) & (self.refreshes["relative_error"] <= TRUSTED_UP_TO)[last]

    def inside(self, chosen: slice | NDArray[np.bool_], levels: ArrayLike = LEVELS) -> Array:
        """Coverage ``(n_levels,)`` of the ``chosen`` predictions; NaN if there are none."""
        observed, mean, spread = (values[chosen] for values in (self.observed, self.mean, self.spread))
        return coverage(observed, mean, spread, levels) if len(observed) else np.full(np.shape(levels), np.nan)


def read_model_run(path: Path) -> ModelRun:
    """The forward model of the run at a path; see `model_run`."""
    return model_run(read_run(path))


def model_run(run: Run) -> ModelRun:
    """The forward model of a run, finished or not.

    Raises:
        RunError: it has no model, or its model has predicted nothing yet.
    """
    if run.predictions is None or run.refreshes is None:
        raise RunError(
            f"{run.path} holds no prediction of a forward model: it ran without one (--inverse model of sgimd run), or "
            "is too short for one, which learns from 50 movements before its first prediction"
        )
    exemplars, *columns = run.predictions.values()
    executed = np.flatnonzero(np.isfinite(run.outcomes).all(axis=1))
    observed, mean, epistemic, aleatoric = np.split(np.stack(columns, axis=1), 4, axis=1)
    return ModelRun(run, executed[exemplars], observed, mean, np.hypot(epistemic, aleatoric), run.refreshes)
