"""Run one learner, evaluate it now and then, and write everything into one folder, such as OUT/NAME/seed-003.

Examples:
  sgimd run --algorithm sgim-d --seed 3 --resume              go on after Ctrl-C, or with more --movements
  sgimd run --environment mypackage.toss:make                 a run on your own robot
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from sgimd_torch.options.parse import parse
from sgimd_torch.runs.signals import Stopping, loading


def main(argv: Sequence[str] | None = None) -> int:
    """The command ``sgimd run``; returns 0 when the run has finished, or raises the errors of ``run_one``."""
    argv = sys.argv[1:] if argv is None else argv
    config, resume = parse(argv, __doc__)
    program = ["sgimd"] if Path(sys.argv[0]).name == "sgimd" else [sys.executable, "-m", "sgimd_torch"]
    again = [*program, "run", *argv, *([] if resume else ["--resume"])]
    with loading():
        from sgimd_torch.runs.directory import build_again, record_of, with_found_earlier  # late, so --help is fast
        from sgimd_torch.runs.run import run_one
    parts = build_again(with_found_earlier(config), record_of(config) if resume else None)
    with Stopping() as stopping:
        print(run_one(parts, stopping, resume=resume, again=shlex.join(again)))
    return 0
