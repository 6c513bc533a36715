"""Run the paper's experiments, every variant with several seeds, and collect the results in tables.

variants.py says which variants there are. A run goes to OUT/VARIANT/seed-003. When it ends, each of its evaluations
becomes lines of a table in RESULTS, one for each inverse model that answers: forward_model.csv for forward-model and
planar-arm-*, gymnasium.csv for swimmer, one of its own name for asking, by-hand, learning, settings and suite (such as
by_hand.csv), paper.csv for all others. Requests and errors by context of asking are in asked.csv and contexts.csv, the
goals chosen in the large task space in goals.csv. A variant in two experiments is run once.

Start the same command again after Ctrl-C or a power cut, or with more seeds: what is in the tables is not run again,
and a run that was stopped goes on. If a run fails, the others go on.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Final

from sgimd_torch.runs.process import command, loading, say

with loading():  # Ctrl-C shows no traceback
    import numpy as np

    from read_results import HEADER
    from sgimd_torch.catalogue import unknown
    from sgimd_torch.files import make_folder
    from sgimd_torch.runs.config import Config
    from sgimd_torch.runs.engines.loop import sweep
    from sgimd_torch.runs.log import RunError
    from sgimd_torch.runs.read import finished, read_run
    from sgimd_torch.runs.sweep import add_engines, add_options, engine_of
    from tables import COLUMNS, RESULTS, ROWS, Key, Table, as_text, result_rows
    from variants import EXPERIMENTS, MADE, SEEDS, Variant, make_subsets, seeds_of, tables_of

EXAMPLES: Final = f"""experiments: {", ".join(EXPERIMENTS)}

examples:
  python experiments/compare.py --dry-run                         what the pages still lack
  python experiments/compare.py                                   run it: each experiment with the seeds of its page
  python experiments/compare.py learners large-space --seeds 0-2 --results mine
  python experiments/compare.py ablations --only uniform-goals grid --results mine   all their rows, into mine/
  python experiments/compare.py --shard 3/20                      a part of the runs, see docs/clusters.md
  python experiments/compare.py --verify 10 --lot 7               ten rows of the tables, drawn by lot, made again

