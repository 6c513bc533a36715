"""Make the rows of all pages: run every variant with several seeds, and collect the results in tables.

variants.py lists the variants. A run is in OUT/LEARNING/VARIANT/seed-003. After the run, results.csv in RESULTS gets a
row for each of its evaluations by each inverse model. asked.csv gets the requests of learners that ask, and
explored.csv the tiles reached and the goals chosen. `robots` and `changes` are lives on random robots, by number of the
robot, and on robots that change, `others` those of other people's programs; each has a table.

After Ctrl-C or a power cut, or for more seeds, start the command again: runs in the tables are not repeated, and
stopped runs continue. If a run fails, the others continue. Rows of other learning (their last column tells) do not
count as made; the first new row of a variant removes them. The paper's page comes first.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, Final

from sgimd_torch.runs.messages import say
from sgimd_torch.runs.program import command
from sgimd_torch.runs.signals import loading

with loading():  # Ctrl-C shows no traceback
    import numpy as np
    import pandas as pd

    import changing
    import lives
    import others
    import random_robots
    from lives import Life
    from sgimd_torch.extras.sweep.command import add_options, engine_of
    from sgimd_torch.extras.sweep.parallel import Job, sweep
    from sgimd_torch.files import make_folder
    from sgimd_torch.options.config import OWN, Config
    from sgimd_torch.record import RunError
    from sgimd_torch.runs.read import finished, read_run
    from sgimd_torch.texts import unknown_name_error
    from table import FILE, LEARNING, ROWS, TABLES, Row, answers_of, merge, own_answer, read_table, result_rows
    from variants import EXPERIMENTS, SEEDS, SMALL_TABLES, Variant

LIVES: Final = {"robots": random_robots, "changes": changing, "others": others}
NAMES: Final[dict[str, Collection[str]]] = {
    **EXPERIMENTS,
    "robots": random_robots.LEARNERS,
    "changes": (*changing.ROBOTS, changing.ARM),
    "others": others.ROBOTS,
}
# Estimates of processor time (ms) of a movement, evaluations included. The order is that in which runs are made.
COST: Final = {
    "paper": 3.0,
    "letter": 3.5,
    "large": 6.0,
    "teachers": 2.5,
    "practice": 5.5,
    "robots": 4.0,
    "rivals": 5.0,
    "model": 13.0,
    "changes": 4.0,
    "suite": 3.0,
    "others": 6.0,
    "asking": 5.5,
}
EXAMPLES: Final = f"""experiments: {", ".join(COST)}

examples:
  python experiments/compare.py --dry-run                         list the runs that the pages still lack
  python experiments/compare.py                                   make the runs that the pages still lack
  python experiments/compare.py --results mine                    all rows of all pages again, into mine/
  python experiments/compare.py paper large --seeds 0-2 --results mine
  python experiments/compare.py rivals --only sgim-d-once cma-me --results mine      two variants, rows in mine/
  python experiments/compare.py --on tcp://head:8786              on a cluster, see docs/clusters.md
  python experiments/compare.py --verify 10 --lot 7               make ten random rows again, and compare

