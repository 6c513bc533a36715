"""One page about one run, or comparing many: a single file that opens from disk, without network.

It shows error curves with intervals over seeds, where movements landed, how the interest map split, and a film if
sgimd film has made one. It has tables of results, configurations and versions, and the commands that repeat each run.
Runs that are not finished are marked; a run that cannot be read is named and left out.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

from sgimd_torch.files import write_bytes
from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.process import say
from sgimd_torch.views.report.comparison import baseline_of
from sgimd_torch.views.report.data import find, read
from sgimd_torch.views.report.page import make_films, page

EXAMPLES = """examples:
  sgimd report runs/sgim-d/seed-003               one run, into runs/sgim-d/seed-003/report.html
  sgimd report runs/sgim-d                        all seeds of a variant
  sgimd report runs --out paper.html              every variant in runs, compared
  sgimd report runs --baseline sagg-riac          the same; differences are those to sagg-riac
  sgimd report runs/sgim-d/seed-003 --film        the same with a film, made first if there is none
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Write the page and print its path; returns 0.

    Raises:
        ValueError: there is nothing to report, or no place to write.
        OSError: a file cannot be read or written.
    """
    options = parser().parse_args(argv)
    out = options.out or options.runs / "report.html"
    try:
        found = find(options.runs)
        _check_writable(out)
        variants, unread = read(found)
        for line in unread:
            say(f"left out, damaged: {line}")
        baseline_of(variants, options.baseline)
        if options.film:
            make_films(variants)
        write_bytes(out, page(options.runs, variants, unread, options.baseline).encode())
    except KeyboardInterrupt:
        say("stopped; no page was written")
        raise
    print(out)
    return 0


def _check_writable(out: Path) -> None:
    """Called before any work."""
    if out.is_dir():
        raise RunError(f"--out must be a file, {out} is a folder; was {out / 'report.html'} meant?")
    if not out.parent.is_dir():
        raise RunError(f"--out must be in a folder that exists, got {out}")
    if not os.access(out.parent, os.W_OK):
        raise RunError(f"{out.parent} cannot be written to; name another place with --out")


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
    parser.add_argument("--film", action="store_true", help="film the runs that are shown, if there is no film yet")
    return parser