Exit code: 0 all runs are in the tables, 1 some failed, 2 the request is wrong, 130 or 143 stopped by a signal.
"""
# These measure the noise floor, which takes as long as everything else.
FLOORS: Final = ("learners", "teachers", "long", "letter", "ladder", "forward-model")
FLOOR_AT: Final = (5000, 10_000)
ANSWERS: Final = ("own", "nearest", "linear", "model", "process")  # every run is evaluated by each of them
ANSWER: Final = HEADER.index("answer")
ROUNDING: Final = 1e-5  # relative; another processor rounds differently, and errors grow over thousands of movements


def main(argv: Sequence[str] | None = None) -> int:
    """Run what is missing in the tables, and collect the results.

    Returns:
        The exit code, 1 where runs failed.
    """
    options = _options(argv)
    whole = runs_of(options.experiments, options.only, options.seeds, options.out)
    runs = list(dict.fromkeys(config for _, config in whole))
    mine = {*options.shard.of(runs)}
    wanted = [(name, config) for name, config in whole if config in mine]
    if options.verify:
        return verify(wanted, options)
    names = dict.fromkeys(table for name, _ in wanted for table in tables_of(name))
    rows = {table: table_in(options.results, table).rows() for table in names}
    left = [(name, config) for name, config in wanted if not last_rows(config) <= rows[tables_of(name)[0]].keys()]
    where = " and ".join(str(options.results / table) for table in names)
    say(f"{len(wanted)} runs{options.shard.note(runs)}, {len(wanted) - len(left)} of them in {where} already")
    if wanted and not left:
        say("nothing is left to run: --verify 10 makes ten of these rows again, --results FOLDER all of them")
        return 0
    if options.dry_run:
        print("".join(f"{name}: {config.title}\n" for name, config in left), end="")
        return 0
    make_folder(options.results)
    make_subsets(options.out / "demonstrations", by_hand="by-hand" in options.experiments)
    homes: dict[Config, list[str]] = {}  # the experiments that a run belongs to
    for name, config in left:
        homes.setdefault(config, []).append(name)

    def on_end(config: Config) -> None:
        for name in homes[config]:
            collect(name, config, options.results)

    with engine_of(options, list(homes)) as engine:
        failures = sweep(list(homes), engine, on_end=on_end)
    say(f"{len(homes) - len(failures)} runs ended well, {len(failures)} failed: {where}", *failures)
    return 1 if failures else 0


def verify(wanted: Sequence[tuple[str, Config]], options: argparse.Namespace) -> int:
    """Draw rows of the tables by lot, make each again by a run of its own, and compare.

    Such a run has as many movements as its row says and is evaluated only at the end, which does not change it.

    Returns:
        0 if all are equal, except for rounding, else 1.
    """
    shipped = {table: table_in(options.results, table).rows() for name, _ in wanted for table in tables_of(name)[:1]}
    found = [
        (name, config, row)
        for name, config in wanted
        for row in shipped[tables_of(name)[0]].values()
        if row[:2] == [name, config.variant] and row[4] == str(config.seed) and row[ANSWER] in config.answered
    ]
    drawn = sorted(np.random.default_rng(options.lot).permutation(len(found))[: options.verify].tolist())
    again = {}
    for number in drawn:
        name, config, row = found[number]
        movements = int(row[5])
        out = options.out / f"verify-{options.lot}" / f"{name}-{movements}"
        again[number] = replace(config, movements=movements, evaluate_at=(movements,), out=out)
    say(f"{len(again)} rows of {len(found)}, made again in {options.out}/verify-{options.lot}")
    if options.dry_run:
        print("".join(f"{config.title} at {config.movements}\n" for config in again.values()), end="")
        return 0
    make_subsets(options.out / "demonstrations", by_hand="by-hand" in options.experiments)
    configs = list(dict.fromkeys(again.values()))
    with engine_of(options, configs) as engine:
        failures = sweep(configs, engine)
    found_now = {
        number: row_now(found[number][0], config, found[number][2][ANSWER]) for number, config in again.items()
    }
    verdicts = {number: compared(found[number][2], now) for number, now in found_now.items()}
    for number, verdict in verdicts.items():
        now = "" if verdict == "equal" else f"  now {','.join(found_now[number])}"
        print(f"{verdict:8} {','.join(found[number][2])}{now}")
    counts = [list(verdicts.values()).count(verdict) for verdict in ("equal", "rounding", "DIFFERS")]
    say("{} equal, {} equal but for rounding (made on another processor?), {} differ".format(*counts), *failures)
    return 1 if counts[-1] else 0


def row_now(experiment: str, config: Config, answer: str) -> list[str]:
    """The last row of a run with this ``answer``; [] if the run is not finished."""
    made = result_rows(experiment, config, read_run(config.directory)) if finished(config) else []
    return next(([as_text(value) for value in row] for row in reversed(made) if row[ANSWER] == answer), [])


def compared(shipped: Sequence[str], now: Sequence[str]) -> str:
    """Compare two rows: "equal", "rounding" if only that differs (it grows while a learner learns), or "DIFFERS"."""
    if list(shipped) == list(now):
        return "equal"
    n = ANSWER + 1
    if len(shipped) != len(now) or shipped[:n] != now[:n] or [bool(field) for field in shipped] != list(map(bool, now)):
        return "DIFFERS"
    pairs = [(float(then), float(field)) for then, field in zip(shipped[n:], now[n:], strict=True) if then]
    return "rounding" if all(abs(then - field) <= ROUNDING * abs(then) for then, field in pairs) else "DIFFERS"


def runs_of(
    experiments: Sequence[str], only: Sequence[str], seeds: Sequence[int] | None, out: Path
) -> list[tuple[str, Config]]:
    """All runs, each with its experiment, seed by seed, so that every variant gets its first seeds early.

    Args:
        experiments: names in ``EXPERIMENTS``.
        only: only these of their variants; empty for all.
        seeds: of each; None for those that its page stands on.
        out: where runs go; the subsets of ``make_subsets`` are in ``out/demonstrations``.
    """
    found = []
    for seed in sorted({*chain(*SEEDS.values())}) if seeds is None else seeds:
        for experiment in experiments:
            for variant, line in EXPERIMENTS[experiment].items():
                if only and variant not in only:
                    continue
                if seeds is None and seed not in seeds_of(experiment, variant):
                    continue
                run: Variant = {
                    "seed": seed,
                    "out": out,
                    "name": variant,
                    "evaluated_by": ANSWERS,
                    "floor_at": FLOOR_AT if experiment in FLOORS else (),
                    **line,
                }
                if run.get("demonstrations") in MADE:
                    run["demonstrations"] = out / "demonstrations" / run["demonstrations"]
                found.append((experiment, Config.from_settings(run)))
    return found


def last_rows(config: Config) -> set[Key]:
    """Keys of the rows of a run's last evaluation; if they are in a table, so are the others."""
    return {(config.variant, str(config.seed), str(config.movements), answer) for answer in config.answered}


