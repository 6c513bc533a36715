"""Run many runs: options of sgimd run, crossed with each other and with seeds, some at a time.

Each --vary is one option with its values. The runs of a variant go to OUT/NAME/seed-003 and so on; NAME says what is
varied: sgim-d,goals=uniform if algorithm and goals are. All other options of sgimd run apply to every run.

  sgimd sweep --seeds 0-9                                                  ten runs with the defaults
  sgimd sweep --vary goals=interest-map,uniform --seeds 0-19 --out study   is the interest map worth it?
  sgimd sweep --vary algorithm=sagg-riac,sgim-d --vary budget=5,15 --seeds 0-4 --movements 2000 --out study
  sgimd sweep --vary environment.noise=0,0.03 --seeds 0,3,7-9 --out study --dry-run    what is still to be done
  sgimd sweep --vary goals=interest-map,uniform --seeds 0-19 --shard 2/4   the second quarter of them, see --dry-run
  sgimd sweep --vary goals=interest-map,uniform --seeds 0-999 --engine ray --address auto        on a cluster
  sgimd table study                                                        their results

Start the same command again after Ctrl-C or a power cut, or with more seeds: finished runs stay as they are, the
others go on. If a run fails, the others go on, too; it is named at the end, and its output is in OUT/NAME/seed-003.log.

Exit code: 0 all runs are finished, 1 some failed, 2 the request is wrong, 130 or 143 stopped by Ctrl-C or SIGTERM.
"""

from __future__ import annotations

import argparse
import itertools
import os
import re
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple, TypeVar

from sgimd_torch.files import make_folder
from sgimd_torch.runs.command_line import parse
from sgimd_torch.runs.config import FILES, Config, code_of, dashed
from sgimd_torch.runs.engines.loop import Submit, local, sweep
from sgimd_torch.runs.process import loading, say
from sgimd_torch.runs.read import finished, movements_on_disk

Item = TypeVar("Item")
NOT_VARIED: Final = {
    "seed": "--seeds takes them, such as 5, 0-19 or 0,3,7-9",
    "name": "a sweep names its variants by what is varied",
    "out": "all runs of a sweep go to one --out",
}


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd sweep``."""
    parser = argparse.ArgumentParser(
        prog="sgimd sweep",
        usage="%(prog)s [--vary OPTION=VALUE,VALUE ...] [--seeds SEEDS] [--OPTION VALUE ...]",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add_vary(parser)
    add_options(parser, seeds="0")
    add_engines(parser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Carry out all runs that are not finished; 1 where runs failed."""
    options, rest = parser().parse_known_args(argv)
    variants, flags = variants_of(options.vary, rest)
    configs = [replace(variant, seed=seed) for seed in options.seeds for variant in variants]
    return carry_out(configs, options, flags, variants[0].out)


def carry_out(whole: Sequence[Config], options: argparse.Namespace, flags: Sequence[str], out: Path) -> int:
    """Carry out those of the runs that are not finished, or list them; 1 where runs failed.

    Args:
        whole: all runs of a study.
        options: see ``add_options`` and ``add_engines``.
        flags: of ``sgimd run``, for all of them, besides --resume.
        out: the folder of the study.

    Raises:
        ValueError, OSError, ImportError: the request is wrong; nothing was started.
    """
    configs = options.shard.of(whole)
    left = [config for config in configs if not finished(config)]
    say(f"{len(configs)} runs{options.shard.note(whole)}, {len(configs) - len(left)} of them finished: {out}")
    if options.dry_run:
        for config in left:
            print(f"{config.directory}: {movements_on_disk(config.directory)} of {config.movements} movements")
    if options.dry_run or not left:
        return 0
    with loading():
        from sgimd_torch.runs.build import build  # after --help
    for config in {each.directory.parent: each for each in left}.values():
        build(config)  # a wrong option is refused before anything starts
    with engine_of(options, left) as submit:
        make_folder(out)
        failures = sweep(left, submit, flags=flags)
    say(f"{len(left) - len(failures)} runs ended well, {len(failures)} failed: {out}", *failures)
    return 1 if failures else 0


def add_vary(parser: argparse.ArgumentParser) -> None:
    """The option --vary, for ``variants_of``."""
    parser.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="OPTION=VALUE,VALUE",
        help="one option of sgimd run and its values; a list is one value in brackets: floor-at=[1000],[1000,5000]",
    )


def add_options(parser: argparse.ArgumentParser, *, seeds: str | None, default: str = "%(default)s") -> None:
    """Options of every command with many runs: --seeds, with that default, --processes and --dry-run."""
    parser.add_argument("--seeds", type=_seeds, default=seeds, help=f"5, 0-19 or 0,3,7-9 (default: {default})")
    parser.add_argument("--processes", type=_count, help="runs at a time (default: one for each core)")
    parser.add_argument("--dry-run", action="store_true", help="only list what is still to be done")


def add_engines(parser: argparse.ArgumentParser) -> None:
    """Options of where runs are carried out: --shard, --engine and --address."""
    parser.add_argument(
        "--shard",
        type=_shard,
        default="1/1",
        metavar="K/N",
        help="only the K-th of N equal parts of the list of runs, for a job array",
    )
    parser.add_argument(
        "--engine",
        choices=("local", "ray"),
        default="local",
        help="processes of this machine, or tasks of a Ray cluster, extra ray (default: %(default)s)",
    )
    parser.add_argument(
        "--address",
        metavar="HOST:PORT",
        help="of a running Ray cluster to which this machine belongs, or auto; without it, Ray starts one here",
    )