Exit code: 0 all runs are in the tables, 1 some failed, 2 the request is wrong, 130 or 143 stopped by a signal.
"""
KEY: Final = ["variant", "seed", "movements", "answer"]
NUMBERS: Final = ["error", "floor"]
ROUNDING: Final = 1e-5  # relative difference that rounding on another processor may cause over thousands of movements


def main(argv: Sequence[str] | None = None) -> int:
    """Carry out the runs that the tables lack, and collect the results.

    Returns:
        The exit code: 1 if runs failed, else 0.
    """
    options = _options(argv)
    wanted = {name: jobs_of(name, options.only, options.seeds, options.out / LEARNING) for name in options.experiments}
    if options.verify:
        return verify([job for jobs in wanted.values() for job in jobs if isinstance(job, Config)], options)
    known = made_rows(options.results)
    left = {name: [job for job in jobs if not last_rows(job) <= known] for name, jobs in wanted.items()}
    jobs = [*chain(*left.values())]
    for name in wanted:
        say(f"{name}: {len(wanted[name]) - len(left[name])} of {len(wanted[name])} runs made, "
            f"{hours(name, left[name]):.1f} of {hours(name, wanted[name]):.1f} processor hours left")  # fmt: skip
    say(f"{len(jobs)} runs, {sum(hours(name, runs) for name, runs in left.items()):.1f} processor hours left")
    if not jobs:
        say("nothing is left to run: --verify 10 makes ten of these rows again, --results FOLDER makes all again")
    if options.dry_run:
        print("".join(f"{job.title}\n" for job in jobs), end="")
    if options.dry_run or not jobs:
        return 0
    make_folder(options.results)
    failures = _run(jobs, options, lambda job: collect(job, options.results))
    say(f"{len(jobs) - len(failures)} runs ended well, {len(failures)} failed: {options.results}", *failures)
    return 1 if failures else 0


def hours(name: str, jobs: Sequence[Job]) -> float:
    """Processor hours that jobs of this experiment take, by `COST`."""
    return COST.get(name, 0.0) * sum(job.movements for job in jobs) / 3.6e6


def made_rows(results: Path) -> set[tuple[Any, ...]]:
    """Keys of the rows that the present learning has made; those of lives begin with the name of their table."""
    known = set[tuple[Any, ...]]()
    for name in (FILE, random_robots.TABLE, changing.TABLE, others.TABLE):
        table, (n_key, columns) = read_table(results, name), TABLES[name]
        keys = table[table["learning"] == LEARNING][[*columns[:n_key]]].itertuples(index=False, name=None)
        known |= {*keys} if name == FILE else {(name, *key[:-1]) for key in keys}
    return known


def verify(wanted: Sequence[Config], options: argparse.Namespace) -> int:
    """Draw rows of the table at random, make each row again by a new run, and compare old and new row.

    The new run ends at the number of movements in the row and is evaluated only there; evaluations do not change
    learning.

    Returns:
        0 if all rows are equal except for rounding, else 1.
    """
    configs = {(config.variant, config.seed): config for config in wanted}
    table = read_table(options.results).query("learning == @LEARNING").drop(columns="learning")
    rows = [row for row in table.to_dict("records") if (row["variant"], row["seed"]) in configs]
    if not rows:
        raise ValueError(f"{options.results / FILE} has no such row of this learning, {LEARNING}; make some first")
    drawn = [rows[k] for k in sorted(np.random.default_rng(options.lot).permutation(len(rows))[: options.verify])]
    folder, again = options.out / LEARNING / f"verify-{options.lot}", list[Config]()
    for row in drawn:
        config, movements = configs[row["variant"], row["seed"]], row["movements"]
        out = folder / str(movements)
        again.append(replace(config, movements=movements, evaluate_at=(movements,), out=out))
    say(f"{len(again)} rows of {len(rows)}, made again in {folder}")
    if options.dry_run:
        print("".join(f"{config.title} at {config.movements}\n" for config in again), end="")
        return 0
    failures = _run([*dict.fromkeys(again)], options)
    verdicts = []
    for row, config in zip(drawn, again, strict=True):
        made = result_rows(config, read_run(config.directory)) if finished(config) else []
        now = next((other for other in made if other["answer"] == row["answer"]), {})
        verdicts.append(compared(row, now))
        print(f"{verdicts[-1]:8} {_in_words(row)}" + ("" if verdicts[-1] == "equal" else f"  now {_in_words(now)}"))
    counts = [verdicts.count(verdict) for verdict in ("equal", "rounding", "DIFFERS")]
    say("{} equal, {} equal but for rounding (made on another processor?), {} differ".format(*counts), *failures)
    return 1 if counts[-1] else 0


def compared(shipped: Row, now: Row) -> str:
    """Verdict on two rows: "equal", "rounding" if they differ by rounding errors alone, or "DIFFERS"."""
    if {name: shipped[name] for name in KEY} != {name: now.get(name) for name in KEY}:
        return "DIFFERS"
    old, new = (np.array([row[name] for name in NUMBERS], dtype=np.float64) for row in (shipped, now))
    if np.array_equal(old, new, equal_nan=True):
        return "equal"
    return "rounding" if np.allclose(new, old, rtol=ROUNDING, atol=0, equal_nan=True) else "DIFFERS"


def jobs_of(experiment: str, only: Sequence[str], seeds: Sequence[int] | None, out: Path) -> list[Config] | list[Life]:
    """Runs or lives of an experiment, seed by seed.

    Args:
        experiment: name of the experiment, as in ``NAMES``.
        only: names of the variants to run; empty for all variants of the experiment.
        seeds: seeds of each variant; None for the seeds of its page.
        out: folder of the runs.
    """
    chosen = [name for name in NAMES[experiment] if not only or name in only]
    if experiment in LIVES:
        return LIVES[experiment].lives(seeds, chosen, out)
    configs = []
    for seed in SEEDS[experiment] if seeds is None else seeds:
        for variant in chosen:
            line = EXPERIMENTS[experiment][variant]
            run: Variant = {"seed": seed, "out": out, "name": variant, "floor_at": (), **line}
            config = Config.from_settings(run)
            configs.append(replace(config, evaluated_by=answers_of(config)))
    return configs


def last_rows(job: Config | Life) -> set[tuple[Any, ...]]:
    """Keys of the rows of a job's last evaluation, as in `made_rows`; a table with these has all its rows."""
    if isinstance(job, Life):
        return {(job.table, *job.key)}
    answers = (own_answer(job) if answer == OWN else answer for answer in job.evaluated_by)
    return {(job.variant, job.seed, job.movements, answer) for answer in answers}


