"""The paper's figures, made anew: runs of its five learners, and a page that shows each figure beside its statement.

Section 6 of Nguyen & Oudeyer (2014), and figs. 5 to 7 of its method. The runs of each variant go to OUT/NAME/seed-000,
the page is OUT/paper.html. Repeat the command after Ctrl-C, with more seeds or with --full: finished runs are kept,
unfinished ones continue. A longer study and verdicts on each statement are in results/RESULTS.md of the repository.

By default the learners are those that the paper prints: sagg-riac-letter, sgim-d-letter, and the others with eq. (9).
With --algorithm ours they have our inverse model and exploration; choose another OUT for them.

  sgimd paper figures                     1000 movements, 5 seeds: about ten minutes on two cores
  sgimd paper figures --full              the paper's 5000 movements, evaluated every 1000, 10 seeds: an hour or two
  sgimd paper ours --algorithm ours       with our inverse model and exploration
  sgimd paper figures --on HOST:PORT      on a Dask cluster

Other options of sgimd run, such as --movements, apply to all runs.

Exit code: 0 all went well, 1 a run failed, 2 the request is wrong, 130 or 143 stopped by Ctrl-C or SIGTERM.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from sgimd_torch.demonstrations import SHIPPED
from sgimd_torch.extras.paper import figures
from sgimd_torch.extras.paper.replication import LEARNERS, TAUGHT, Replication
from sgimd_torch.extras.report import provenance
from sgimd_torch.extras.report.command import rendered
from sgimd_torch.extras.sweep.command import add_options, given_in, refuse, run_all
from sgimd_torch.extras.table.results import results
from sgimd_torch.extras.table.statistics import LEAST_SEEDS
from sgimd_torch.extras.table.variants import Variant, best_first
from sgimd_torch.files import write_text
from sgimd_torch.options.catalogue import ROD
from sgimd_torch.options.config import Config
from sgimd_torch.options.parse import parse
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.program import parser_of
from sgimd_torch.runs.read import Run, finished, read_run

PARTS: Final[dict[str, tuple[tuple[str, ...], tuple[str, ...]]]] = {
    "": (LEARNERS, ()),
    **{
        f"-demonstrator-{k}": (TAUGHT, (f"--demonstrations={SHIPPED.with_name(f'demonstrator_{k}.npz')}",))
        for k in (1, 2)
    },
    "-large": (("sagg-riac", "sgim-d"), ("--environment.task-space=100",)),
}
"""Learners and options of each part of the study, by the ending of its names. The first has demonstrator 3."""
SHORT: Final = ("--movements=1000",)
FULL: Final = ("--movements=5000", "--evaluate-at=1000,2000,3000,4000")
FIXED: Final = {
    **dict.fromkeys(
        ("environment", "environment.task-space", "demonstrations", "inverse"), "the page has its own runs"
    ),
    **dict.fromkeys(("name", "out"), "the runs go to OUT, each variant under its own name"),
    "seed": "use --seeds, such as 5, 0-19 or 0,3,7-9",
}


def main(argv: Sequence[str] | None = None) -> int:
    """Make the runs, write the page, print its path, and return the exit code, which is 1 if runs failed.

    Raises:
        ValueError: the request is wrong.
        OSError: a file cannot be read or written.
    """
    options, rest = parser().parse_known_args(argv)
    out, full = options.out, options.full
    plan = plan_of(out, [*(FULL if full else SHORT), *rest], ours=options.algorithm == "ours")
    seeds = options.seeds or range(10 if full else 5)
    whole = [replace(config, seed=seed) for seed in seeds for config in plan.values()]
    code = run_all(whole, options, out)
    left = sum(not finished(config) for config in whole)
    if code or left or options.dry_run:
        say(f"the page is written when all runs are finished; {left} of {len(whole)} are left")
        return code
    write_text(out / "paper.html", page(plan, seeds))
    print(out / "paper.html")
    return 0


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd paper``."""
    parser = parser_of("paper", __doc__, usage="%(prog)s OUT [--full] [--seeds SEEDS] [--OPTION VALUE ...]")
    parser.add_argument("out", type=Path, metavar="OUT", help="folder of the runs and of the page")
    parser.add_argument("--full", action="store_true", help="the paper's number of movements, and 10 seeds")
    learners = "learners: letter, as the paper prints them, or ours (default: %(default)s)"
    parser.add_argument("--algorithm", choices=("letter", "ours"), default="letter", help=learners)
    add_options(parser, seeds=None, default="0-4, with --full 0-9")
    return parser


def plan_of(out: Path, words: Sequence[str], *, ours: bool) -> dict[str, Config]:
    """The variants of the study by name, such as "sgim-d-large", each with seed 0.

    Args:
        out: folder of the runs.
        words: options of ``sgimd run`` for all runs.
        ours: whether the learners have our inverse model and exploration.

    Raises:
        ValueError: an option is fixed by the study, or is refused by ``sgimd run``.
    """
    refuse(given_in(words), FIXED)
    plan = {}
    for ending, (learners, differing) in PARTS.items():
        for learner in learners:
            letter = f"{learner}-letter" if learner in ("sagg-riac", "sgim-d") else learner
            own = [] if ours or letter != learner else ["--inverse=paper"]  # sgim-d-letter has it by default
            own += ["--exact-first=false"] * (learner == "imitation" and not ours)
            algorithm = learner if ours else letter
            given = [f"--algorithm={algorithm}", f"--environment={ROD}", *own, *differing, *words]
            plan[learner + ending] = replace(parse(given)[0], out=out, name=algorithm + ending)
    if not plan["sgim-d"].evaluations:
        raise ValueError("--evaluate-at [] leaves nothing to draw; choose some movements, or omit it")
    return plan


def page(plan: Mapping[str, Config], seeds: Sequence[int]) -> str:
    """The page as HTML, from the runs on disk.

    Args:
        plan: variants by name, as made by ``plan_of``.
        seeds: seeds of each variant; all runs are finished.
    """
    variants = {
        name: Variant(name, [_told(name, read_run(replace(config, seed=seed).directory)) for seed in seeds])
        for name, config in plan.items()
    }
    five = best_first(variants[name] for name in LEARNERS)
    return rendered(
        Path(__file__).with_name("paper.html.j2"),
        config=plan["sgim-d"],
        study=Replication(plan["sgim-d"], variants),
        variants=list(variants.values()),
        five=five,
        results=results(five),
        warnings=list(provenance.warnings(list(variants.values()))),
        n_seeds=len(seeds),
        least_seeds=LEAST_SEEDS,
        figures=figures,
        provenance=provenance,
    )


def _told(name: str, run: Run) -> Run:
    """The run, without remarks on a T that the page itself has made too large."""
    return replace(run, remarks=[]) if name.endswith("-large") else run
