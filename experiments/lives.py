"""Lives that are no runs of `sgimd run`: several processes make them, and a table in results/ keeps their rows.

    make_lives(Path("results"), "random.csv", life, {(200, "practice"): 1000}, processes=2)
A life that is in the table is not made again. After Ctrl-C or a power cut, only the lives of that moment are lost.
"""

from __future__ import annotations

import argparse
import signal
from collections.abc import Callable, Mapping
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

from sgimd_torch.runs.signals import Progress, say
from table import TABLES, merge, read_table

MakeLife = Callable[..., Mapping[Any, tuple[float, ...]]]
"""Function of a key that returns the rows of a life: by the last part of a row's key, such as its number of movements,
the other columns, such as the error and how many changes were noticed by then."""
_LATE: Final = -1  # the key of a row ends with what differs between the rows of a life


def make_lives(
    folder: Path, name: str, make_life: MakeLife, lives: Mapping[tuple[Any, ...], int], processes: int
) -> None:
    """Make the lives that the table lacks, and show progress.

    Args:
        folder: folder of the table.
        name: file name of the table.
        make_life: function that makes a life.
        lives: number of movements of each life, by key; a key has the first columns of the table.
        processes: number of lives at a time.
    """
    n_key, columns = TABLES[name]
    known = {*read_table(folder, name)[[*columns[: n_key + _LATE]]].itertuples(index=False, name=None)}
    left, done = [key for key in lives if key not in known], 0
    say(f"{name}: {len(lives)} lives, {len(lives) - len(left)} of them made already")
    # Spawned, because a forked process would share the locks of this one's threads.
    pool = get_context("spawn").Pool(processes, signal.signal, (signal.SIGINT, signal.SIG_IGN))
    with pool, Progress(name, sum(map(lives.__getitem__, left))) as progress:
        for n, (key, made) in enumerate(pool.imap_unordered(partial(_made, make_life), left), 1):
            merge(folder, name, [dict(zip(columns, (*key, at, *errors), strict=True)) for at, errors in made.items()])
            done += lives[key]
            progress.show(done, f"{n} of {len(left)} lives")


def parser(about: str | None) -> argparse.ArgumentParser:
    """A parser of the options that all scripts that make lives have."""
    made = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("--results", type=Path, default=Path("results"), help="folder of the table (default: results)")
    made.add_argument("--processes", type=int, default=2, help="number of lives at a time (default: 2)")
    return made


def _made(make_life: MakeLife, key: tuple[Any, ...]) -> tuple[tuple[Any, ...], Mapping[Any, tuple[float, ...]]]:
    return key, make_life(*key)
