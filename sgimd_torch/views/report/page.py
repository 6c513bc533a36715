"""The page of a report: figures, films and numbers of each variant go into template.html.j2, as one file.

html = page(Path("runs"), variants, unread)    # from data.read; strings from runs are escaped
"""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from sgimd_torch.catalogue import CATALOGUE
from sgimd_torch.runs.log import RunError
from sgimd_torch.views.report import asking, comparison, figures, model, record
from sgimd_torch.views.report.data import Variant, counted, demonstrated, taught_by_hand
from sgimd_torch.views.report.figures import data_uri
from sgimd_torch.views.statistics import LEAST_SEEDS, Interval, show

EARLY: Final = 1000  # movements, for the column next to the last error
ORIGINS: Final = {"global": "global", "local": "local", "imitate": "imitation", "babble": "random", "": "at rest"}
PARTS: Final = {"physics": "physics (s)", "learner": "learning (s)", "evaluation": "evaluation (s)"}
FILMED: Final = [word for word, entry in CATALOGUE["environment"].items() if entry.filmed]
MOST: Final = 3 * 2**20  # bytes of one film
ROOM: Final = 5 * 2**20  # bytes of all films of a page


def page(place: Path, variants: Sequence[Variant], unread: Sequence[str], baseline: str | None = None) -> str:
    """The page.

    Args:
        place: where the runs were found.
        variants: the best first, not empty.
        unread: a line for each run that could not be read.
        baseline: name of the variant that the others are compared with; see `comparison.baseline_of`.

    Raises:
        ValueError: the baseline is no variant with errors.
    """
    reference = comparison.baseline_of(variants, baseline)
    films, notes = read_films(variants)
    lives = [life for variant in variants for life in variant.lives]
    warnings = [*comparison.few_seeds(variants), *record.doubts(variants), *(f"Left out, damaged: {x}" for x in unread)]
    jinja = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    jinja.filters |= {
        "interval": _interval,
        "number": _number,
        "json": partial(json.dumps, indent=2, ensure_ascii=False),
        "usual": lambda cells: next((cell for cell in cells if 2 * cells.count(cell) > len(cells)), None),
        "word": lambda path: shlex.quote(str(path)),
    }
    html = jinja.get_template("template.html.j2").render(
        place=place,
        variants=variants,
        single=lives[0] if len(lives) == 1 else None,
        n_runs=len(lives),
        warnings=[*warnings, *notes],
        baseline=reference,
        compared=comparison.compare(variants, reference) if reference else [],
        colours=figures.colours_of(variants),
        planes=figures.planes_of(variants),
        early=EARLY,
        least_seeds=LEAST_SEEDS,
        lived=lived(variants),
        films=films,
        filmed=FILMED,
        figures=figures,
        record=record,
        model=model,
        asking=asking,
        counted=counted,
        demonstrated=demonstrated,
        taught_by_hand=taught_by_hand,
    )
    return html.encode(errors="backslashreplace").decode()  # a name may not be valid text


def lived(variants: Sequence[Variant]) -> record.Table:
    """Means over the runs of each variant: movements, shares of where they came from, demonstrations, seconds."""
    groups = [variant.used or variant.lives for variant in variants]
    counts = [Counter(origin for life in lives for origin in life.origin.tolist()) for lives in groups]
    origins = sorted(set().union(*counts), key=lambda origin: ([*ORIGINS, origin].index(origin), origin))
    rows = []
    for variant, lives, count in zip(variants, groups, counts, strict=True):
        shown = [life.shown.tolist() for life in lives]
        whole = [count.total(), sum(map(len, shown)), sum(len(set(each)) for each in shown)]
        shares = [100 * count[origin] / max(1, count.total()) for origin in origins]
        seconds = [float(np.mean([life.seconds(part) for life in lives])) for part in PARTS]
        cells = [_number(n / len(lives) or np.nan, 0) for n in whole]
        cells[1:1] = [_number(share or np.nan, 1) for share in shares]
        rows.append((variant.label, [*cells, *(_number(value, 1) for value in seconds)]))
    shares_of = [f"{ORIGINS.get(origin, origin)} (%)" for origin in origins]
    head = ["movements", *shares_of, "demonstrations shown", "of them different", *PARTS.values()]
    return record.Table(head, rows)


def find_films(run: Path) -> list[Path]:
    """The films in a run directory, and those next to it with its name, as ``sgimd film`` writes them."""
    run = run.resolve()
    next_to = [run.parent / f"{run.name}{kind}.mp4" for kind in ("", "-time-lapse")]
    return [path for path in (*next_to, *sorted(run.glob("*.mp4"))) if path.is_file()]


def make_films(variants: Sequence[Variant]) -> None:
    """Film the runs that the page shows, as ``sgimd film`` does, if there is no film yet and our robot can be filmed.

    Raises:
        RunError: filming failed; the reason is on stderr.
    """
    for run in [variant.typical.path for variant in variants if variant.typical.environment in FILMED]:
        if find_films(run):
            continue
        command = [sys.executable, "-m", "sgimd_torch", "film", "--", str(run)]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as filming:
            try:
                code = filming.wait()
            except BaseException:
                filming.terminate()  # it removes its unfinished film; leaving the block waits for that
                raise
        if code == 130:
            raise KeyboardInterrupt
        if code:
            raise RunError(f"{run} could not be filmed, see above; leave out --film")


def read_films(variants: Sequence[Variant]) -> tuple[dict[str, list[dict[str, str]]], list[str]]:
    """By variant the films of its typical run, and notes about films that are too large for a page."""
    films: dict[str, list[dict[str, str]]] = {variant.name: [] for variant in variants}
    notes, room = [], ROOM
    for variant in variants:
        for path in find_films(variant.typical.path):
            size = path.stat().st_size
            if size > min(MOST, room):
                notes.append(f"The film {path} is too large for this page ({size / 2**20:.1f} MB).")
                continue
            room -= size
            source = data_uri("video/mp4", path.read_bytes())
            films[variant.name].append({"name": path.stem, "source": source, "poster": _still(path)})
    return films, notes


def _still(path: Path) -> str:
    """The picture half a second before the end, where a landing is shown."""
    try:
        from imageio_ffmpeg import get_ffmpeg_exe
    except ImportError:  # the extra "film" is not installed; a browser then shows the first picture
        return ""
    options = ["-sseof", "-0.5", "-i", str(path), "-frames:v", "1", "-q:v", "5", "-f", "mjpeg", "-"]
    ended = subprocess.run([get_ffmpeg_exe(), "-v", "error", *options], capture_output=True)
    return data_uri("image/jpeg", ended.stdout) if ended.returncode == 0 and ended.stdout else ""


def _interval(found: Interval | None, form: str = ".3f") -> str:
    """``0.060 [0.058, 0.062]``, a dash for nothing."""
    return "–" if found is None else show(found, form)


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else "–"
