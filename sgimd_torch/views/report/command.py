"""One page about one run, or about many beside each other: a single file that opens from disk, without network.

It tells what was run, shows error curves with intervals over seeds, where the float landed, how the interest map split,
and a film where scripts/film has made one; it has tables of results, configurations and versions, and the commands that
repeat each run. Runs that are not finished are counted as such; a damaged one is named and left out.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import FrameType
from typing import TypeVar

if __name__ == "__main__":  # Ctrl-C while the libraries below are loading
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))

from tqdm import tqdm

from sgimd_torch.catalogue import ROD
from sgimd_torch.runs.log import RunError, write_whole
from sgimd_torch.runs.process import say, with_streams
from sgimd_torch.views.report.data import Life, Variant, find, read_life
from sgimd_torch.views.report.films import MOST, ROOM, Film, find_films, make_film, read_film
from sgimd_torch.views.report.page import page
from sgimd_torch.views.report.section import section

Item = TypeVar("Item")
EXAMPLES = """examples:
  scripts/report runs/sgim-d/seed-003               one run, into runs/sgim-d/seed-003/report.html
  scripts/report runs/sgim-d                        all seeds of a variant
  scripts/report runs --out paper.html              every variant in runs, compared
  scripts/report runs/sgim-d/seed-003 --film        the same with a film, made first where there is none
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Read, draw, write; print where.

    Returns:
        The exit code: 0 done; 2 there is nothing to report, or no place to write; 130 stopped by Ctrl-C or SIGTERM.
    """
    options = _options(argv)
    previous = [signal.signal(number, _interrupt) for number in (signal.SIGINT, signal.SIGTERM)]
    try:
        found = find(options.runs)
        out = options.out or options.runs / "report.html"
        _check_writable(out)
        variants, damaged = read(found)
        if options.film:
            film(variants)
        films, notes = read_films(variants)
        sections = []
        for number, variant in enumerate(_counted("drawing", variants)):
            others = [other for other in variants if other is not variant]
            sections.append(section(variant, others, number, films[number]))
        write_whole(out, page(options.runs, variants, sections, damaged, notes=notes))
    except KeyboardInterrupt:
        say("stopped; no page was written")
        return 130
    except RunError as error:
        say(f"error: {error}")
        return 2
    except OSError as error:
        say(f"error: {error.filename} cannot be written or read: {error.strerror}; name another --out")
        return 2
    finally:
        for number, handler in zip((signal.SIGINT, signal.SIGTERM), previous, strict=True):
            signal.signal(number, handler)
    print(out)
    return 0


def read(found: dict[str, list[Path]]) -> tuple[list[Variant], list[str]]:
    """The variants, the one that errs least first, and a line for each damaged run.

    Raises:
        RunError: all are damaged.
    """
    lives: dict[str, list[Life]] = {}
    damaged = []
    for name, path in _counted("reading", [(name, path) for name, paths in found.items() for path in paths]):
        try:
            lives.setdefault(name, []).append(read_life(path))
        except RunError as error:
            damaged.append(str(error))
    variants = [Variant(name, each) for name, each in lives.items() if each]
    if not variants:
        more = f", and {len(damaged) - 1} more" if len(damaged) > 1 else ""
        raise RunError(f"no run can be read: {damaged[0]}{more}")
    for line in damaged:
        say(f"left out, damaged: {line}")
    return sorted(variants, key=_rank), damaged


def film(variants: Iterable[Variant]) -> None:
    """Films of the runs of the rod that the page shows, where there are none."""
    for variant in variants:
        if variant.typical.environment == ROD and not find_films(variant.typical.path):
            make_film(variant.typical.path)


def read_films(variants: Iterable[Variant]) -> tuple[list[list[Film]], list[str]]:
    """For each variant the films of the run that stands for it, and notes about those that do not fit into a page."""
    films: list[list[Film]] = []
    notes, room = [], ROOM
    for variant in variants:
        films.append([])
        for path in find_films(variant.typical.path):
            size = path.stat().st_size
            if size > min(MOST, room):
                notes.append(f"The film {path} is too large for this page ({size / 2**20:.1f} MB) and lies beside it.")
                continue
            films[-1].append(read_film(path))
            room -= size
    return films, notes


def _rank(variant: Variant) -> tuple[float, str]:
    return variant.final.value if variant.final else float("inf"), variant.name


def _counted(what: str, items: Sequence[Item]) -> Iterable[Item]:
    interval = 0.2 if sys.stderr.isatty() else 10.0
    return tqdm(items, what, unit="", delay=1.0, mininterval=interval, disable=len(items) < 2)


def _check_writable(out: Path) -> None:
    """Before any work."""
    if out.is_dir():
        raise RunError(f"--out must be a file, {out} is a folder; was {out / 'report.html'} meant?")
    if not out.parent.is_dir():
        raise RunError(f"--out must lie in a folder that exists, got {out}")
    if not os.access(out.parent, os.W_OK):
        raise RunError(f"{out.parent} cannot be written to; name another place with --out")


def _options(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="scripts/report",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("runs", type=Path, help="a run's directory, a variant's folder, or the --out of run.py")
    parser.add_argument("--out", type=Path, metavar="FILE", help="the page (default: RUNS/report.html)")
    parser.add_argument("--film", action="store_true", help="film the runs that are shown, where there is no film yet")
    return parser.parse_args(argv)


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(with_streams(main))
