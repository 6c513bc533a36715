"""The forward model of a run, from its files: what it predicted before it learnt from it, how sure it was, when asked.

model = model_run(run); np.linalg.norm(model.observed - model.mean, axis=1); model.inside(slice(-1000, None))
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sgimd_torch.forward_model.diagnostics import LEVELS, TRUSTED_UP_TO, coverage
from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.read import Run, read_run
from sgimd_torch.runs.tables import WHOLE, small_table
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
    """The forward model of a run, finished or not; predictions of movements that its log lacks are left out.

    Raises:
        RunError: it has no model, has predicted nothing yet, or its files are damaged or do not belong together.
    """
    path, file = run.path, run.path / "predictions.csv"
    if run.predictions is None:
        raise RunError(f"{path} has no {file.name}: it ran without a forward model; see --inverse model of sgimd run")
    exemplars, *values = _checked(run, file.name, run.predictions).values()
    lived = np.flatnonzero(np.isfinite(run.outcomes).all(axis=1))
    rows = exemplars[exemplars < len(lived)]
    if not len(rows):
        raise RunError(f"{file} holds no prediction of a movement yet; the model learns from 50 before its first")
    if (np.diff(exemplars) <= 0).any():
        raise RunError(f"{file} must name exemplars by whole numbers that increase; was it edited?")
    observed, mean, epistemic, aleatoric = np.split(np.stack(values, axis=1)[: len(rows)], 4, axis=1)
    differ = (observed != run.outcomes[lived[rows]]).any(axis=1)
    if differ.any():
        raise RunError(f"{file}: exemplar {rows[differ][0]} is another one in episodes.csv; is it another run's file?")
    spread = np.hypot(epistemic, aleatoric)
    if not (spread > 0).all():
        raise RunError(f"{file}: exemplar {rows[(spread <= 0).any(axis=1)][0]} has a spread of 0; was it edited?")
    if run.refreshes is None:
        raise RunError(f"{path}/refreshes.csv is missing; was it deleted?")
    refreshes = _checked(run, "refreshes.csv", run.refreshes)
    if not len(refreshes["diverged"]) or not np.isin(refreshes["diverged"], (0, 1)).all():
        raise RunError(f"{path}/refreshes.csv must hold a refresh, and 0 or 1 for diverged; was it cut or edited?")
    return ModelRun(run, lived[rows], observed, mean, spread, refreshes)


def _checked(run: Run, name: str, table: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The ``table`` of a model as it is.

    Raises:
        RunError: it is damaged, or has other outcomes.
    """
    path, bad = run.path / name, run.damage.get(name, 1)
    names = small_table(path, run.outcomes.shape[1]).names
    if name not in run.damage and tuple(table) == names:
        return table
    line = path.read_text(errors="replace").split("\n")[bad - 1][:60]
    if bad == 1:
        raise RunError(f"{path} must begin with {','.join(names)}, got {line}; was it edited?")
    whole = ", ".join(column for column in names if column in WHOLE)
    wanted = f"{len(names)} numbers" + ("" if name in run.unchecked else " and their checksum")
    raise RunError(f"{path}, line {bad}: needs {wanted}, got {line!r} (whole ones for {whole}); was it edited?")
