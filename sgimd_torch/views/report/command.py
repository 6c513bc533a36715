"""Write one page about one run, or about many runs side by side: a single file that opens without network.

The page shows error curves with intervals over seeds, outcomes, errors by goal, found and expected, and the interest
map. It has tables of results, settings and versions, and the commands that repeat each run. It lists unfinished runs.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from sgimd_torch.files import write_text
from sgimd_torch.record import RunError
from sgimd_torch.runs.signals import parser_of
from sgimd_torch.views.report.page import page
from sgimd_torch.views.variants import Variant, best_first, read

EXAMPLES = """examples:
  sgimd report runs/sgim-d/seed-003               one run, into runs/sgim-d/seed-003/report.html
  sgimd report runs/sgim-d                        all seeds of a variant
  sgimd report runs --out paper.html              every variant in runs, compared
  sgimd report runs --baseline sagg-riac          differences from sagg-riac
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Write the page, print its path, and return the exit code 0.

    Raises:
        ValueError: there are no runs, or a run is damaged.
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
    parser = parser_of("report", __doc__, epilog=EXAMPLES)
    parser.add_argument("runs", type=Path, help="folder of a run, of a variant or of variants")
    parser.add_argument("--out", type=Path, metavar="FILE", help="page to write (default: RUNS/report.html)")
    parser.add_argument("--baseline", metavar="NAME", help="variant to compare the others with, seed by seed")
    return parser