def engine_of(options: argparse.Namespace, configs: Sequence[Config]) -> AbstractContextManager[Submit]:
    """What the options of ``add_options`` and ``add_engines`` ask for, for these runs; its block starts it.

    Raises:
        ValueError: they contradict each other.
        ImportError: Ray is not installed.
    """
    if options.engine == "local" and options.address is not None:
        raise ValueError(f"--address {options.address} is of a Ray cluster; it needs --engine ray")
    if options.address is not None and options.processes is not None:
        raise ValueError("--processes cannot be given with --address: a cluster runs as many as it has cores")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1  # we may use
    processes = options.processes or cores
    if options.engine == "local" or not configs:  # nothing to do needs no cluster
        return local(processes)
    for config in configs:
        if config.board:
            raise ValueError("--board true cannot be given with --engine ray: a run returns without its event files")
        for path in (getattr(config, option) for option in FILES):
            if path is not None and (path.is_absolute() or ".." in path.parts):
                raise ValueError(f"--engine ray sends files of the working directory only, not {path}; copy it there")
    try:
        with loading():
            from sgimd_torch.runs.engines.on_ray import on_ray  # takes longer than all else to import
    except ModuleNotFoundError as error:
        hint = "pip install 'sgimd-torch[ray]' installs it"
        raise ImportError(f"--engine ray needs {error.name}, which is not installed; {hint}") from error
    return on_ray(
        options.address, processes, ships=any(code_of(config.settings) for config in configs), out=configs[0].out
    )


class Shard(NamedTuple):
    """The ``k``-th of ``n`` parts of a list, 1 the first: consecutive runs, so that each part has nearly all variants.

    Which runs they are depends on the list alone, not on what is finished. Sizes differ by 1 at most.
    """

    k: int
    n: int

    def of(self, whole: Sequence[Item]) -> Sequence[Item]:
        """This part of the list."""
        return whole[(self.k - 1) * len(whole) // self.n : self.k * len(whole) // self.n]

    def note(self, whole: Sequence[Item]) -> str:
        """For a message; nothing if it is the whole list."""
        return f", shard {self.k}/{self.n} of {len(whole)} runs" if self.n > 1 else ""


def variants_of(varied: Sequence[str], options: Sequence[str]) -> tuple[list[Config], list[str]]:
    """Every combination of the values, as a run that is named after it, and the flags among the ``options``.

    Args:
        varied: such as ``["goals=interest-map,uniform", "budget=5,15"]``.
        options: of ``sgimd run``, for all of them.

    Raises:
        ValueError: an option cannot be varied, or is given twice.
        SystemExit: ``sgimd run`` would refuse an option; it has said why.
    """
    given = [dashed(word.partition("=")[0].removeprefix("--")) for word in options if word.startswith("--")]
    values: dict[str, list[str]] = {}
    for word in varied:
        name, _, listed = word.removeprefix("--").partition("=")
        option = dashed(name)
        choices = re.split(r",(?![^[]*\])", listed)  # not at the commas in brackets
        if not all([option, *choices]):
            raise ValueError(f"--vary must be like goals=interest-map,uniform, got {word!r}")
        if option in [*values, *given]:
            raise ValueError(f"--{option} is there twice; put all its values in one --vary")
        values[option] = list(dict.fromkeys(choices))
    for option, instead in NOT_VARIED.items():
        if option in values or (option in given and option != "out"):
            raise ValueError(f"--{option} cannot be given here: {instead}")
    found = []
    for combination in itertools.product(*values.values()):
        chosen = dict(zip(values, combination, strict=True))
        config, flags = parse([*options, *(f"--{option}={value}" for option, value in chosen.items())])
        in_order = sorted(chosen, key=lambda option: (option != "algorithm", option))
        found.append(replace(config, name=",".join(_in_name(option, chosen[option]) for option in in_order) or None))
    return found, [f"--{dashed(flag)}" for flag, on in flags.items() if on]


def _in_name(option: str, value: str) -> str:
    """A choice in the name of a variant; a path is shortened to the name of its file."""
    return value if option == "algorithm" else f"{option}={Path(value).name if os.sep in value else value}"


def _shard(text: str) -> Shard:
    k, slash, n = text.partition("/")
    if not (slash and k.isdecimal() and n.isdecimal() and 1 <= int(k) <= int(n)):
        raise argparse.ArgumentTypeError(f"must be like 1/4, the first of four parts, got {text!r}")
    return Shard(int(k), int(n))


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"must be a whole number of at least 1, got {text!r}")
    return int(text)


def _seeds(text: str) -> list[int]:
    seeds: dict[int, None] = {}
    for part in text.split(","):
        first, dash, last = part.partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()) or int(last or first) < int(first):
            raise argparse.ArgumentTypeError(f"must be like 5, 0-19 or 0,3,7-9, got {text!r}")
        seeds |= dict.fromkeys(range(int(first), int(last or first) + 1))
    return list(seeds)
