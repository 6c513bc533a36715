"""One page about one run, or comparing many: a single file that opens from disk, without network.

It shows error curves with intervals over seeds, where movements landed and how competent the learner is there. It has
tables of results, settings and versions, and the commands that repeat each run. Runs that are not finished are marked.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from sgimd_torch.files import write_text
from sgimd_torch.record import RunError
from sgimd_torch.views.report.page import page
from sgimd_torch.views.variants import Variant, best_first, read

EXAMPLES = """examples:
  sgimd report runs/sgim-d/seed-003               one run, into runs/sgim-d/seed-003/report.html
  sgimd report runs/sgim-d                        all seeds of a variant
  sgimd report runs --out paper.html              every variant in runs, compared
  sgimd report runs --baseline sagg-riac          the same; differences are those to sagg-riac
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Write the page and print its path; returns 0.

    Raises:
        ValueError: there is nothing to report, or a run is damaged.
        OSError: a file cannot be read or written.
    """
    options = parser().parse_args(argv)
    out = options.out or options.runs / "report.html"
    if options.out is not None and (out.is_dir() or not out.parent.is_dir()):  # before any work
        raise RunError(f"--out must be a file in a folder that exists, got {out}")
    variants = best_first(Variant(name, runs) for name, runs in read(options.runs).items())
    write_text(out, page(options.runs, variants, options.baseline))
    print(out)
    return 0


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd report``."""
    parser = argparse.ArgumentParser(
        prog="sgimd report",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("runs", type=Path, help="a run's directory, a variant's folder, or the --out of sgimd run")
    parser.add_argument("--out", type=Path, metavar="FILE", help="the page (default: RUNS/report.html)")
    parser.add_argument("--baseline", metavar="NAME", help="variant that the others are compared with, seed by seed")
    return parser
