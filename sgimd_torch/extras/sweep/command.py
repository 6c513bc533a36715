"""Make many runs, several at a time: every combination of the varied options, with every seed.

Each --vary names one option of sgimd run and its values. All other options of sgimd run apply to every run. The run
of a variant with seed 3 goes to OUT/NAME/seed-003. NAME lists the varied values, such as sgim-d,goals=uniform.

  sgimd sweep --seeds 0-9                                                  ten runs with the defaults
  sgimd sweep --vary goals=interest-map,uniform --seeds 0-19 --out study   compare two goal models
  sgimd sweep --vary algorithm=sagg-riac,sgim-d --vary budget=5,15 --seeds 0-4 --movements 2000 --out study
  sgimd sweep --vary environment.noise=0,0.03 --seeds 0,3,7-9 --out study --dry-run    list unfinished runs
  sgimd sweep --vary goals=interest-map,uniform --seeds 0-19 --on tcp://head:8786    on a Dask cluster
  sgimd table study                                                        show the results

Repeat the command after Ctrl-C or a power cut, or with more seeds: finished runs are kept, unfinished ones continue.
A failed run does not stop the others. It is named at the end, and its output is in OUT/NAME/seed-003.log.

Exit code: 0 all runs are finished, 1 some failed, 2 the request is wrong, 130 or 143 stopped by Ctrl-C or SIGTERM.
"""

from __future__ import annotations

import argparse
import itertools
import os
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from sgimd_torch.extras.sweep.parallel import Engine, Machine, sweep
from sgimd_torch.files import make_folder
from sgimd_torch.options.config import Config, dashed
from sgimd_torch.options.parse import parse
from sgimd_torch.runs.directory import build_again, record_of
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.program import argument, parser_of
from sgimd_torch.runs.read import finished, movements_on_disk
from sgimd_torch.runs.signals import loading
from sgimd_torch.texts import SPANS

MOST_SEEDS: Final = 100_000
NOT_VARIED: Final = {
    "seed": "use --seeds, such as 5, 0-19 or 0,3,7-9",
    "name": "a sweep names each variant after its varied values",
    "out": "all runs of a sweep go to one --out",
}


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd sweep``."""
    parser = parser_of(
        "sweep", __doc__, usage="%(prog)s [--vary OPTION=VALUE,VALUE ...] [--seeds SEEDS] [--OPTION VALUE ...]"
    )
    add_vary(parser)
    add_options(parser, seeds="0")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Carry out all unfinished runs; return the exit code, which is 1 if runs failed."""
    options, rest = parser().parse_known_args(argv)
    variants = variants_of(options.vary, rest)
    configs = [replace(variant, seed=seed) for seed in options.seeds for variant in variants]
    return run_all(configs, options, variants[0].out)


def run_all(whole: Sequence[Config], options: argparse.Namespace, out: Path) -> int:
    """Carry out the unfinished runs of a study, or list them; return the exit code, which is 1 if runs failed.

    Args:
        whole: all runs of the study.
        options: parsed options of ``add_options``.
        out: folder of the study.

    Raises:
        ValueError, OSError, ImportError: the request is wrong; nothing was started.
    """
    left = [config for config in whole if not finished(config)]
    say(f"{len(whole)} runs, {len(whole) - len(left)} of them finished: {out}")
    if options.dry_run:
        for config in left:
            print(f"{config.directory}: {movements_on_disk(config.directory)} of {config.movements} movements")
    if options.dry_run or not left:
        return 0
    for config in {config.directory.parent: config for config in left}.values():
        build_again(config, record_of(config))  # wrong options raise an error before any run starts
    engine = engine_of(options)
    make_folder(out)
    failures = sweep(left, engine)
    say(f"{len(left) - len(failures)} runs ended well, {len(failures)} failed: {out}", *failures)
    return 1 if failures else 0


def add_vary(parser: argparse.ArgumentParser) -> None:
    """Add --vary, for ``variants_of``."""
    parser.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="OPTION=VALUE,VALUE",
        help="option of sgimd run and its values; a list in brackets is one value, as in floor-at=[1000],[1000,5000]",
    )