def collect(config: Config | Life, results: Path) -> None:
    """Merge the rows of a finished run or life, read from its directory, into the tables.

    Raises:
        RunError: the run is damaged, or was not evaluated at its end.
        ResultsError, OSError: a table cannot be read or written.
    """
    if isinstance(config, Life):
        return lives.collect(results, config)
    run = read_run(config.directory)
    rows = result_rows(config, run)
    if config.movements not in {row["movements"] for row in rows}:
        raise RunError(f"{run.path} has no evaluation after {config.movements} movements, though it ended")
    for experiment, variants in EXPERIMENTS.items():
        if config.variant in variants and (name := SMALL_TABLES.get(experiment)):
            merge(results, name, ROWS[name](config, run))
    merge(results, FILE, rows)  # last, because with these rows the run counts as done


def _run(jobs: Sequence[Config | Life], options: argparse.Namespace, on_end: Any = None) -> list[str]:
    """Carry out jobs; returns error messages, one for each failed job."""
    return sweep(jobs, engine_of(options), on_end=on_end)


def _in_words(row: Row) -> str:
    return ",".join("" if pd.isna(value) else str(value) for value in row.values())


def _options(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python experiments/compare.py",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    results = "folder of the tables (default: %(default)s)"
    parser.add_argument("experiments", nargs="*", metavar="EXPERIMENT", help="experiments to run (default: all)")
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="VARIANT", help="variants to run (default: all of them)"
    )
    add_options(parser, seeds=None, default="seeds of the page of each experiment")
    parser.add_argument("--out", type=Path, default=Path("runs"), help="folder of the runs (default: %(default)s)")
    parser.add_argument("--results", type=Path, default=Path("results"), help=results)
    parser.add_argument(
        "--verify", type=int, default=0, metavar="N", help="number of random rows to make again and to compare"
    )
    parser.add_argument("--lot", type=int, default=0, help="seed of the draw of --verify (default: %(default)s)")
    options = parser.parse_args(argv)
    options.experiments = list(dict.fromkeys(options.experiments)) or list(COST)
    for name in options.experiments:
        _check_known("experiment", name, NAMES)
    for name in options.only:
        _check_known("variant", name, [*chain(*(NAMES[experiment] for experiment in options.experiments))])
    return options


def _check_known(what: str, name: str, known: Collection[str]) -> None:
    if name in known:
        return
    if homes := [experiment for experiment, variants in NAMES.items() if name in variants]:
        raise ValueError(f"{name} is a variant of {' and '.join(homes)}; write {homes[0]} --only {name}")
    if name in NAMES:
        raise ValueError(f"{name} is an experiment, not a variant; experiments go before --only")
    raise unknown_name_error(what, name, known)


if __name__ == "__main__":
    sys.exit(command(main))
