"""One learner on many robots: is it better than movements at random, on robots that it was not tuned for, too?

Each task is run with the learner of your choice and with two others that it has to beat: random movements, and goals
drawn anywhere, each with one movement: the nearest so far plus noise. Both answer with the nearest neighbour. What is
shown is the error divided by that of random movements after as many movements: below 1 is better. Options of sgimd run
choose the learner; --vary, as in sgimd sweep, compares several. Defaults of this library are chosen on half of the
tasks only; the others are marked "new".

  sgimd suite                                             the default learner on the tasks that need no physics
  sgimd suite --seeds 0-9 --movements 2000 --out study    runs go to study/TASK/NAME/seed-000
  sgimd suite --vary inverse=linear,process --seeds 0-4   which inverse model?
  sgimd suite --tasks all                                 with fishing rod and swimmer (extra gym): minutes a run
  sgimd suite --tasks toss crawler --algorithm sagg-riac --budget 4
  sgimd table study/toss                                  one task in its own unit

Start the same command again after Ctrl-C or a power cut, or with more seeds: finished runs stay as they are. The
figure is OUT/suite.png. With five seeds or more, ratios have bootstrap intervals of 95 %.

Exit code: 0 all runs are finished, 1 some failed, 2 the request is wrong, 130 or 143 stopped by Ctrl-C or SIGTERM.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

from sgimd_torch.catalogue import ROD
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.engines.loop import sweep
from sgimd_torch.runs.process import loading, say
from sgimd_torch.runs.read import finished, movements_on_disk, read_run
from sgimd_torch.runs.sweep import add_engines, add_options, engine_of, variants_of

if TYPE_CHECKING:
    from sgimd_torch.spaces import Array


@dataclass(frozen=True)
class Suited:
    """A task of the suite: ``options`` of a run that make it; whether it is ``new``, never used to choose a default;
    whether it is ``quick``, without physics."""

    options: Mapping[str, Any] = field(default_factory=dict)
    new: bool = False
    quick: bool = True


def _robot(word: str, *, new: bool = False) -> Suited:
    return Suited({"environment": word}, new)


TASKS: Final[dict[str, Suited]] = {
    "rod": Suited({"environment": ROD}, quick=False),
    "planar-arm-50": _robot("planar-arm-50"),
    "toss": _robot("toss"),
    "two-elbows": _robot("two-elbows"),
    "half-reached": _robot("half-reached"),
    "rod-large": Suited({"environment": ROD, "environment.task_space": 100.0}, new=True, quick=False),
    "swimmer": Suited({"environment": "swimmer"}, new=True, quick=False),
    "planar-arm-7": _robot("planar-arm-7", new=True),
    "crawler": _robot("crawler", new=True),
    "spatial-arm": _robot("spatial-arm", new=True),
}
RANDOM, UNIFORM = "random-nearest", "uniform-nearest"
REFERENCES: Final[dict[str, dict[str, Any]]] = {
    RANDOM: {"algorithm": "random", "inverse": "nearest"},
    UNIFORM: {
        "algorithm": "sagg-riac",
        "goals": "uniform",
        "inverse": "nearest",
        "search": "perturb",
        "budget": 1,
    },
}
DEFAULTS: Final = {
    "algorithm": "practice",
    "movements": "1000",
    "repeats": "0",
    "evaluated-by": "own",
    "out": "runs/suite",
}
OWN: Final = ("environment", "benchmark", "demonstrations", "name")


def main(argv: Sequence[str] | None = None) -> int:
    """Run what is not finished, print the table, draw the figure; 1 where runs failed."""
    options, rest = _options(argv)
    configs, flags = runs_of(options, rest)
    mine, out = options.shard.of(configs), configs[0].out.parent
    left = [config for config in mine if not finished(config)]
    say(f"{len(mine)} runs{options.shard.note(configs)}, {len(mine) - len(left)} of them finished: {out}")
    if options.dry_run:
        for config in left:
            done = movements_on_disk(config.directory)
            print(f"{config.out.name}: {config.title}: {done} of {config.movements} movements")
        return 0
    with loading():
        from sgimd_torch.runs.build import build  # after --help
        from sgimd_torch.views.suite_figure import draw, table
    for config in {(each.out, each.variant): each for each in left}.values():
        build(config)  # a wrong option is refused before anything starts
    with engine_of(options, left) as engine:
        failures = sweep(left, engine, flags=flags)
    errors = errors_of([config for config in configs if finished(config)])
    if errors:
        print(table(errors))
        say(*(f"figure: {path}" for path in draw(errors, out / "suite")))
    say(f"{len(left) - len(failures)} runs ended well, {len(failures)} failed: {out}", *failures)
    return 1 if failures else 0


def runs_of(options: argparse.Namespace, rest: Sequence[str]) -> tuple[list[Config], list[str]]:
    """All runs, task by task within a seed, and the flags of ``sgimd run``.

    Args:
        options: ``tasks``, ``seeds`` and ``vary``.
        rest: options of ``sgimd run``.

    Raises:
        ValueError: an option that a task decides, or that cannot be varied.
    """
    given = {word.partition("=")[0].lstrip("-").replace("_", "-") for word in [*rest, *options.vary]}
    for name in OWN:
        if name in {word.partition(".")[0] for word in given}:
            raise ValueError(f"--{name} cannot be given here: each task has its own; --tasks chooses tasks")
    words = [*(f"--{name}={value}" for name, value in DEFAULTS.items() if name not in given), *rest]
    learners, flags = variants_of(options.vary, words)
    first = learners[0]
    shared = {
        name: getattr(first, name)
        for name in ("movements", "evaluate_at", "evaluated_by", "repeats", "floor_at", "out")
    }
    others = [Config.from_settings({"name": name, **line, **shared}) for name, line in REFERENCES.items()]
    configs = [
        replace(
            each,
            seed=seed,
            name=each.variant,
            out=each.out / task,
            parts={**dict(each.parts), **TASKS[task].options},
        )
        for seed in options.seeds
        for task in options.tasks
        for each in [*others, *learners]
    ]
    return configs, flags


def errors_of(configs: Sequence[Config]) -> dict[str, dict[str, dict[int, Array]]]:
    """Mean errors ``(n_seeds,)`` of finished runs: by task, learner and number of movements."""
    import numpy as np

    found: dict[str, dict[str, dict[int, list[float]]]] = {}
    for config in configs:
        run = read_run(config.directory).evaluation
        curve = found.setdefault(titled(config.out.name), {}).setdefault(config.variant, {})
        for movements, error in zip(run["movements"], run["mean_error_m"], strict=True):
            curve.setdefault(int(movements), []).append(float(error))
    return {
        task: {name: {at: np.array(values) for at, values in curve.items()} for name, curve in learners.items()}
        for task, learners in found.items()
    }


def titled(task: str) -> str:
    """The name of a task, marked if it is new."""
    return task + " (new)" * TASKS[task].new


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd suite``."""
    parser = argparse.ArgumentParser(
        prog="sgimd suite",
        usage="%(prog)s [--tasks TASK ...] [--vary OPTION=VALUE,VALUE ...] [--seeds SEEDS] [--OPTION VALUE ...]",
        description=__doc__,
        epilog="tasks: " + ", ".join(map(titled, TASKS)),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "--tasks",
        nargs="+",
        default=["quick"],
        choices=[*TASKS, "quick", "all"],
        metavar="TASK",
        help="which; quick: those without physics; all (default: quick)",
    )
    parser.add_argument(
        "--vary", action="append", default=[], metavar="OPTION=VALUE,VALUE", help="one option of sgimd run"
    )
    add_options(parser, seeds="0")
    add_engines(parser)
    return parser


def _options(argv: Sequence[str] | None) -> tuple[argparse.Namespace, list[str]]:
    options, rest = parser().parse_known_args(argv)
    chosen = {"quick": [name for name, task in TASKS.items() if task.quick], "all": list(TASKS)}
    options.tasks = list(dict.fromkeys(name for word in options.tasks for name in chosen.get(word, [word])))
    return options, rest
