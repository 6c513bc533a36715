"""Settings of the rivals, searched on tuning seeds: each line changes one keyword of a rival, or two, from its default.

Rivals deserve the search that our own defaults had (results/TUNING.md). Each setting learns on the rod with each seed;
its memory is answered by ``LocallyLinear`` and by ``LocalProcess``, the yardsticks of the pages of results, on a
benchmark of its own, never the shipped one. Rows go to results/rivals.csv; what is there is not run again.

Examples:
  python scripts/make_benchmark.py --seed 3000 --out tuning.npz
  python experiments/tune_rivals.py --benchmark tuning.npz                    everything: an hour on two cores
  python experiments/tune_rivals.py --benchmark tuning.npz --only cma-mae --seeds 1000-1002
  python experiments/tune_rivals.py --benchmark tuning.npz --best 3 --seeds 1002-1003    more seeds for the best
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from sgimd_torch.runs.process import command, loading, say

with loading():  # Ctrl-C shows no traceback
    import pandas as pd

    from page_tables import DEFAULT
    from sgimd_torch import (
        FishingRod,
        InitialTeacher,
        LocallyLinear,
        PeriodicTeacher,
        evaluate,
        load_demonstrations,
        run,
        sgim_d,
        stream,
    )
    from sgimd_torch.evaluation import Benchmark, load_benchmark
    from sgimd_torch.goals.uniform import UniformGoals
    from sgimd_torch.inverses.local_process import LocalProcess
    from sgimd_torch.inverses.nearest import NearestNeighbour
    from sgimd_torch.learner import Learner
    from sgimd_torch.rivals.quality_diversity import cma_mae, cma_me, isoline, map_elites
    from sgimd_torch.runs.sweep import add_options
    from sgimd_torch.searches.perturb import Perturb
    from table import Row, merge, read_table

TABLE, FIRST_TUNING_SEED = "rivals.csv", 1000
Setting = dict[str, Any]
NOBODY = None
EVERY_30 = partial(PeriodicTeacher, every=30)
AT_ONCE = partial(InitialTeacher, every=1)


class Rival(NamedTuple):
    """What makes it, what makes its teacher, and the settings that are tried; {} is its default."""

    make: Any
    teacher: Any
    settings: Sequence[Setting]


def baseline(rod: FishingRod, seed: int, *, correspondence: Any, sd: float = 0.05, budget: int = 15) -> Learner:
    """The field's standard one: uniform goals, demonstrations, noise around the nearest movement."""
    search = partial(Perturb, sd=sd)
    return sgim_d(
        rod,
        seed,
        correspondence=correspondence,
        goals=UniformGoals,
        inverse=NearestNeighbour,
        search=search,
        budget=budget,
    )


def one_by_one(**values: Sequence[Any]) -> list[Setting]:
    """The default, then each value of each keyword alone."""
    return [{}, *({name: value} for name, found in values.items() for value in found)]


_TEAM = one_by_one(emitters=(1, 3, 10, 15), sd=(0.05, 0.2, 0.3), batch=(8, 30), cells=(10, 40))
_ELITES = one_by_one(first=(30, 300), batch=(5, 30), cells=(10, 40))
RIVALS = {
    "cma-mae": Rival(cma_mae, NOBODY, [*_TEAM, *({"learning_rate": rate} for rate in (0.001, 0.1, 0.5))]),
    "cma-mae-demonstrations": Rival(
        cma_mae, EVERY_30, [*_TEAM, *one_by_one(imitations=(3, 20), epsilon=(0.02, 0.1))[1:]]
    ),
    "cma-mae-demonstrations-once": Rival(
        partial(cma_mae, imitations=1),
        AT_ONCE,
        one_by_one(emitters=(1, 10), sd=(0.05, 0.2), batch=(8,), cells=(10, 40)),
    ),
    "cma-me": Rival(cma_me, NOBODY, _TEAM),
    "map-elites": Rival(map_elites, NOBODY, [*_ELITES, *({"sd": sd} for sd in (0.02, 0.1, 0.15))]),
    "map-elites-demonstrations": Rival(
        map_elites, EVERY_30, one_by_one(first=(10, 300), batch=(30,), cells=(10,), imitations=(3, 20))
    ),
    "isoline": Rival(isoline, NOBODY, [*_ELITES, *one_by_one(sd=(0.01, 0.05), line=(0.1, 0.4))[1:]]),
    "isoline-demonstrations": Rival(isoline, EVERY_30, one_by_one(sd=(0.01, 0.05), first=(10,), imitations=(3, 20))),
    "random-goals-demonstrations": Rival(baseline, EVERY_30, one_by_one(sd=(0.02, 0.1), budget=(1, 2, 4, 8, 30))),
}


