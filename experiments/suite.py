"""Test a learner on many robots, against two references: random movements, and uniform goals.

The reference with uniform goals makes one movement for each goal, the nearest exemplar plus noise. In evaluations the
nearest exemplar answers for both references. Options of sgimd run choose the learner; --vary, as in sgimd sweep,
compares several learners. Each task has a table like that of sgimd table, in the unit of the task. The last column is
the error minus the error of random movements. Tasks on which no default of this library was chosen are marked "new".

  python experiments/suite.py                                             the default learner, tasks without physics
  python experiments/suite.py --seeds 0-9 --movements 2000 --out study    runs go to study/TASK/NAME/seed-000
  python experiments/suite.py --vary inverse=linear,process --seeds 0-4   compare two inverse models
  python experiments/suite.py --tasks all                                 also rod and swimmer; a run takes minutes
  python experiments/suite.py --tasks toss crawler --algorithm sagg-riac --budget 4

Start it in the root folder of the repository. Repeat the command after Ctrl-C or a power cut, or with more seeds:
finished runs are kept.

Exit code: 0 all runs are finished, 1 some failed, 2 the request is wrong, 130 or 143 stopped by Ctrl-C or SIGTERM.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from sgimd_torch.extras.sweep.command import add_options, add_vary, run_all, variants_of
from sgimd_torch.options.catalogue import ROD
from sgimd_torch.options.config import Config
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import finished


@dataclass(frozen=True)
class SuiteTask:
    """A task of the suite.

    Args:
        options: options of a run that choose the task.
        new: whether no default was chosen on the task.
        quick: whether the task needs no physics simulation.
    """

    options: Mapping[str, Any]
    new: bool = False
    quick: bool = True


TASKS: Final[dict[str, SuiteTask]] = {
    "rod": SuiteTask({"environment": ROD}, quick=False),
    "planar-arm-50": SuiteTask({"environment": "planar-arm-50"}),
    "toss": SuiteTask({"environment": "experiments.toys:toss"}),
    "two-elbows": SuiteTask({"environment": "experiments.toys:two_elbows"}),
    "half-reached": SuiteTask({"environment": "experiments.toys:half_reached"}),
    "rod-large": SuiteTask({"environment": ROD, "environment.task_space": 100.0}, quick=False),
    "swimmer": SuiteTask({"environment": "experiments.swimmer:swimmer"}, new=True, quick=False),
    "planar-arm-7": SuiteTask({"environment": "planar-arm-7"}),
    "crawler": SuiteTask({"environment": "experiments.toys:crawler"}, new=True),
    "spatial-arm": SuiteTask({"environment": "experiments.toys:spatial_arm"}, new=True),
    "puck": SuiteTask({"environment": "experiments.toys:puck"}),
    "fetch": SuiteTask({"environment": "experiments.toys:fetch"}, new=True),
}
RANDOM: Final = "random-nearest"  # reference: random movements
UNIFORM: Final = "uniform-nearest"  # reference: uniform goals
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
DEFAULTS: Final = {"algorithm": "practice", "movements": "1000", "repeats": "0", "out": "runs/suite"}
OF_THE_TASK: Final = ("environment", "benchmark", "demonstrations", "name")  # options that a task decides
SHARED: Final = ("movements", "evaluate_at", "evaluated_by", "repeats", "floor_at", "out")  # common to all runs


def main(argv: Sequence[str] | None = None) -> int:
    """Carry out unfinished runs, print a table for each task, and return the exit code: 1 if runs failed, else 0."""
    options, rest = parsed_options(argv)
    configs = runs_of(options, rest)
    code = run_all(configs, options, configs[0].out.parent)
    from sgimd_torch.extras.table import command as table  # scipy's statistics are slow to import

    for folder in [] if options.dry_run else dict.fromkeys(config.out for config in configs if finished(config)):
        print(f"\n{titled(folder.name)}")
        table.main([str(folder), "--baseline", RANDOM])
    return code


def runs_of(options: argparse.Namespace, rest: Sequence[str]) -> list[Config]:
    """Settings of all runs, seed by seed and then task by task.

    Args:
        options: parsed options, of which ``tasks``, ``seeds`` and ``vary`` are used.
        rest: options of ``sgimd run``.

    Raises:
        ValueError: an option is decided by each task, or cannot be varied.
    """
    given = {word.partition("=")[0].lstrip("-").replace("_", "-") for word in [*rest, *options.vary]}
    for name in OF_THE_TASK:
        if name in {word.partition(".")[0] for word in given}:
            raise ValueError(f"--{name} cannot be given here: each task has its own; choose tasks with --tasks")
    words = [*(f"--{name}={value}" for name, value in DEFAULTS.items() if name not in given), *rest]
    learners = variants_of(options.vary, words)
    shared = {name: learners[0][name] for name in SHARED}
    references = [Config.from_settings({"name": name, **line, **shared}) for name, line in REFERENCES.items()]
    configs = [
        replace(
            config,
            seed=seed,
            name=config.variant,
            out=config.out / task,
            parts={**dict(config.parts), **TASKS[task].options},
        )
        for seed in options.seeds
        for task in options.tasks
        for config in [*references, *learners]
    ]
    return configs


def titled(task: str) -> str:
    """The name of a task, with a mark if it is new."""
    return task + " (new)" * TASKS[task].new


def parsed_options(argv: Sequence[str] | None) -> tuple[argparse.Namespace, list[str]]:
    """The options of the suite, and the options of ``sgimd run``."""
    parser = argparse.ArgumentParser(
        prog="python experiments/suite.py",
        usage="%(prog)s [--tasks TASK ...] [--vary OPTION=VALUE,VALUE ...] [--seeds SEEDS] [--OPTION VALUE ...]",
        description=__doc__,
        epilog=f"tasks: {', '.join(map(titled, TASKS))}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--tasks",
        nargs="+",
        default=["quick"],
        choices=[*TASKS, "quick", "all"],
        metavar="TASK",
        help="names of tasks, or all, or quick for all tasks without physics (default: quick)",
    )
    add_vary(parser)
    add_options(parser, seeds="0")
    options, rest = parser.parse_known_args(argv)
    groups = {"quick": [name for name, task in TASKS.items() if task.quick], "all": list(TASKS)}
    options.tasks = list(dict.fromkeys(name for word in options.tasks for name in groups.get(word, [word])))
    return options, rest


if __name__ == "__main__":
    sys.exit(command(main))
