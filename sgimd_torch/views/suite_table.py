"""The table of a suite: errors relative to those of one learner, by task and number of movements.

print_table(table(errors_of(configs, titled)))
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from sgimd_torch.runs.config import Config
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import Interval, interquartile_mean, interval, point, rng, show

Key = tuple[str, str, int]
"""A task, a learner, and a number of movements."""


def errors_of(configs: Sequence[Config], titled: Callable[[str], str]) -> dict[Key, Array]:
    """Mean errors ``(n_seeds,)`` of finished runs; ``titled`` gives a task its name."""
    found: dict[Key, list[float]] = {}
    for config in configs:
        run = read_run(config.directory).evaluation
        for movements, error in zip(run["movements"].tolist(), run["mean_error"].tolist(), strict=True):
            found.setdefault((titled(config.out.name), config.variant, int(movements)), []).append(error)
    return {key: np.array(values) for key, values in found.items()}


def relative(errors: Mapping[Key, Array]) -> dict[Key, Interval]:
    """Mean error of each learner over that of the first, where both were evaluated.

    There is no interval with fewer than `LEAST_SEEDS`.
    """
    first = next(iter(errors))[1]
    found = {}
    for (task, learner, movements), ours in errors.items():
        theirs = errors.get((task, first, movements))
        if theirs is None or learner == first:
            continue
        if min(len(ours), len(theirs)) < 2:
            ratio = point(float(ours.mean() / theirs.mean()))
        else:
            ratio = interval(lambda one, other: one.mean(axis=-1) / other.mean(axis=-1), ours, theirs, rng=rng())
        found[task, learner, movements] = ratio
    return found


def table(errors: Mapping[Key, Array]) -> list[list[str]]:
    """A row for each task at each number of movements, then the interquartile mean over tasks; the first are heads."""
    ratios = relative(errors)
    tasks, (first, *others), times = (list(dict.fromkeys(values)) for values in zip(*errors, strict=True))
    rows = [["movements", "task", f"error of {first}", *others]]
    for movements in sorted(times):
        for task in tasks:
            base = errors.get((task, first, movements))
            found = [ratios.get((task, name, movements)) for name in others]
            cells = ["-" if ratio is None else show(ratio) for ratio in found]
            rows.append([str(movements), task, "-" if base is None else f"{base.mean():.4g}", *cells])
        over_tasks = [[r.value for (_, n, m), r in ratios.items() if (n, m) == (name, movements)] for name in others]
        means = [f"{interquartile_mean(np.array(values)):.2f}" if values else "-" for values in over_tasks]
        rows.append([str(movements), "interquartile mean", "", *means])
    return rows
