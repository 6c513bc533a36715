"""Run the experiments, every variant with several seeds, and collect the results in tables.

variants.py lists the variants. A run is in OUT/VARIANT/seed-003. After the run, results.csv in RESULTS gets a row for
each of its evaluations by each inverse model. asked.csv gets the requests of learners that ask, and
explored.csv the tiles reached and the goals chosen.

After Ctrl-C or a power cut, or for more seeds, start the command again: runs in the tables are not repeated, and
stopped runs continue. If a run fails, the others continue.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, Final

from sgimd_torch.runs.signals import command, loading, say

with loading():  # Ctrl-C shows no traceback
    import numpy as np
    import pandas as pd

    import changing
    import random_robots
    from sgimd_torch.files import make_folder
    from sgimd_torch.options.catalogue import unknown_name_error
    from sgimd_torch.options.config import OWN, Config
    from sgimd_torch.record import RunError
    from sgimd_torch.runs.parallel import sweep
    from sgimd_torch.runs.read import finished, read_run
    from sgimd_torch.runs.sweep import add_options, cores, engine_of
    from table import FILE, ROWS, Row, answers_of, merge, own_answer, read_table, result_rows
    from variants import EXPERIMENTS, MADE, SEEDS, SMALL_TABLES, Variant, make_subsets

EXAMPLES: Final = f"""experiments: {", ".join(EXPERIMENTS)}

examples:
  python experiments/compare.py --dry-run                         list the runs that the pages still lack
  python experiments/compare.py                                   make the runs that the pages still lack
  python experiments/compare.py --all --results mine              all rows of all pages again, into mine/
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
    wanted = runs_of(options.experiments, options.only, options.seeds, options.out)
    table = read_table(options.results)
    if options.verify:
        return verify(wanted, table, options)
    known = {*table[KEY].itertuples(index=False, name=None)}
    left = [config for config in wanted if not last_rows(config) <= known]
    where = options.results / FILE
    say(f"{len(wanted)} runs, {len(wanted) - len(left)} of them in {where} already")
    if wanted and not left:
        say("nothing is left to run: --verify 10 makes ten of these rows again, --results FOLDER makes all again")
    if options.dry_run:
        print("".join(f"{config.title}\n" for config in left), end="")
        return 0
    make_folder(options.results)
    failures = []
    if left:
        failures = _run(left, options, lambda config: collect(config, options.results))
        say(f"{len(left) - len(failures)} runs ended well, {len(failures)} failed: {where}", *failures)
    if options.all:
        random_robots.make(options.results, options.processes or cores())
        random_robots.make_repeated(options.results, options.processes or cores())
        changing.make(options.results, options.processes or cores())
    return 1 if failures else 0


def verify(wanted: Sequence[Config], table: pd.DataFrame, options: argparse.Namespace) -> int:
    """Draw rows of the table at random, make each row again by a new run, and compare old and new row.

    The new run ends at the number of movements in the row and is evaluated only there; evaluations do not change
    learning.

    Returns:
        0 if all rows are equal except for rounding, else 1.
    """
    configs = {(config.variant, config.seed): config for config in wanted}
    rows = [row for row in table.to_dict("records") if (row["variant"], row["seed"]) in configs]
    drawn = [rows[k] for k in sorted(np.random.default_rng(options.lot).permutation(len(rows))[: options.verify])]
    folder, again = options.out / f"verify-{options.lot}", list[Config]()
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


def runs_of(experiments: Sequence[str], only: Sequence[str], seeds: Sequence[int] | None, out: Path) -> list[Config]:
    """Settings of runs, seed by seed, so that every variant gets its first seeds early.

    Args:
        experiments: names of experiments, as in ``EXPERIMENTS``.
        only: names of the variants to run; empty for all variants of the experiments.
        seeds: seeds of each variant; None for the seeds of its page.
        out: folder of the runs; ``out/demonstrations`` has the files of ``make_subsets``.
    """
    configs = []
    for seed in sorted({*chain(*SEEDS.values())}) if seeds is None else seeds:
        for experiment in experiments:
            if seeds is None and seed not in SEEDS[experiment]:
                continue
            for variant, line in EXPERIMENTS[experiment].items():
                if only and variant not in only:
                    continue
                run: Variant = {"seed": seed, "out": out, "name": variant, "floor_at": (), **line}
                if run.get("demonstrations") in MADE:
                    run["demonstrations"] = out / "demonstrations" / run["demonstrations"]
                config = Config.from_settings(run)
                configs.append(replace(config, evaluated_by=answers_of(config)))
    return configs


def last_rows(config: Config) -> set[tuple[Any, ...]]:
    """Keys of the rows of a run's last evaluation; a table that has these rows has all rows of the run."""
    answers = (own_answer(config) if answer == OWN else answer for answer in config.evaluated_by)
    return {(config.variant, config.seed, config.movements, answer) for answer in answers}


def collect(config: Config, results: Path) -> None:
    """Merge the rows of a finished run, read from its directory, into the tables.

    Raises:
        RunError: the run is damaged, or was not evaluated at its end.
        ResultsError, OSError: a table cannot be read or written.
    """
    run = read_run(config.directory)
    rows = result_rows(config, run)
    if config.movements not in {row["movements"] for row in rows}:
        raise RunError(f"{run.path} has no evaluation after {config.movements} movements, though it ended")
    for experiment, variants in EXPERIMENTS.items():
        if config.variant in variants and (name := SMALL_TABLES.get(experiment)):
            merge(results, name, ROWS[name](config, run))
    merge(results, FILE, rows)  # last, because with these rows the run counts as done


def _run(configs: Sequence[Config], options: argparse.Namespace, on_end: Any = None) -> list[str]:
    """Carry out runs; returns error messages, one for each failed run."""
    make_subsets(options.out / "demonstrations")
    return sweep(configs, engine_of(options), on_end=on_end)


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
    parser.add_argument(
        "--all", action="store_true", help="lives of random robots and of robots that change, too; on this machine"
    )
    parser.add_argument("--out", type=Path, default=Path("runs"), help="folder of the runs (default: %(default)s)")
    parser.add_argument("--results", type=Path, default=Path("results"), help=results)
    parser.add_argument(
        "--verify", type=int, default=0, metavar="N", help="number of random rows to make again and to compare"
    )
    parser.add_argument("--lot", type=int, default=0, help="seed of the draw of --verify (default: %(default)s)")
    options = parser.parse_args(argv)
    options.experiments = list(dict.fromkeys(options.experiments)) or list(EXPERIMENTS)
    for name in options.experiments:
        _check_known("experiment", name, EXPERIMENTS)
    for name in options.only:
        _check_known("variant", name, [*chain(*(EXPERIMENTS[experiment] for experiment in options.experiments))])
    return options


def _check_known(what: str, name: str, known: Collection[str]) -> None:
    if name in known:
        return
    if homes := [experiment for experiment, variants in EXPERIMENTS.items() if name in variants]:
        raise ValueError(f"{name} is a variant of {' and '.join(homes)}; write {homes[0]} --only {name}")
    if name in EXPERIMENTS:
        raise ValueError(f"{name} is an experiment, not a variant; experiments go before --only")
    raise unknown_name_error(what, name, known)


if __name__ == "__main__":
    sys.exit(command(main))