def table_in(results: Path, name: str) -> Table:
    """A table of results, by the name of its file."""
    return Table(results / name, *COLUMNS.get(name, RESULTS))


def collect(experiment: str, config: Config, results: Path) -> None:
    """Merge the rows of a finished run, read from its directory, into the tables of its experiment.

    Raises:
        RunError: its files are damaged, or it was not evaluated at its end.
        OSError: a table cannot be written.
    """
    run = read_run(config.directory)
    if config.movements not in run.evaluation["movements"]:
        raise RunError(f"{run.path} has no evaluation after {config.movements} movements, though it ended")
    evaluations, *others = tables_of(experiment)
    for name in others:
        table_in(results, name).merge(ROWS[name](config, run))
    table_in(results, evaluations).merge(result_rows(experiment, config, run))  # last: now the run counts as done


def _options(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python experiments/compare.py",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("experiments", nargs="*", metavar="EXPERIMENT", help="which; all if none is named")
    parser.add_argument("--only", nargs="+", default=[], metavar="VARIANT", help="only these of their variants")
    add_options(parser, seeds=None, default="those of the page of each experiment")
    add_engines(parser)
    parser.add_argument("--out", type=Path, default=Path("runs"), help="where the runs go (default: %(default)s)")
    parser.add_argument(
        "--results", type=Path, default=Path("results"), help="folder of the tables (default: %(default)s)"
    )
    parser.add_argument(
        "--verify", type=int, default=0, metavar="N", help="make N rows of the tables again, in a folder of their own"
    )
    parser.add_argument("--lot", type=int, default=0, help="seed for drawing them (default: %(default)s)")
    options = parser.parse_args(argv)
    options.experiments = list(dict.fromkeys(options.experiments)) or list(EXPERIMENTS)
    _check_names(options.experiments, options.only)
    return options


def _check_names(experiments: Sequence[str], only: Sequence[str]) -> None:
    homes: dict[str, list[str]] = {}
    for experiment, variants in EXPERIMENTS.items():
        for variant in variants:
            homes.setdefault(variant, []).append(experiment)
    for name in experiments:
        if name in homes and name not in EXPERIMENTS:
            where = " and ".join(homes[name])
            raise ValueError(f"{name} is a variant, of {where}; write {homes[name][0]} --only {name}")
        _check_known("experiment", name, EXPERIMENTS)
    known = [variant for variant, where in homes.items() if {*where} & {*experiments}]
    for name in only:
        if name in EXPERIMENTS and name not in homes:
            raise ValueError(f"{name} is an experiment, no variant; experiments go before --only")
        if name in homes and name not in known:
            where = " and ".join(homes[name])
            raise ValueError(f"{name} is a variant of {where}, you named {', '.join(experiments)}")
        _check_known("variant", name, known)


def _check_known(what: str, name: str, known: Collection[str]) -> None:
    if name not in known:
        raise unknown(what, name, known)


if __name__ == "__main__":
    sys.exit(command(main))
