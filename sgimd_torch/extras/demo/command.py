"""Three learners learn to fish; a figure and a table show their results.

The three runs have the same seed, the same simulated arm and the same motor noise; they run side by side. `random`
moves at random. sgim-d has curiosity and a teacher. practice-taught, the best learner of this library, executes
all demonstrations once, then makes one movement for each goal. The command writes to --out (default: runs/demo):

  random/seed-000/ and so on   the record of each run (docs/runs.md explains the files)
  demo.png                     error against movements

After Ctrl-C or a power cut, repeat the command to continue; finished runs are kept. Other options of sgimd
run, such as --movements, apply to all three learners.

  sgimd demo                                       the paper's 5000 movements, seed 0
  sgimd demo --movements 1000                      a first look, in half a minute
  sgimd demo --seed 1                              another seed
  sgimd demo --out runs/quiet --environment.noise 0     without motor noise

Exit code: 0 all went well, 1 a run failed, 2 the request is wrong, 130 or 143 stopped by Ctrl-C or SIGTERM.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from functools import partial
from typing import Final

from sgimd_torch.extras.sweep.command import given_in, refuse
from sgimd_torch.extras.sweep.parallel import Machine, sweep
from sgimd_torch.extras.table.names import label
from sgimd_torch.options.catalogue import ROD
from sgimd_torch.options.config import Config
from sgimd_torch.options.parse import parse
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.program import Failed, parser_of
from sgimd_torch.runs.read import finished, read_run
from sgimd_torch.runs.signals import loading

LEARNERS: Final = {
    "random": "makes random movements",
    "sgim-d": "chooses goals where its competence changes, and gets a demonstration every 30 movements",
    "practice-taught": "executes all demonstrations once, then makes one movement for each goal",
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the learners, draw the figure, print the table, and return the exit code 0.

    Raises:
        ValueError: the request is wrong.
        Failed: a run failed.
    """
    _, rest = parser().parse_known_args(argv)
    configs = configs_of(rest)
    with loading():  # a missing extra is reported before the runs, not after them
        from sgimd_torch.extras.report.figures import figure_of_curves
        from sgimd_torch.extras.report.save import save_figure
        from sgimd_torch.extras.table import command as table
        from sgimd_torch.extras.table.variants import Variant
        from sgimd_torch.runs.build import build
    began, base = time.monotonic(), configs["sgim-d"]
    for config in configs.values():
        build(config)  # a wrong option is refused before anything starts
    say(f"{len(configs)} learners, {base.movements} movements each, seed {base.seed}, side by side: {base.out}")
    say(*(f"{label(algorithm)} {does}" for algorithm, does in LEARNERS.items()))
    unfinished = [config for config in configs.values() if not finished(config)]
    if failures := sweep(unfinished, Machine(len(configs))):
        raise Failed("\n".join(failures))
    variants = [Variant(name, [read_run(config.directory)]) for name, config in configs.items()]
    save_figure(partial(figure_of_curves, variants), figure := base.out / "demo.png")
    print("\nMean distance to the benchmark goals, by number of movements, and the time of a movement\n")
    table.main([str(base.out)])
    print(f"\nFigure  {figure}\nRuns    {base.out}\nTime    {time.monotonic() - began:.0f} s\n\nNext, try")
    print(f"  sgimd report {base.out}    # one page: curves, maps, interest")
    print(f"  sgimd film {base.directory}    # SGIM-D casts at goals; needs sgimd-torch[film]")
    return 0


def configs_of(rest: Sequence[str]) -> dict[str, Config]:
    """The settings of each learner's run, by name of the learner.

    Args:
        rest: options of ``sgimd run`` for all learners.

    Raises:
        ValueError: an option is fixed by the demo, or leaves nothing to draw.
    """
    refuse(given_in(rest), dict.fromkeys(("algorithm", "name", "environment"), "the demo shows its own learners"))
    words = ["--out=runs/demo", "--evaluate-at=250,1000", "--floor-at=[]", f"--environment={ROD}", *rest]
    configs = {algorithm: parse([*words, f"--algorithm={algorithm}"])[0] for algorithm in LEARNERS}
    if not configs["sgim-d"].evaluations:
        raise ValueError("--evaluate-at [] leaves nothing to draw; choose some movements, or omit it")
    return configs


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd demo``."""
    return parser_of("demo", __doc__, usage="%(prog)s [--OPTION VALUE ...]")