def add_options(parser: argparse.ArgumentParser, *, seeds: str | None, default: str = "%(default)s") -> None:
    """Add the options of every command with many runs: --seeds, --on, --processes and --dry-run.

    Args:
        parser: parser to extend.
        seeds: seeds if --seeds is not given, or None.
        default: description of these seeds in the help text.
    """
    parser.add_argument("--seeds", type=_seeds, default=seeds, help=f"seeds: 5, 0-19 or 0,3,7-9 (default: {default})")
    parser.add_argument(
        "--on",
        metavar="ADDRESS",
        help="address of a Dask scheduler whose workers make the runs, or its --scheduler-file (default: this machine)",
    )
    parser.add_argument("--processes", type=_count, help="number of runs at a time (default: one for each core)")
    parser.add_argument("--dry-run", action="store_true", help="list unfinished runs without starting them")


def engine_of(options: argparse.Namespace) -> Engine:
    """What carries out the runs, by the options of ``add_options``.

    Raises:
        ValueError: no scheduler answers at the address, or --processes is given, too.
        ImportError: distributed is not installed.
    """
    if options.on is None:
        return Machine(options.processes or cores())
    if options.processes:
        raise ValueError(
            "--processes cannot be given with --on: each worker of the cluster has its own number of threads"
        )
    with loading():
        from sgimd_torch.extras.sweep.cluster import Cluster  # loaded only on request

    return Cluster(options.on)


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def variants_of(varied: Sequence[str], options: Sequence[str]) -> list[Config]:
    """A run for every combination of varied values, named after them.

    Args:
        varied: values of --vary, such as ``["goals=interest-map,uniform", "budget=5,15"]``.
        options: options of ``sgimd run`` for all runs.

    Raises:
        ValueError: an option cannot be varied, is given twice, or is refused by ``sgimd run``.
    """
    given = given_in(options)
    values: dict[str, list[str]] = {}
    for word in varied:
        name, _, listed = word.removeprefix("--").partition("=")
        option = dashed(name)
        choices = re.split(r",(?![^[]*\])", listed)  # commas in brackets separate nothing
        if not all([option, *choices]):
            raise ValueError(f"--vary must be like goals=interest-map,uniform, got {word!r}")
        if option in [*values, *given]:
            raise ValueError(f"--{option} is given twice; put all its values into one --vary")
        values[option] = list(dict.fromkeys(choices))
    refuse([*values, *(option for option in given if option != "out")], NOT_VARIED)
    variants = []
    for combination in itertools.product(*values.values()):
        chosen = dict(zip(values, combination, strict=True))
        config, _ = parse([*options, *(f"--{option}={value}" for option, value in chosen.items())])
        in_order = sorted(chosen, key=lambda option: (option != "algorithm", option))
        variants.append(replace(config, name=",".join(_in_name(option, chosen[option]) for option in in_order) or None))
    return variants


def given_in(words: Sequence[str]) -> list[str]:
    """Names of the options that a command line gives, as it spells them, without dashes in front."""
    return [dashed(word.partition("=")[0].removeprefix("--")) for word in words if word.startswith("--")]


def refuse(given: Sequence[str], reasons: Mapping[str, str]) -> None:
    """Refuse options that a command sets itself, with the reason.

    Raises:
        ValueError: an option is one of those.
    """
    for option in given:
        if option in reasons:
            raise ValueError(f"--{option} cannot be given here: {reasons[option]}")


def _in_name(option: str, value: str) -> str:
    """A varied value in the name of a variant; a path is shortened to its file name."""
    return value if option == "algorithm" else f"{option}={Path(value).name if os.sep in value else value}"


def _count(text: str) -> int:
    if not re.fullmatch(r"0*[1-9]\d*", text, re.ASCII):
        raise argparse.ArgumentTypeError(f"must be a whole number of at least 1, got {text!r}")
    return int(text)


def _seeds(text: str) -> list[int]:
    spans: tuple[range, ...] = argument(SPANS, text)
    if any(span.stop - span.start > MOST_SEEDS for span in spans):
        raise argparse.ArgumentTypeError(f"are at most {MOST_SEEDS}, got {text}")
    return list(dict.fromkeys(itertools.chain(*spans)))