def errors_of(
    name: str, setting: Setting, seed: int, benchmark: Benchmark, times: Sequence[int]
) -> list[tuple[float, float]]:
    """The errors (m) of a rival by both yardsticks after each of ``times`` movements, which increase."""
    rival, rod = RIVALS[name], FishingRod(threads=1)
    teacher, taught = None, dict[str, Any]()
    if rival.teacher is not NOBODY:
        teacher = rival.teacher(load_demonstrations(), stream(seed, "teacher"))
        taught = {"correspondence": rod.primitive.correspondence}
    learner = rival.make(rod, seed, **taught, **setting)
    found = []
    for episode in run(learner, rod, seed, movements=max(times), teacher=teacher):
        if episode.index + 1 in times:
            judged = (rod, benchmark.goals, seed, episode.index + 1)
            linear, process = LocallyLinear(learner.problem), LocalProcess(learner.problem)
            linear_error, process_error = (evaluate(each, *judged, repeats=0).mean_error for each in (linear, process))
            found.append((linear_error, process_error))
    return found


def in_words(setting: Setting) -> str:
    """A setting as a field of the table: ``sd=0.2``; ``default`` for none."""
    return " ".join(f"{name}={value}" for name, value in setting.items()) or DEFAULT


def means(table: pd.DataFrame, names: Sequence[str], last: int) -> pd.DataFrame:
    """Errors (m) of each setting of each rival after the ``last`` movements, over its seeds; the best first."""
    table = table[table.rival.isin(names) & (table.movements == last)]
    found = table.groupby(["rival", "setting"], as_index=False).agg(
        linear=("linear", "mean"), process=("process", "mean"), seeds=("seed", "count")
    )
    return found.assign(both=found.linear + found.process).sort_values(["rival", "both"]).drop(columns="both")


def main(argv: Sequence[str] | None = None) -> int:
    """Run what is missing in the table, then print the mean of each setting over its seeds, the best first.

    Raises:
        ValueError: seeds below 1000, which are for development and final rows; a benchmark that does not fit.
        OSError: a file cannot be read or written.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--benchmark", type=Path, required=True, help="goals to tune on, of scripts/make_benchmark.py")
    parser.add_argument("--only", nargs="+", choices=RIVALS, default=list(RIVALS), help="only these rivals")
    add_options(parser, seeds="1000-1001")
    parser.add_argument("--best", type=int, metavar="N", help="only the default and the N best settings of other seeds")
    parser.add_argument("--times", type=int, nargs="+", default=[1000, 5000], help="movements before evaluations")
    parser.add_argument(
        "--results", type=Path, default=Path("results"), help="folder of rivals.csv (default: %(default)s)"
    )
    options = parser.parse_args(argv)
    if min(options.seeds) < FIRST_TUNING_SEED:
        raise ValueError(f"seeds must be {FIRST_TUNING_SEED} or more, got {min(options.seeds)}; others are judged by")
    table, benchmark, times = (
        read_table(options.results, TABLE),
        load_benchmark(options.benchmark),
        sorted(options.times),
    )
    benchmark.check(FishingRod())
    known = {*table[["rival", "setting", "seed", "movements"]].itertuples(index=False, name=None)}
    others = means(table[~table.seed.isin(options.seeds)], options.only, times[-1])
    good = {*others.groupby("rival").head(options.best)[["rival", "setting"]].itertuples(index=False, name=None)}
    good |= {(name, DEFAULT) for name in options.only}
    with ProcessPoolExecutor(options.processes) as pool:
        waiting: dict[Future[list[tuple[float, float]]], list[Row]] = {}
        for seed, name in product(options.seeds, options.only):
            for setting in RIVALS[name].settings:
                words = in_words(setting)
                missing = not {(name, words, seed, when) for when in times} <= known
                if missing and (options.best is None or (name, words) in good):
                    rows = [{"rival": name, "setting": words, "seed": seed, "movements": when} for when in times]
                    waiting[pool.submit(errors_of, name, setting, seed, benchmark, times)] = rows
        for made in as_completed(waiting):
            found = zip(waiting[made], made.result(), strict=True)
            merge(options.results, TABLE, [{**row, "linear": one, "process": other} for row, (one, other) in found])
            say(", ".join(map(str, waiting[made][-1].values())))
    print(means(read_table(options.results, TABLE), options.only, times[-1]).to_string(index=False))
    return 0


if __name__ == "__main__":
    sys.exit(command(main))
