"""The forward models in a report: how wrong, how sure, when they were asked, what they cost; a table and a figure.

table, missing = errors_of(variants); source = over_time(life)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from sgimd_torch.figures.predictions import coverage_over_time, error_over_time
from sgimd_torch.forward_model.diagnostics import LEVELS, TRUSTED_UP_TO, running
from sgimd_torch.runs.log import RunError
from sgimd_torch.views.model_run import ModelRun, model_run
from sgimd_torch.views.report.data import Life, Variant
from sgimd_torch.views.report.figures import png
from sgimd_torch.views.report.record import Table

NEWEST: Final = 1000  # predictions
LEVEL: Final = 0.8  # of the regions
NOT_ASKED: Final = "#f3e3bf"  # where the model was not asked
WINDOW: Final = 100  # predictions, from one point of a curve to the next
HEAD: Final = (
    *("predictions", f"error, last {NEWEST} (m)", f"inside the {LEVEL:.0%} region (%)", "asked from movement"),
    *("asked in movements (%)", "refreshes", "diverged", "training (s)", "share of the time (%)"),
)


def errors_of(variants: Sequence[Variant]) -> tuple[Table, list[str]]:
    """A row for each run with a forward model, and a sentence for each whose model cannot be shown."""
    rows, missing = [], []
    for variant in variants:
        for life in variant.lives:
            if life.predictions is not None:
                name = f"{variant.label}, seed {life.seed}"
                try:
                    rows.append((name, _row(model_run(life), life)))
                except RunError as error:
                    missing.append(f"{name}: {error}.")
    return Table(list(HEAD), rows), missing


def drawable(life: Life) -> bool:
    """Whether it has a forward model that can be shown."""
    try:
        model_run(life)
    except RunError:
        return False
    return True


@png
def over_time(figure: Figure, life: Life) -> None:
    """Error and coverage of a run's predictions against movements, shaded where it was not asked."""
    figure.set_size_inches(6.4, 6.4)
    model = model_run(life)
    windows = running(model.observed, model.mean, model.spread, WINDOW)
    ends = (model.movements[windows.last] + 1).astype(np.float64)
    above, below = figure.subplots(2, 1, sharex=True)
    error_over_time(above, ends, windows.errors)
    coverage_over_time(below, ends, windows.coverages[:, LEVELS.index(LEVEL)])
    asked = model.asked
    for ax in (above, below):
        ax.fill_between(
            life.index, 0, 1, where=~asked, step="post", transform=ax.get_xaxis_transform(), color=NOT_ASKED, zorder=0
        )
    above.plot([], [], color=NOT_ASKED, linewidth=8, label=f"not asked: relative error above {TRUSTED_UP_TO:g}")
    above.set_xlabel("")
    above.legend()


def _row(model: ModelRun, life: Life) -> list[str]:
    errors, asked = np.linalg.norm(model.observed - model.mean, axis=1)[-NEWEST:], model.asked
    refreshes, seconds = model.refreshes, life.seconds("model")
    whole = seconds + sum(life.seconds(part) for part in ("physics", "learner", "evaluation"))
    return [
        str(len(model.observed)),
        f"{errors.mean():.3f}",
        f"{100 * model.inside(slice(-NEWEST, None))[LEVELS.index(LEVEL)]:.0f}",
        str(asked.argmax()) if asked.any() else "never",
        f"{100 * asked.mean():.0f}",
        str(len(refreshes["diverged"])),
        str(int(refreshes["diverged"].sum())),
        *(f"{value:.{n}f}" if np.isfinite(value) else "–" for value, n in ((seconds, 1), (100 * seconds / whole, 0))),
    ]
